/** Ends of the lines of a box, and of a grid of 10, 50 or 100 mm on its floor. */
export function boxLines({ min, max }: { min: readonly number[]; max: readonly number[] }): { edges: number[]; grid: number[] } {
  const corner = (i: number) => [i & 1 ? max[0]! : min[0]!, i & 2 ? max[1]! : min[1]!, i & 4 ? max[2]! : min[2]!];
  const edges: number[] = [];
  for (let i = 0; i < 8; i++) for (const bit of [1, 2, 4]) if (!(i & bit)) edges.push(...corner(i), ...corner(i | bit));
  const size = Math.max(max[0]! - min[0]!, max[1]! - min[1]!);
  const step = size > 1500 ? 200 : size > 600 ? 100 : size > 120 ? 50 : 10;
  const grid: number[] = [];
  for (let k = 0; k < 2; k++) {
    const other = 1 - k;
    for (let at = Math.ceil(min[k]! / step) * step; at <= max[k]!; at += step) {
      for (const end of [min[other]!, max[other]!]) grid.push(...(k === 0 ? [at, end, min[2]!] : [end, at, min[2]!]));
    }
  }
  return { edges, grid };
}
