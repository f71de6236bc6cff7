/** What was typed into the page, what is wrong with it, and the answers that it makes. */
import { parseNumber, t } from "../i18n";
import type { Answers, Found, Offer } from "./contract";

export const LETTERS = "XYZABCUVW";

export interface Axis {
  letter: string;
  counts: string;
  units: string;
  /** Not typed yet: as usual for the letter. */
  lower?: string;
  upper?: string;
  speed: string;
}

export interface Typed {
  name: string;
  to_try: boolean;
  interface: string;
  by_hand: boolean;
  drives: string;
  io: string;
  /** As many as there are letters; those beyond the drives are not used. */
  axes: Axis[];
}

export interface Scan extends Found {
  interface: string;
}

export interface Nodes {
  drives: { id: number; name: string | null }[];
  io: number[];
}

export function fresh({ name, real_time, interfaces }: Offer): Typed {
  const wired = interfaces.filter((one) => !one.wireless);
  const best = wired.find((one) => one.up) ?? wired[0] ?? interfaces[0];
  const axes = [...LETTERS].map((letter) => ({ letter, counts: "10000", units: "1", speed: "1000" }));
  return { name, to_try: !real_time, interface: best?.name ?? "", by_hand: false, drives: "1, 2, 3", io: "", axes };
}

export const isRotary = (letter: string): boolean => "ABC".includes(letter);
export const lowerOf = ({ letter, lower }: Axis): string => lower ?? (letter === "Z" ? "-105" : "-5");
export const upperOf = ({ letter, upper }: Axis): string => upper ?? (letter === "Z" ? "5" : "205");

/** Node ids of POWERLINK; null: something else is typed. */
export function ids(text: string): number[] | null {
  const all = text.split(/[\s,;]+/).filter(Boolean).map(Number);
  return all.every((id) => Number.isInteger(id) && id >= 1 && id <= 239) ? all : null;
}

/** The nodes of the machine; null: not known yet. */
export function nodesOf(typed: Typed, scan: Scan | null): Nodes | null {
  if (typed.by_hand) {
    const [drives, io] = [ids(typed.drives), ids(typed.io)];
    return drives?.length && io ? { drives: drives.map((id) => ({ id, name: null })), io } : null;
  }
  if (scan?.interface !== typed.interface) return null;
  const drives = scan.nodes.filter((node) => node.is_drive);
  return drives.length ? { drives, io: scan.nodes.filter((node) => !node.is_drive).map(({ id }) => id) } : null;
}

export type Wrong = Partial<Record<keyof Axis, string>>;

/** What cannot be meant, for each axis. */
export function wrongIn(axes: Axis[]): Wrong[] {
  return axes.map((axis, at) => {
    const wrong: Wrong = {};
    const counts = parseNumber(axis.counts);
    const [lower, upper] = [parseNumber(lowerOf(axis)), parseNumber(upperOf(axis))];
    if (axes.findIndex(({ letter }) => letter === axis.letter) < at) wrong.letter = t("init-letter-twice", { letter: axis.letter });
    if (!(Number.isInteger(counts) && counts > 0)) wrong.counts = t("init-whole");
    if (!(parseNumber(axis.units) > 0)) wrong.units = t("init-above-zero");
    if (Number.isNaN(lower)) wrong.lower = t("no-number");
    if (Number.isNaN(upper)) wrong.upper = t("no-number");
    else if (upper <= lower) wrong.upper = t("init-upper-lower");
    if (!(parseNumber(axis.speed) > 0)) wrong.speed = t("init-above-zero");
    return wrong;
  });
}

/** Two whole numbers: a screw of 2.5 mm is 25 for ten times the increments. */
function scale({ counts, units }: Axis): string {
  const factor = 10 ** (units.trim().split(/[.,]/)[1] ?? "").length;
  return `${parseNumber(counts) * factor}/${Math.round(parseNumber(units) * factor)}`;
}

/** Null where something lacks or is wrong. */
export function answersOf(typed: Typed, nodes: Nodes | null, cycle_us: number): Answers | null {
  const name = typed.name.trim();
  if (!nodes || !name || !typed.interface.trim()) return null;
  const axes = typed.axes.slice(0, nodes.drives.length);
  if (wrongIn(axes).some((wrong) => Object.keys(wrong).length)) return null;
  return {
    name,
    interface: typed.interface.trim(),
    scan: !typed.by_hand,
    axes: axes.map(({ letter }) => letter).join(""),
    drives: nodes.drives.map(({ id }) => id),
    io: nodes.io,
    scales: axes.map(scale),
    travels: axes.map((axis) => `${parseNumber(lowerOf(axis))}:${parseNumber(upperOf(axis))}`),
    speeds: axes.map(({ speed }) => String(parseNumber(speed))),
    to_try: typed.to_try,
    cycle_us,
  };
}

// ------------------------------------------------------------------------------------------------ kept for this tab

/** What another language, which loads the page anew, is not to lose. */
export interface Kept {
  file: string;
  typed: Typed;
  scan: Scan | null;
  /** The answers of the file that was written, and where that is. */
  written: { answers: string; file: string } | null;
}

export function kept({ file }: Offer): Kept | null {
  try {
    const found = JSON.parse(sessionStorage.getItem("init") ?? "null") as Kept | null;
    return found?.file === file ? found : null;
  } catch {
    return null;
  }
}

export const keep = (all: Kept): void => sessionStorage.setItem("init", JSON.stringify(all));
