/** German for what the control says, by its English sentences: docs/alarms.md and docs/states.md have them. */
import german from "./messages/control-de.json";

const escaped = (text: string) => text.replace(/[.*+?^${}()|[\]\\]/g, "\\$&");
/** A sentence with values in it: `{name}`; what is no name is no value. */
const VALUE = /\{\w+\}/;

interface Pattern {
  english: RegExp;
  names: string[];
  german: string;
}

const exact = new Map<string, string>();
const patterns: Pattern[] = [];
for (const [english, words] of Object.entries(german)) {
  if (!VALUE.test(english)) {
    exact.set(english, words);
    continue;
  }
  const names = [...english.matchAll(/\{(\w+)\}/g)].map(([, name]) => name!);
  const source = english.split(VALUE).map(escaped).join("(.+?)");
  patterns.push({ english: new RegExp(`^${source}$`), names, german: words });
}

// Of two that fit, the one that says more.
patterns.sort((a, b) => b.english.source.length - a.english.source.length);

function whole(text: string): string | null {
  const words = exact.get(text);
  if (words !== undefined) return words;
  for (const { english, names, german } of patterns) {
    const found = english.exec(text);
    // A value that has parts belongs to several sentences.
    if (found && !found.slice(1).some((value) => /[:;] /.test(value))) {
      return german.replace(/\{(\w+)\}/g, (_, name: string) => found[names.indexOf(name) + 1] ?? "");
    }
  }
  return null;
}

/** What the control says, in German as far as it is known: the whole, or what stands between its colons and semicolons. */
export function inGerman(text: string, unknown: (part: string) => void = () => {}): string {
  const words = whole(text);
  if (words !== null) return words;
  const signs = [...text.matchAll(/[:;] /g)];
  if (signs.length === 0) {
    unknown(text);
    return text;
  }
  // A sentence may have such signs itself.
  const { index } = signs.find(({ index }) => whole(text.slice(0, index)) !== null) ?? signs[0]!;
  const [before, behind] = [text.slice(0, index), text.slice(index + 2)];
  return inGerman(before, unknown) + text.slice(index, index + 2) + inGerman(behind, unknown);
}
