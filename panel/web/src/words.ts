/** What the control says, for somebody who has buttons in place of commands. */
import { type Key, t } from "./i18n";

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

export function inWords(text: string): string {
  return text
    .replace(/^error: /, "")
    .replace(/: isocnc status tells how (the machine|it) is/, "")
    .replace(COMMANDS, (_, command: string) => `“${t(BUTTONS[command]!)}”`);
}
