/** Fetches the way of the program that is loaded. */
import { ask, connection } from "../store";
import { PathData } from "./data";

/** Fills `data`, and tells of each part; false: it was given up. */
export async function loadPath(data: PathData, told: () => void, wanted: () => boolean): Promise<string | null> {
  const { path, axes, record_octets } = await ask<{ path: number; axes: string[]; record_octets: number }>("program.path.begin", {
    tolerance_mm: 0.01,
  });
  const offsets = ["X", "Y", "Z"].map((letter) => axes.indexOf(letter));
  const next = () => connection.call<{ base64: string; end: boolean; error: string | null }>("program.path.next", { path });
  for (;;) {
    const { base64, end, error } = await next();
    if (!wanted()) {
      if (!end) void connection.call("program.path.end").catch(() => {});
      return null;
    }
    take(data, base64, offsets, record_octets);
    if (end) data.finish();
    told();
    if (end) return error;
  }
}

function take(data: PathData, base64: string, offsets: number[], record: number): void {
  const text = atob(base64);
  const octets = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) octets[i] = text.charCodeAt(i);
  const view = new DataView(octets.buffer);
  for (let at = 0; at + record <= octets.length; at += record) {
    const place = (k: number) => (offsets[k]! < 0 ? 0 : view.getFloat32(at + 5 + 4 * offsets[k]!, true));
    data.append(view.getUint32(at, true), view.getUint8(at + 4), place(0), place(1), place(2));
  }
}
