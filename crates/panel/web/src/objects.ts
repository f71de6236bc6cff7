/** Objects of nodes: their names and numbers as people write them, their values as octets. The low octet comes first. */

export const TYPES = ["u8", "u16", "u32", "u64", "i8", "i16", "i32", "i64", "string", "bytes"] as const;
export type ObjectType = (typeof TYPES)[number];

export interface ObjectAddress {
  index: number;
  sub: number;
}

/** Objects by the names that the profiles DS 301 and CiA 402 have for them. */
const NAMED: [string, number, number, ObjectType][] = [
  ["device type", 0x1000, 0, "u32"],
  ["error register", 0x1001, 0, "u8"],
  ["device name", 0x1008, 0, "string"],
  ["hardware version", 0x1009, 0, "string"],
  ["software version", 0x100a, 0, "string"],
  ["vendor id", 0x1018, 1, "u32"],
  ["product code", 0x1018, 2, "u32"],
  ["revision number", 0x1018, 3, "u32"],
  ["serial number", 0x1018, 4, "u32"],
  ["error code", 0x603f, 0, "u16"],
  ["controlword", 0x6040, 0, "u16"],
  ["statusword", 0x6041, 0, "u16"],
  ["vl target velocity", 0x6042, 0, "i16"],
  ["vl velocity actual value", 0x6044, 0, "i16"],
  ["quick stop option code", 0x605a, 0, "i16"],
  ["modes of operation", 0x6060, 0, "i8"],
  ["modes of operation display", 0x6061, 0, "i8"],
  ["position demand value", 0x6062, 0, "i32"],
  ["position actual value", 0x6064, 0, "i32"],
  ["following error window", 0x6065, 0, "u32"],
  ["following error time out", 0x6066, 0, "u16"],
  ["position window", 0x6067, 0, "u32"],
  ["velocity actual value", 0x606c, 0, "i32"],
  ["target torque", 0x6071, 0, "i16"],
  ["max torque", 0x6072, 0, "u16"],
  ["torque actual value", 0x6077, 0, "i16"],
  ["current actual value", 0x6078, 0, "i16"],
  ["dc link circuit voltage", 0x6079, 0, "u32"],
  ["target position", 0x607a, 0, "i32"],
  ["home offset", 0x607c, 0, "i32"],
  ["software position limit, min", 0x607d, 1, "i32"],
  ["software position limit, max", 0x607d, 2, "i32"],
  ["profile velocity", 0x6081, 0, "u32"],
  ["profile acceleration", 0x6083, 0, "u32"],
  ["profile deceleration", 0x6084, 0, "u32"],
  ["quick stop deceleration", 0x6085, 0, "u32"],
  ["homing method", 0x6098, 0, "i8"],
  ["homing speed, switch", 0x6099, 1, "u32"],
  ["homing speed, zero", 0x6099, 2, "u32"],
  ["homing acceleration", 0x609a, 0, "u32"],
  ["touch probe function", 0x60b8, 0, "u16"],
  ["touch probe status", 0x60b9, 0, "u16"],
  ["following error actual value", 0x60f4, 0, "i32"],
  ["digital inputs", 0x60fd, 0, "u32"],
  ["digital outputs", 0x60fe, 1, "u32"],
  ["target velocity", 0x60ff, 0, "i32"],
  ["supported drive modes", 0x6502, 0, "u32"],
];

export const OBJECT_NAMES: readonly string[] = NAMED.map(([name]) => name);

/** As it is written: 0x6041:0. */
export const written = ({ index, sub }: ObjectAddress): string => `0x${index.toString(16).toUpperCase().padStart(4, "0")}:${sub}`;

const known = ({ index, sub }: ObjectAddress) => NAMED.find(([, i, s]) => i === index && s === sub);

export const nameOf = (object: ObjectAddress): string => known(object)?.[0] ?? "";

export const typeOf = (object: ObjectAddress): ObjectType | null => known(object)?.[3] ?? null;

