/** The picture of the path without WebGL: a coarse one on an ordinary canvas. */
import { type PathData, RAPID, TOLERANCES_MM, levelFor } from "./data";
import { boxLines } from "./box";
import type { Frame, Picture } from "./picture";
import type { Place, View } from "./view";

/** Vertices that are drawn at a time: above it, a coarser level is taken. */
const VERTICES_MAX = 40_000;

export class FlatPicture implements Picture {
  private context: CanvasRenderingContext2D;

  constructor(private canvas: HTMLCanvasElement) {
    this.context = canvas.getContext("2d")!;
  }

  draw(view: View, data: PathData, frame: Frame): void {
    const { context: c } = this;
    const { colours, box, zeros, tool, preview } = frame;
    this.canvas.width = view.width * devicePixelRatio;
    this.canvas.height = view.height * devicePixelRatio;
    c.scale(devicePixelRatio, devicePixelRatio);
    c.fillStyle = colours.background;
    c.fillRect(0, 0, view.width, view.height);
    const line = (a: Place, b: Place, colour: string) => {
      c.strokeStyle = colour;
      c.beginPath();
      c.moveTo(...view.project(a));
      c.lineTo(...view.project(b));
      c.stroke();
    };
    if (box) {
      const { edges, grid } = boxLines(box);
      for (const [places, colour] of [[grid, colours.grid], [edges, colours.box]] as const) {
        for (let i = 0; i < places.length; i += 6) line(places.slice(i, i + 3) as unknown as Place, places.slice(i + 3, i + 6) as unknown as Place, colour);
      }
    }
    this.path(view, data, frame);
    for (const zero of zeros) {
      zero.axes.forEach((axis, k) => line(zero.place, zero.place.map((v, i) => v + axis[i]! * frame.unit) as unknown as Place, colours.axes[k]!));
    }
    for (const [place, colour] of [[tool, colours.tool], [preview, colours.preview]] as const) {
      if (!place) continue;
      const [x, y] = view.project(place);
      c.fillStyle = colour;
      c.beginPath();
      c.moveTo(x, y);
      c.lineTo(x - 9, y - 24);
      c.lineTo(x + 9, y - 24);
      c.fill();
    }
  }

  private path(view: View, data: PathData, { colours, span }: Frame): void {
    const { context: c } = this;
    let level = levelFor(view.pixels_per_mm);
    const size = (at: number) => data.chunks.reduce((sum, chunk) => sum + (at && chunk.levels ? chunk.levels[at - 1]!.length : chunk.count), 0);
    while (level + 1 < TOLERANCES_MM.length && size(level) > VERTICES_MAX) level++;
    for (const chunk of data.chunks) {
      const indices = level && chunk.levels ? chunk.levels[level - 1]! : null;
      const n = indices ? indices.length : chunk.count;
      let colour = "";
      for (let k = 1; k < n; k++) {
        const [a, b] = indices ? [indices[k - 1]!, indices[k]!] : [k - 1, k];
        const done = chunk.done[b]!;
        const share = Math.min(4, Math.max(0, (4 * (done - span[0])) / Math.max(1, span[1] - span[0])));
        const next = done ? colours.ramp[Math.round(share)]! : chunk.kind[b] === RAPID ? colours.rapid : colours.feed;
        const end = view.project([chunk.xyz[3 * b]!, chunk.xyz[3 * b + 1]!, chunk.xyz[3 * b + 2]!]);
        if (next !== colour) {
          if (colour) c.stroke();
          colour = c.strokeStyle = next;
          c.beginPath();
          c.moveTo(...view.project([chunk.xyz[3 * a]!, chunk.xyz[3 * a + 1]!, chunk.xyz[3 * a + 2]!]));
        }
        c.lineTo(...end);
      }
      if (colour) c.stroke();
    }
  }

  ready(): boolean {
    return true;
  }

  dispose(): void {}
}
