/** Fetches the way of the program that is loaded. */
import { ask, authorised, connection, getStore } from "../store";
import { PathData } from "./data";

const TOLERANCE_MM = 0.01;
/** A page that draws nothing for so long while it reads is no page, ms. */
const PAUSE_MS = 100;

/** Fills `data`, and tells of each part. What is wrong with the program, or null; null also where nobody wants it any more. */
export function loadPath(data: PathData, told: () => void, wanted: () => boolean): Promise<string | null> {
  // A panel's server streams it; on the control socket alone it comes in parts that are asked for.
  return getStore().methods.has("program.text") ? streamed(data, told, wanted) : inParts(data, told, wanted);
}

/** docs/panel-api.md: a line of JSON, blocks with their length, the last of them empty, a line of JSON. */
async function streamed(data: PathData, told: () => void, wanted: () => boolean): Promise<string | null> {
  const stop = new AbortController();
  const answer = await fetch(`path?tolerance_mm=${TOLERANCE_MM}`, { headers: authorised(), signal: stop.signal });
  if (!answer.ok || !answer.body) throw new Error(((await answer.json()) as { error?: string }).error ?? answer.statusText);
  const reader = answer.body.getReader();
  let octets = new Uint8Array(0);
  /** So many octets, or all up to the end of a line. */
  const read = async (enough: () => number): Promise<Uint8Array> => {
    for (let end = enough(); ; end = enough()) {
      if (end >= 0) {
        const part = octets.subarray(0, end);
        octets = octets.subarray(end);
        return part;
      }
      const { value, done } = await reader.read();
      if (done) throw new Error("the way ends in its middle");
      const both = new Uint8Array(octets.length + value.length);
      both.set(octets);
      both.set(value, octets.length);
      octets = both;
    }
  };
  const line = async () => JSON.parse(new TextDecoder().decode(await read(() => octets.indexOf(10) + 1 || -1)));
  const exactly = (n: number) => read(() => (octets.length >= n ? n : -1));
  const { axes, record_octets } = (await line()) as { axes: string[]; record_octets: number };
  const offsets = offsetsOf(axes);
  let shown = performance.now();
  for (;;) {
    const head = await exactly(4);
    const length = new DataView(head.buffer, head.byteOffset).getUint32(0, true);
    if (length === 0) break;
    take(data, await exactly(length), offsets, record_octets);
    if (!wanted()) {
      stop.abort();
      return null;
    }
    if (performance.now() - shown > PAUSE_MS) {
      told();
      await new Promise((wake) => setTimeout(wake));
      shown = performance.now();
    }
  }
  data.finish();
  told();
  return ((await line()) as { error: string | null }).error;
}

const offsetsOf = (axes: string[]) => ["X", "Y", "Z"].map((letter) => axes.indexOf(letter));

async function inParts(data: PathData, told: () => void, wanted: () => boolean): Promise<string | null> {
  const { path, axes, record_octets } = await ask("program.path.begin", {
    tolerance_mm: TOLERANCE_MM,
  });
  const offsets = offsetsOf(axes);
  for (;;) {
    const { base64, end, error } = await connection.call("program.path.next", { path });
    if (!wanted()) {
      if (!end) void connection.call("program.path.end").catch(() => {});
      return null;
    }
    take(data, Uint8Array.from(atob(base64), (octet) => octet.charCodeAt(0)), offsets, record_octets);
    if (end) data.finish();
    told();
    if (end) return error;
  }
}

function take(data: PathData, octets: Uint8Array, offsets: number[], record: number): void {
  const view = new DataView(octets.buffer, octets.byteOffset, octets.length);
  for (let at = 0; at + record <= octets.length; at += record) {
    const place = (k: number) => (offsets[k]! < 0 ? 0 : view.getFloat32(at + 5 + 4 * offsets[k]!, true));
    data.append(view.getUint32(at, true), view.getUint8(at + 4), place(0), place(1), place(2));
  }
}
