/** Words of the page, in the language of whoever looks. What a control says, it says in English. */
import de from "./messages/de.json";
import en from "./messages/en.json";

export type Key = keyof typeof en;

const kept = localStorage.getItem("language");
export const language: "en" | "de" = kept === "en" || kept === "de" ? kept : navigator.language.startsWith("de") ? "de" : "en";
const messages: Record<Key, string> = { en, de }[language];

export function t(key: Key, values: Record<string, string | number> = {}): string {
  return messages[key].replace(/\{(\w+)\}/g, (_, name: string) => String(values[name] ?? ""));
}

/** 40 s, 12 min, 3:05 h. */
export function span(seconds: number): string {
  const s = Math.max(0, Math.round(seconds));
  if (s < 90) return `${s} s`;
  const minutes = Math.round(s / 60);
  if (minutes < 90) return `${minutes} min`;
  const hours = Math.floor(minutes / 60);
  return hours < 48 ? `${hours}:${String(minutes % 60).padStart(2, "0")} h` : `${Math.round(hours / 24)} d`;
}

/** The time of today, else the date with it. */
export function time(unix_s: number): string {
  const at = new Date(unix_s * 1000);
  const options = { hour12: false } as const;
  return at.toDateString() === new Date().toDateString() ? at.toLocaleTimeString(language, options) : at.toLocaleString(language, options);
}
