/** What the control says, for somebody who has buttons in place of commands. */
import { inGerman } from "./control-words";
import { type Key, language, t } from "./i18n";

/** Commands that the control names as a cure, and the buttons that give the same orders. */
const BUTTONS: Record<string, Key> = {
  on: "power-on",
  off: "power-off",
  home: "home-all",
  stop: "stop",
  hold: "hold",
  resume: "resume",
  skip: "skip",
  "estop reset": "reset",
  "alarm acknowledge": "acknowledge",
  "program start": "start",
  "program load FILE": "upload",
  "program run FILE": "upload",
  "tool-changed": "tool-changed",
};
const COMMANDS = new RegExp(`isocnc (${Object.keys(BUTTONS).join("|")})(?![\\w-])(?! [-0-9])`, "g");

/** How the control says that somebody else can be deprived of the control. */
const TAKE_OVER = '--take-over, control.take {"force": true}';

export function inWords(text: string): string {
  const said = text
    .replace(/^error: /, "")
    .replace(/: isocnc status tells how (the machine|it) is/, "")
    .replace(TAKE_OVER, quoted("control"));
  const own = language === "de" ? inGerman(said) : said;
  return own.replace(COMMANDS, (_, command: string) => quoted(BUTTONS[command]!));
}

function quoted(key: Key): string {
  return language === "de" ? `„${t(key)}“` : `“${t(key)}”`;
}
