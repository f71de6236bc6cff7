/** What the control says, in words of the panel: a table of sentences by code for each language. */
import { type Key, type Language, fixed, language, t } from "./i18n";
import german from "./messages/control-de.json";
import english from "./messages/control-en.json";
import type { Message, Param } from "./types";

/** In English only those that name commands: the panel has buttons. */
const SENTENCES: Record<Language, Record<string, string>> = { de: german, en: english };

/** `{name}`: a value; `{name:.3}`: with so many digits behind the decimal sign; `{@name}`: what a button is called. */
const PLACE = /\{(@?)([\w-]+)(?::\.(\d+))?\}/g;

/** In the language of the operator; in the words of the control where the table has none. */
export function inWords({ code, params = {}, text }: Message): string {
  const sentence = SENTENCES[language][code];
  if (sentence !== undefined) {
    return sentence.replace(PLACE, (_, button, name, digits) => (button ? quoted(name as Key) : value(params[name], digits)));
  }
  // A sentence within it may have one here.
  return Object.values(params).reduce<string>((all, param) => (isMessage(param) ? all.replace(param.text, () => inWords(param)) : all), text);
}

function isMessage(param: Param): param is Message {
  return typeof param === "object";
}

function value(param: Param | undefined, digits?: string): string {
  if (param === undefined) return "";
  if (isMessage(param)) return inWords(param);
  return typeof param === "number" && digits !== undefined ? fixed(param, Number(digits)) : String(param);
}

function quoted(key: Key): string {
  return language === "de" ? `„${t(key)}“` : `“${t(key)}”`;
}
