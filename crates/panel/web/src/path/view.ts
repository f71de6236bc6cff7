/** From where the path is looked at: along parallel rays, as on a drawing. */

export type Place = readonly [number, number, number];

export type Standpoint = "top" | "front" | "side" | "iso";

const DEGREE = Math.PI / 180;
/** How far the machine is turned about Z, and how far one looks down on it, degrees. */
const STANDPOINTS: Record<Standpoint, [number, number]> = {
  top: [0, 90],
  front: [0, 0],
  side: [90, 0],
  iso: [35, 32],
};

export class View {
  /** What is in the middle, machine coordinates, mm. */
  target: [number, number, number] = [0, 0, 0];
  yaw = STANDPOINTS.iso[0] * DEGREE;
  pitch = STANDPOINTS.iso[1] * DEGREE;
  pixels_per_mm = 2;
  width = 1;
  height = 1;

  /** Unit vectors: to the right of the picture, up in it, and out of it. */
  axes(): [Place, Place, Place] {
    const [sy, cy, sp, cp] = [Math.sin(this.yaw), Math.cos(this.yaw), Math.sin(this.pitch), Math.cos(this.pitch)];
    return [
      [cy, sy, 0],
      [-sy * sp, cy * sp, cp],
      [sy * cp, -cy * cp, sp],
    ];
  }

  /** Where a place is in the picture, px from its upper left corner. */
  project(place: Place): [number, number] {
    const [right, up] = this.axes();
    let [x, y] = [0, 0];
    for (let k = 0; k < 3; k++) {
      const d = place[k]! - this.target[k]!;
      x += d * right[k]!;
      y += d * up[k]!;
    }
    return [this.width / 2 + x * this.pixels_per_mm, this.height / 2 - y * this.pixels_per_mm];
  }

  stand(standpoint: Standpoint): void {
    const [yaw, pitch] = STANDPOINTS[standpoint];
    this.yaw = yaw * DEGREE;
    this.pitch = pitch * DEGREE;
  }

  /** All of a box is in the picture. */
  fit(min: Place, max: Place): void {
    if (!(min[0] <= max[0])) return;
    for (let k = 0; k < 3; k++) this.target[k] = (min[k]! + max[k]!) / 2;
    const [right, up] = this.axes();
    const half = (axis: Place) => axis.reduce((sum, a, k) => sum + (Math.abs(a) * (max[k]! - min[k]!)) / 2, 0);
    const margin = 0.88;
    this.pixels_per_mm = Math.min(
      (this.width * margin) / (2 * Math.max(0.5, half(right))),
      (this.height * margin) / (2 * Math.max(0.5, half(up))),
      500,
    );
  }

  turn(dx: number, dy: number): void {
    this.yaw -= dx * 0.01;
    this.pitch = Math.min(90 * DEGREE, Math.max(-90 * DEGREE, this.pitch + dy * 0.01));
  }

  pan(dx: number, dy: number): void {
    const [right, up] = this.axes();
    for (let k = 0; k < 3; k++) this.target[k]! -= (dx * right[k]! - dy * up[k]!) / this.pixels_per_mm;
  }

  /** What is at this pixel stays there. */
  zoom(factor: number, x: number, y: number): void {
    const next = Math.min(2000, Math.max(0.02, this.pixels_per_mm * factor));
    const [dx, dy] = [x - this.width / 2, y - this.height / 2];
    const share = 1 - this.pixels_per_mm / next;
    this.pan(-dx * share, -dy * share);
    this.pixels_per_mm = next;
  }
}