/** Of a name, of 0x6041:0, 6041.0, 6041/0 or 6041h; null: it is none of them. The sub-index is decimal, or hexadecimal after 0x. */
export function addressOf(text: string): ObjectAddress | null {
  const wanted = text.trim().toLowerCase();
  const name = wanted.replace(/[\s_-]+/g, " ");
  const named = NAMED.find(([one]) => one === name);
  if (named) return { index: named[1], sub: named[2] };
  const found = /^(?:0x)?([0-9a-f]{4})h?(?:\s*[:./]\s*(0x[0-9a-f]{1,2}|\d{1,3}))?$/.exec(wanted);
  if (!found) return null;
  const object = { index: parseInt(found[1]!, 16), sub: Number(found[2] ?? 0) };
  return object.index > 0 && object.sub <= 255 ? object : null;
}

const octetsOf = (hex: string): number[] => hex.match(/../g)?.map((two) => parseInt(two, 16)) ?? [];

const bitsOf = (type: ObjectType): number => Number(/\d+/.exec(type)?.[0] ?? 0);

/** The least and the greatest value of an integer. */
export function rangeOf(type: ObjectType): [bigint, bigint] {
  const all = 1n << BigInt(bitsOf(type));
  return type.startsWith("i") ? [-all / 2n, all / 2n - 1n] : [0n, all - 1n];
}

/** A value as it goes over the bus, in hexadecimal digits; null: it is none of this type. */
export function encoded(text: string, type: ObjectType): string | null {
  const hex = (octets: Iterable<number>) => Array.from(octets, (octet) => octet.toString(16).padStart(2, "0")).join("");
  if (type === "string") return text === "" ? null : hex(new TextEncoder().encode(text));
  const trimmed = text.trim();
  if (type === "bytes") {
    const digits = trimmed.replace(/\s+/g, "").toLowerCase();
    return /^([0-9a-f]{2})+$/.test(digits) ? digits : null;
  }
  const found = /^([-+]?)(0x[0-9a-f]+|\d+)$/i.exec(trimmed.replace("−", "-"));
  if (!found) return null;
  const value = (found[1] === "-" ? -1n : 1n) * BigInt(found[2]!);
  const [least, greatest] = rangeOf(type);
  // A bit pattern of a signed object is often known by its hexadecimal digits.
  const pattern = found[2]!.toLowerCase().startsWith("0x") && found[1] === "" && value <= rangeOf(type.replace("i", "u") as ObjectType)[1];
  if ((value < least || value > greatest) && !pattern) return null;
  const bits = bitsOf(type);
  const unsigned = BigInt.asUintN(bits, value);
  return hex(Array.from({ length: bits / 8 }, (_, at) => Number((unsigned >> BigInt(8 * at)) & 0xffn)));
}

export interface Meaning {
  decimal: string;
  hex: string;
  /** Where all of it can be read. */
  text: string;
  /** As the octets came. */
  octets: string;
}

/** What an answer means: as a number of this type, or of its length where no type is known. */
export function meaningOf(value: string, type: ObjectType | null): Meaning {
  const octets = octetsOf(value);
  const meaning: Meaning = { decimal: "", hex: "", text: textOf(octets), octets: octets.map((octet) => octet.toString(16).padStart(2, "0").toUpperCase()).join(" ") };
  if (octets.length === 0 || octets.length > 8) return meaning;
  const bits = 8 * octets.length;
  const unsigned = octets.reduceRight((sum, octet) => sum * 256n + BigInt(octet), 0n);
  const signed = BigInt.asIntN(bits, unsigned);
  meaning.hex = `0x${unsigned.toString(16).toUpperCase().padStart(2 * octets.length, "0")}`;
  if (type === "string" || type === "bytes") return meaning;
  const both = type === null && signed !== unsigned;
  meaning.decimal = both ? `${unsigned} (${signed})` : String(type?.startsWith("i") ? signed : unsigned);
  return meaning;
}

function textOf(octets: number[]): string {
  // What ends a string of C, and what fills it, is no part of it.
  const end = octets.findIndex((_, at) => octets.slice(at).every((rest) => rest === 0));
  const seen = end < 0 ? octets : octets.slice(0, end);
  try {
    const text = new TextDecoder("utf-8", { fatal: true }).decode(Uint8Array.from(seen));
    return /^\P{C}+$/u.test(text) ? text : "";
  } catch {
    return "";
  }
}
