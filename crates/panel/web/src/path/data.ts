/**
 * The way of a program as vertices, in chunks that a graphics card takes as they are, with coarser levels of each, and how far the
 * machine has gone along it.
 */

export const RAPID = 1;
const FEED = 2;
const ARC = 3;
/** Vertices of a chunk: the index 65535 of 16 bits ends a line strip, so it is none. */
export const CHUNK = 65_535;
/** Deviation of each level, mm; level 0 has all vertices. */
export const TOLERANCES_MM = [0, 0.04, 0.16, 0.64, 2.56, 10.24];
/** Vertices between which a level is made: bounds what a path costs that is bad for it. */
const BLOCK = 1024;

/** Speeds of the done part in one octet: 0 is not done, 1 done at an unknown speed, above on a logarithmic scale. */
export const SPEED_MIN_MM_S = 0.1;
export const SPEED_MAX_MM_S = 2000;

export function speedCode(mm_s: number): number {
  const share = Math.log(Math.max(mm_s, SPEED_MIN_MM_S) / SPEED_MIN_MM_S) / Math.log(SPEED_MAX_MM_S / SPEED_MIN_MM_S);
  return 2 + Math.round(253 * Math.min(1, share));
}

export interface Chunk {
  count: number;
  /** X, Y, Z of each vertex, mm. */
  xyz: Float32Array;
  kind: Uint8Array;
  line: Uint32Array;
  done: Uint8Array;
  /** Which vertices each level above 0 has; once the chunk is full, or the way at its end. */
  levels: Uint16Array[] | null;
  min: [number, number, number];
  max: [number, number, number];
  /** Grows with what is in it; `doneChanged` with its done part. */
  revision: number;
  doneChanged: number;
}

function emptyChunk(): Chunk {
  return {
    count: 0,
    xyz: new Float32Array(3 * CHUNK),
    kind: new Uint8Array(CHUNK),
    line: new Uint32Array(CHUNK),
    done: new Uint8Array(CHUNK),
    levels: null,
    min: [Infinity, Infinity, Infinity],
    max: [-Infinity, -Infinity, -Infinity],
    revision: 0,
    doneChanged: 0,
  };
}

export class PathData {
  readonly chunks: Chunk[] = [];
  /** Vertices; the last one of a chunk is the first one of the next, and counts once. */
  count = 0;
  readonly min: [number, number, number] = [Infinity, Infinity, Infinity];
  readonly max: [number, number, number] = [-Infinity, -Infinity, -Infinity];
  /** Of the last vertex that the machine has passed; -1: none. */
  reached = -1;
  /** What the moves at feed reach, in a system that is turned as the work system is. */
  readonly feedMin: [number, number, number] = [Infinity, Infinity, Infinity];
  readonly feedMax: [number, number, number] = [-Infinity, -Infinity, -Infinity];
  private last: [number, number, number] | null = null;
  private readonly turn: [number, number];

  /** `degrees`: by how much the work system is turned about Z. */
  constructor(degrees = 0) {
    const angle = (-degrees * Math.PI) / 180;
    this.turn = [Math.cos(angle), Math.sin(angle)];
  }

  get segments(): number {
    return Math.max(0, this.count - 1);
  }

  append(line: number, kind: number, x: number, y: number, z: number): void {
    let chunk = this.chunks.at(-1);
    if (!chunk || chunk.count === CHUNK) {
      const before = chunk;
      if (before) this.close(before);
      chunk = emptyChunk();
      this.chunks.push(chunk);
      if (before) {
        const last = CHUNK - 1;
        this.put(chunk, before.line[last]!, before.kind[last]!, before.xyz[3 * last]!, before.xyz[3 * last + 1]!, before.xyz[3 * last + 2]!);
      }
    }
    this.put(chunk, line, kind, x, y, z);
    this.count++;
    const [c, s] = this.turn;
    const place: [number, number, number] = [c * x - s * y, s * x + c * y, z];
    if (kind === FEED || kind === ARC) {
      if (this.last) this.feeds(this.last);
      this.feeds(place);
    }
    this.last = place;
  }

  private feeds(place: [number, number, number]): void {
    for (let k = 0; k < 3; k++) {
      if (place[k]! < this.feedMin[k]!) this.feedMin[k] = place[k]!;
      if (place[k]! > this.feedMax[k]!) this.feedMax[k] = place[k]!;
    }
  }

  /** The way is at its end. */
  finish(): void {
    const last = this.chunks.at(-1);
    if (last && !last.levels) this.close(last);
  }

