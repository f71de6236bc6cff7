/** The folder of programs of the control, as docs/panel-api.md describes it. */
import { useEffect, useRef, useState } from "preact/hooks";
import { HttpRefused, refusal, request } from "./http";
import { t } from "./i18n";
import { useMachine } from "./machine";
import { authorised, useStore } from "./store";

export interface StoredFile {
  name: string;
  octets: number;
  modified_unix_s: number;
}

/** There is a file of that name. */
export const EXISTS = 412;

export const addressOf = (name: string): string => `files/${encodeURIComponent(name)}`;

export async function listFiles(): Promise<StoredFile[]> {
  return ((await (await request("files/")).json()) as { files: StoredFile[] }).files;
}

/** Uploads a file under its name; without `replace` refused with `EXISTS` where there is one of that name. */
export function putFile(file: File, replace: boolean, told: (share: number) => void, stop: AbortSignal): Promise<void> {
  return new Promise((resolve, reject) => {
    // fetch() does not say how far it is.
    const sending = new XMLHttpRequest();
    sending.open("PUT", addressOf(file.name));
    for (const [name, value] of Object.entries(authorised(replace ? {} : { "If-None-Match": "*" }))) sending.setRequestHeader(name, value);
    sending.upload.onprogress = ({ loaded, total }) => told(total ? loaded / total : 1);
    sending.onload = () => (sending.status < 300 ? resolve() : reject(refusal(sending.status, sending.responseText, sending.statusText)));
    sending.onerror = () => reject(new HttpRefused(0, t("file-no-answer")));
    sending.onabort = () => reject(new HttpRefused(0, t("upload-cancelled")));
    stop.addEventListener("abort", () => sending.abort());
    sending.send(file);
  });
}

export async function renameFile(name: string, next: string): Promise<void> {
  await request(addressOf(name), { method: "MOVE", headers: { Destination: encodeURIComponent(next) } });
}

export async function deleteFile(name: string): Promise<void> {
  await request(addressOf(name), { method: "DELETE" });
}

/** For a panel with a token, which a link cannot show. */
export async function downloadFile(name: string): Promise<void> {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(await (await request(addressOf(name))).blob());
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

export interface Folder {
  /** Null: the control has no folder of programs. */
  files: StoredFile[] | null;
  refresh: () => Promise<void>;
}

/** The folder, looked at again when the window gets the focus: files come in other ways, too. */
export function useFolder(): Folder {
  const has = useMachine()?.programs ?? false;
  const connected = useStore((s) => s.connected);
  const [files, setFiles] = useState<StoredFile[] | null>(null);
  const asked = useRef(0);
  const refresh = async () => {
    const mine = ++asked.current;
    const found = await listFiles().catch(() => null);
    // Of two answers the later question's is the newer one; without an answer what is known stays.
    if (mine === asked.current && found) setFiles(found);
  };
  useEffect(() => {
    if (!has || !connected) return;
    const look = () => void refresh();
    look();
    window.addEventListener("focus", look);
    return () => window.removeEventListener("focus", look);
  }, [has, connected]);
  return { files: has ? (files ?? []) : null, refresh };
}
