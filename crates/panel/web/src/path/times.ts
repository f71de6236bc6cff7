/**
 * When the tool is where, as far as it can be told before a program runs.
 *
 * In:  the way (places and kinds of moves), the planned time of the program, how long the axes need for a rapid move.
 * Out: for a time, the place on the way and its line.
 *
 * The way has no speeds: rapid moves take what their slowest axis needs, and the rest of the planned time is shared out along the other
 * moves by their length. The sum is right, a place within it is about right.
 */
import { type PathData, RAPID } from "./data";
import type { Place } from "./view";

/** Speed of a move that is not rapid, where nothing tells it. */
const FEED_MM_S = 20;

export class PathTimes {
  /** Planned time, s. */
  readonly total: number;
  /** When each vertex is reached, s. */
  private readonly at_s: Float32Array;

  /** `rapid_s`: how long a rapid move by so much in X, Y and Z takes. */
  constructor(
    private readonly data: PathData,
    planned_s: number,
    rapid_s: (x: number, y: number, z: number) => number,
  ) {
    const { count } = data;
    this.total = count > 1 ? planned_s : 0;
    this.at_s = new Float32Array(count);
    let [rapid, feed] = [0, 0];
    for (const [, took, length] of this.moves(rapid_s)) {
      rapid += took;
      feed += length;
    }
    // Where the plan is shorter than that, or has nothing but rapid moves, all of it is stretched alike.
    const fits = feed > 0 && rapid < planned_s;
    const stretched = planned_s / Math.max(1e-9, rapid + feed / FEED_MM_S);
    const per_rapid = fits ? 1 : stretched;
    const per_mm = fits ? (planned_s - rapid) / feed : stretched / FEED_MM_S;
    let now = 0;
    for (const [vertex, took, length] of this.moves(rapid_s)) {
      now += per_rapid * took + per_mm * length;
      this.at_s[vertex] = now;
    }
  }

  /** Each move: the vertex at its end, and what it counts as a rapid move, s, or else, mm. */
  private *moves(rapid_s: (x: number, y: number, z: number) => number): Generator<[number, number, number]> {
    let vertex = 0;
    for (const { count, xyz, kind } of this.data.chunks) {
      for (let i = 1; i < count; i++) {
        const [x, y, z] = [xyz[3 * i]! - xyz[3 * i - 3]!, xyz[3 * i + 1]! - xyz[3 * i - 2]!, xyz[3 * i + 2]! - xyz[3 * i - 1]!];
        yield kind[i] === RAPID ? [++vertex, rapid_s(x, y, z), 0] : [++vertex, 0, Math.hypot(x, y, z)];
      }
    }
  }

  /** Where the tool is at a time, and in which line. */
  at(time_s: number): { place: Place; line: number } {
    let [low, high] = [1, this.at_s.length - 1];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.at_s[middle]! < time_s) low = middle + 1;
      else high = middle;
    }
    const [from, to] = [this.at_s[low - 1]!, this.at_s[low]!];
    const share = to > from ? Math.min(1, Math.max(0, (time_s - from) / (to - from))) : 1;
    const [a, b] = [this.data.vertex(low - 1), this.data.vertex(low)];
    const mixed = (k: 0 | 1 | 2) => a[k] + share * (b[k] - a[k]);
    return { place: [mixed(0), mixed(1), mixed(2)], line: this.data.lineOf(low) };
  }
}
