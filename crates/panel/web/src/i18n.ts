/** Words of the panel, in the language of the operator. What the control says in English: control-words.ts. */
import de from "./messages/de.json";
import en from "./messages/en.json";

export type Key = keyof typeof en;
export type Language = "en" | "de";

const MESSAGES: Record<Language, Record<Key, string>> = { en, de };

function chosen(): Language {
  const kept = localStorage.getItem("language");
  if (kept === "en" || kept === "de") return kept;
  return navigator.language.startsWith("de") ? "de" : "en";
}

export const language: Language = chosen();

export function t(key: Key, values: Record<string, string | number> = {}): string {
  return MESSAGES[language][key].replace(/\{(\w+)\}/g, (_, name: string) => String(values[name] ?? ""));
}

/** A code of the control that has a word here, else as it is. */
export function word(group: string, code: string): string {
  return (MESSAGES[language] as Record<string, string>)[`${group}-${code.replace(/_/g, "-")}`] ?? code;
}

/** Another language holds from the next page on. */
export function setLanguage(next: Language): void {
  localStorage.setItem("language", next);
  location.reload();
}

const numbers = new Map<number, Intl.NumberFormat>();

/** With so many digits behind the decimal sign of the language. */
export function fixed(value: number, digits: number): string {
  let format = numbers.get(digits);
  if (!format) {
    format = new Intl.NumberFormat(language, { minimumFractionDigits: digits, maximumFractionDigits: digits, useGrouping: false });
    numbers.set(digits, format);
  }
  // No "-0.000".
  return format.format(Math.abs(value) < 0.5 * 10 ** -digits ? 0 : value);
}

/** A number as it was typed, with a point or a comma; NaN if it is none. */
export function parseNumber(text: string): number {
  const trimmed = text.trim().replace(",", ".").replace("−", "-");
  return /^[-+]?(\d+\.?\d*|\.\d+)$/.test(trimmed) ? Number(trimmed) : NaN;
}

/** 1:02:03, or 2:03 below an hour. */
export function duration(seconds: number): string {
  const s = Math.max(0, Math.round(seconds));
  const two = (n: number) => String(n).padStart(2, "0");
  const [h, m] = [Math.floor(s / 3600), Math.floor(s / 60) % 60];
  return h > 0 ? `${h}:${two(m)}:${two(s % 60)}` : `${m}:${two(s % 60)}`;
}

export function timeOfDay(unix_s: number): string {
  return new Date(unix_s * 1000).toLocaleTimeString(language, { hour12: false });
}

export function dateAndTime(unix_s: number): string {
  return new Date(unix_s * 1000).toLocaleString(language, { hour12: false });
}
