/** Uploads of programs that the control does not keep: for a panel without a folder of programs, and for what the panel itself has written. */
import { duration, t } from "./i18n";
import { Sha256 } from "./sha256";
import { ask, say } from "./store";
import type { Outlook } from "./types";

/** Sends a program in parts, and has it checked. What is too large is refused before it is read. */
export async function send(file: File, told: (share: number) => void): Promise<void> {
  const { upload, part_octets } = await ask("program.upload.begin", { name: file.name, octets: file.size });
  const sha = new Sha256();
  for (let at = 0; at < file.size; at += part_octets) {
    const part = new Uint8Array(await file.slice(at, at + part_octets).arrayBuffer());
    sha.add(part);
    await ask("program.upload.append", { upload, at, value: hex(part) });
    told((at + part.length) / file.size);
  }
  await ask("program.upload.commit", { upload, sha256: hex(sha.sum()) });
  tellLoaded(await ask("program.load", { upload }));
}

/** Of a path, what a person calls it by. */
export const fileName = (path: string): string => path.split("/").at(-1)!;

export function tellLoaded({ program, planned_time_s, warning }: Outlook): void {
  say("note", t("loaded", { name: fileName(program), time: duration(planned_time_s) }) + (warning ? ` ${warning}` : ""));
}

const HEX = Array.from({ length: 256 }, (_, octet) => octet.toString(16).padStart(2, "0"));

function hex(octets: Uint8Array): string {
  let text = "";
  for (const octet of octets) text += HEX[octet];
  return text;
}