  private put(chunk: Chunk, line: number, kind: number, ...place: [number, number, number]): void {
    const i = chunk.count++;
    chunk.line[i] = line;
    chunk.kind[i] = kind;
    for (let k = 0; k < 3; k++) {
      const value = place[k]!;
      chunk.xyz[3 * i + k] = value;
      if (value < chunk.min[k]!) chunk.min[k] = value;
      if (value > chunk.max[k]!) chunk.max[k] = value;
      if (value < this.min[k]!) this.min[k] = value;
      if (value > this.max[k]!) this.max[k] = value;
    }
    chunk.revision++;
  }

  private close(chunk: Chunk): void {
    const significance = significances(chunk);
    chunk.levels = TOLERANCES_MM.slice(1).map((tolerance) => {
      const indices = new Uint16Array(chunk.count);
      let n = 0;
      for (let i = 0; i < chunk.count; i++) if (significance[i]! > tolerance) indices[n++] = i;
      return indices.slice(0, n);
    });
    chunk.revision++;
  }

  /** Chunk and place in it of a vertex. */
  private at(vertex: number): [Chunk, number] {
    const c = Math.min(this.chunks.length - 1, Math.max(0, Math.floor((vertex - 1) / (CHUNK - 1))));
    return [this.chunks[c]!, vertex - c * (CHUNK - 1)];
  }

  vertex(index: number): [number, number, number] {
    const [chunk, i] = this.at(index);
    return [chunk.xyz[3 * i]!, chunk.xyz[3 * i + 1]!, chunk.xyz[3 * i + 2]!];
  }

  lineOf(vertex: number): number {
    const [chunk, i] = this.at(vertex);
    return chunk.line[i]!;
  }

  /** Squared distance of a place from the segment that ends at a vertex. */
  private away(vertex: number, place: readonly number[]): number {
    const [chunk, i] = this.at(vertex);
    return i === 0 ? Infinity : segmentDistance2(chunk.xyz, i - 1, i, place);
  }

  /** Nothing is done any more: the program begins. */
  restart(): void {
    for (const chunk of this.chunks) {
      chunk.done.fill(0);
      chunk.doneChanged++;
    }
    this.reached = -1;
  }

  /**
   * The machine is at this place, in this line, and has done that much of the program: marks what it has passed. The way ahead is
   * looked through for the segment on which it is; where it is on none of them, the whole way.
   */
  locate(place: readonly number[], line: number, share: number | null, mm_s: number, backwards: boolean): void {
    if (this.count < 2) return;
    const from = this.reached;
    let to = from < 0 ? this.search(place, line, share) : this.ahead(place, line, from, backwards ? -1 : 1);
    if (to < 0) to = this.search(place, line, share);
    if (to < 0) return;
    // The segment on which the machine is ends at `to`: what is behind it is done.
    const done = to - 1;
    if (done === from) return;
    if (done > from) this.mark(from + 1, done, from < 0 ? 1 : speedCode(mm_s));
    else this.mark(done + 1, from, 0);
    this.reached = done;
  }

  private mark(first: number, last: number, code: number): void {
    for (let vertex = Math.max(0, first); vertex <= last; ) {
      const c = Math.min(this.chunks.length - 1, Math.max(0, Math.floor((vertex - 1) / (CHUNK - 1))));
      const chunk = this.chunks[c]!;
      const base = c * (CHUNK - 1);
      const end = Math.min(last, base + chunk.count - 1);
      chunk.done.fill(code, vertex - base, end - base + 1);
      chunk.doneChanged++;
      vertex = end + 1;
    }
  }

  /** The end of the segment near here on which the machine is; -1: it is on none of them. */
  private ahead(place: readonly number[], line: number, from: number, step: 1 | -1): number {
    let best = -1;
    let least = NEAR_MM * NEAR_MM;
    const end = Math.min(this.count - 1, Math.max(1, from + 1 + step * LOOK_AHEAD));
    for (let vertex = Math.max(1, from + 1); step > 0 ? vertex <= end : vertex >= end; vertex += step) {
      const distance = this.away(vertex, place);
      const here = this.lineOf(vertex) === line ? distance : distance + ELSEWHERE_MM2;
      if (here < least) {
        least = here;
        best = vertex;
      } else if (best >= 0 && least < ON_IT_MM2 && Math.abs(vertex - best) > 64) {
        break;
      }
    }
    return best;
  }

