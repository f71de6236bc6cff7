/** Units of pins: what a pin carries, else what its name says, as docs/pins.md describes it. */
import { machine } from "./machine";

const ENDS: Record<string, string> = { ns: "ns", us: "µs", ms: "ms", mm: "mm", rpm: "1/min", rps: "1/s", deg: "°", degrees: "°", hz: "Hz", percent: "%" };

const NAMES: [RegExp, string | ((which: string) => string)][] = [
  [/^joint\.(\d+)\.(?:f-error|motor-pos-cmd|motor-pos-fb)$/, (joint) => ofAxis(({ joints }) => joints.includes(Number(joint)))],
  [/^axis\.(\w)\.pos-cmd$/, (letter) => ofAxis(({ axis }) => axis.toLowerCase() === letter)],
  [/^motion\.current-vel$/, "mm/s"],
  [/^pid\.\d+\.error$/, "mm"],
  [/^spindle\.\d+\.speed-out(?:-abs)?$/, "1/min"],
  [/^spindle\.\d+\.(?:speed-in|speed-out-rps(?:-abs)?)$/, "1/s"],
  [/^spindle\.\d+\.orient-angle$/, "°"],
  [/^stepgen\.\d+\.frequency$/, "1/s"],
  [/^halui\.(?:axis\.jog-speed)$/, "mm/min"],
  [/^halui\.spindle\.\d+\.speed$/, "1/min"],
];

function ofAxis(is: (axis: { axis: string; joints: number[] }) => boolean): string {
  const unit = machine.get()?.axes.find(is)?.unit ?? "mm";
  return unit === "degrees" ? "°" : unit;
}

/** "" where nobody knows one. */
export function unitOf({ name, unit, type }: { name: string; unit: string | null; type: string }): string {
  if (unit) return unit;
  if (type === "bit") return "";
  for (const [pattern, known] of NAMES) {
    const found = pattern.exec(name);
    if (found) return typeof known === "string" ? known : known(found[1]!);
  }
  return ENDS[/-([a-z]+)$/.exec(name)?.[1] ?? ""] ?? "";
}