  private search(place: readonly number[], line: number, share: number | null): number {
    let best = -1;
    let least = Infinity;
    for (let vertex = 1; vertex < this.count; vertex++) {
      if (this.lineOf(vertex) !== line) continue;
      const distance = this.away(vertex, place);
      if (distance > NEAR_MM * NEAR_MM) continue;
      // Of places that lie on each other the one that the share of the plan says.
      const cost = distance + (share === null ? 0 : 1e4 * (vertex / this.count - share) ** 2);
      if (cost < least) {
        least = cost;
        best = vertex;
      }
    }
    return best;
  }
}

/** A machine farther from the way is not on it: jogged away, or on the way to its beginning. */
const NEAR_MM = 2;
/** Segments that are looked through at each message: 20 a second. */
const LOOK_AHEAD = 4000;
/** What counts as on a segment, mm^2: following error, corners that are rounded. */
const ON_IT_MM2 = 0.01;
/** How much a segment of another line has to be nearer, mm^2. */
const ELSEWHERE_MM2 = 0.04;

function segmentDistance2(xyz: Float32Array, a: number, b: number, place: readonly number[]): number {
  const [ax, ay, az] = [xyz[3 * a]!, xyz[3 * a + 1]!, xyz[3 * a + 2]!];
  const [dx, dy, dz] = [xyz[3 * b]! - ax, xyz[3 * b + 1]! - ay, xyz[3 * b + 2]! - az];
  const [px, py, pz] = [place[0]! - ax, place[1]! - ay, place[2]! - az];
  const length2 = dx * dx + dy * dy + dz * dz;
  const s = length2 > 0 ? Math.min(1, Math.max(0, (px * dx + py * dy + pz * dz) / length2)) : 0;
  return (px - s * dx) ** 2 + (py - s * dy) ** 2 + (pz - s * dz) ** 2;
}

/**
 * How far a path without a vertex would be off, mm, by Douglas and Peucker's method within blocks: a level has the vertices above
 * its tolerance, and all of its path lies within it. A vertex where another kind of move begins counts by the shorter of its moves.
 */
function significances(chunk: Chunk): Float32Array {
  const { count, xyz, kind } = chunk;
  const significance = new Float32Array(count);
  for (let first = 0; first < count; first += BLOCK) {
    const last = Math.min(count - 1, first + BLOCK);
    significance[first] = significance[last] = Infinity;
    const stack: [number, number, number][] = [[first, last, Infinity]];
    for (let span = stack.pop(); span; span = stack.pop()) {
      const [a, b, above] = span;
      let far = -1;
      let farthest = -1;
      const end = [0, 0, 0];
      for (let i = a + 1; i < b; i++) {
        for (let k = 0; k < 3; k++) end[k] = xyz[3 * i + k]!;
        const distance = segmentDistance2(xyz, a, b, end);
        if (distance > farthest) [far, farthest] = [i, distance];
      }
      if (far < 0) continue;
      // Never above that of the span: levels are nested.
      const here = Math.min(above, Math.sqrt(farthest));
      significance[far] = here;
      stack.push([a, far, here], [far, b, here]);
    }
  }
  for (let i = 1; i + 1 < count; i++) {
    if (kind[i] === kind[i + 1]) continue;
    const move = (a: number) =>
      Math.hypot(xyz[3 * a + 3]! - xyz[3 * a]!, xyz[3 * a + 4]! - xyz[3 * a + 1]!, xyz[3 * a + 5]! - xyz[3 * a + 2]!);
    significance[i] = Math.max(significance[i]!, Math.min(move(i - 1), move(i)));
  }
  return significance;
}

/** The index that ends a line strip and begins another. */
const END_OF_STRIP = 65_535;

/**
 * The vertices of one of so many parts of a chunk (`stride`, above 1) in a level: for a picture in motion, where more is drawn on each
 * other than can be told apart.
 */
export function thinned(chunk: Chunk, level: number, stride: number): Uint16Array {
  const all = level > 0 ? chunk.levels![level - 1]! : null;
  const count = all ? all.length : chunk.count;
  const indices = new Uint16Array(count + Math.ceil(chunk.count / BLOCK));
  let n = 0;
  let last = -1;
  for (let k = 0; k < count; k++) {
    const i = all ? all[k]! : k;
    const part = Math.floor(i / BLOCK);
    if (part % stride !== 0) continue;
    if (last >= 0 && part !== last) indices[n++] = END_OF_STRIP;
    last = part;
    indices[n++] = i;
  }
  return indices.slice(0, n);
}

/** The coarsest level whose deviation is no more than a pixel at so many pixels a mm. */
export function levelFor(pixels_per_mm: number): number {
  let level = 0;
  while (level + 1 < TOLERANCES_MM.length && TOLERANCES_MM[level + 1]! * pixels_per_mm <= 0.75) level++;
  return level;
}
