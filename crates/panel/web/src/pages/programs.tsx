/** Programs: sent, looked at, started with settings; parts, and what was run. */
import { useEffect, useRef, useState } from "preact/hooks";
import { dateAndTime, duration, fixed, parseNumber, t, word } from "../i18n";
import { machine } from "../machine";
import { PathView } from "../path/path-view";
import { ProgramText } from "../program-text";
import { Sha256 } from "../sha256";
import { pickLine, pickedLine } from "../start";
import { type StartWith, ask, authorised, getStore, order, say, setStore, tellRefused, useStatus, useStore } from "../store";
import type { Entry, Report } from "../types";
import { Button, Card, Dialog, Field, Form } from "../ui";

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
  const outlook = await ask("program.load", { upload });
  say("note", t("loaded", { name: outlook.program, time: duration(outlook.planned_time_s) }) + (outlook.warning ? ` ${outlook.warning}` : ""));
}

const HEX = Array.from({ length: 256 }, (_, octet) => octet.toString(16).padStart(2, "0"));

function hex(octets: Uint8Array): string {
  let text = "";
  for (const octet of octets) text += HEX[octet];
  return text;
}

function Upload() {
  const input = useRef<HTMLInputElement>(null);
  const [share, setShare] = useState<number | null>(null);
  const [over, setOver] = useState(false);
  const take = async (files: FileList | null | undefined) => {
    const file = files?.[0];
    if (!file) return;
    setShare(0);
    await send(file, setShare).catch(tellRefused);
    setShare(null);
  };
  return (
    <div
      class={over ? "drop over" : "drop"}
      onDragOver={(event) => {
        event.preventDefault();
        setOver(true);
      }}
      onDragLeave={() => setOver(false)}
      onDrop={(event) => {
        event.preventDefault();
        setOver(false);
        void take(event.dataTransfer?.files);
      }}
    >
      <input
        ref={input}
        type="file"
        class="hidden"
        data-testid="upload"
        aria-label={t("upload")}
        tabIndex={-1}
        onChange={(event) => {
          void take(event.currentTarget.files);
          event.currentTarget.value = "";
        }}
      />
      <Button id="upload-button" kind="go tall" icon="upload" orders="program load" label={share === null ? t("upload") : `${Math.round(100 * share)} %`} onClick={() => input.current?.click()} />
      <p class="muted">{t("upload-drag")}</p>
    </div>
  );
}

interface StoredFile {
  name: string;
  octets: number;
  modified_unix_s: number;
}

/** Programs that the control keeps, where its panel has a folder for them. */
function Files() {
  const [files, setFiles] = useState<StoredFile[] | null>(null);
  const [takes, setTakes] = useState(machine.get()?.programs ?? false);
  useEffect(() => machine.subscribe(() => setTakes(machine.get()?.programs ?? false)), []);
  useEffect(() => {
    if (!takes) return;
    fetch("files/", { headers: authorised() })
      .then((answer) => (answer.ok ? answer.json() : { files: null }))
      .then(({ files }) => setFiles(files), () => setFiles(null));
  }, [takes]);
  if (!files?.length) return null;
  return (
    <ul class="files" aria-label={t("files")}>
      {files.map((file) => (
        <li key={file.name}>
          <Button kind="line" orders="program load" onClick={() => void order("program.load", { file: file.name })}>
            <b>{file.name}</b>
            <small>
              {fixed(file.octets / 1000, 1)} kB · {dateAndTime(file.modified_unix_s)}
            </small>
          </Button>
        </li>
      ))}
    </ul>
  );
}

function StartSettings() {
  const { repeat, dry } = useStore((s) => s.startWith);
  const line = useStore(pickedLine);
  const program = useStatus((s) => s.program !== null);
  const change = (values: Partial<StartWith>) => setStore({ startWith: { ...getStore().startWith, ...values } });
  if (!program) return null;
  return (
    <Card title={t("start-settings")}>
      <div class="row">
        <Field numeric id="repeat" label={t("repeat")} value={repeat} onInput={(repeat) => change({ repeat })} />
        <Field numeric id="dry-run-feed" label={t("dry-run-feed")} value={dry} onInput={(dry) => change({ dry })} />
        {line === null ? <p class="muted">{t("pick-line")}</p> : <Button id="from-line" icon="close" label={t("from-line", { line })} title={t("from-line-off")} onClick={() => pickLine(null)} />}
      </div>
    </Card>
  );
}

function Parts() {
  const parts = useStatus((s) => s.parts);
  const [target, setTarget] = useState("");
  if (!parts) return null;
  const wanted = parseNumber(target);
  return (
    <Card title={t("parts")}>
      <Form kind="row" onSend={() => void order("parts.set", { target: wanted })}>
        <p class="count">
          <b>{parts.count}</b>
          {parts.target ? ` ${t("of")} ${parts.target}` : ""}
        </p>
        <Button label={t("parts-zero")} orders="parts.set" onClick={() => void order("parts.set", { count: 0 })} />
        <Field numeric label={t("parts-target")} value={target} onInput={setTarget} />
        <Button label={t("set")} orders="parts.set" disabled={!Number.isInteger(wanted)} submit />
      </Form>
    </Card>
  );
}

function Reports() {
  const [runs, setRuns] = useState<Entry[]>([]);
  const [report, setReport] = useState<Report | null>(null);
  const last = useStatus((s) => JSON.stringify([s.activity, s.last_program]));
  useEffect(() => {
    void ask("journal.since", { seq: 0 }).then(({ entries }) => setRuns(entries.filter((entry) => entry.program?.result).slice(-12).reverse()), tellRefused);
  }, [last]);
  if (!runs.length) return null;
  return (
    <Card title={t("reports")}>
      <ul class="files">
        {runs.map((entry) => (
          <li key={entry.seq}>
            <button
              type="button"
              class="button line"
              disabled={entry.program!.report === null}
              onClick={() => void order("program.report", { number: entry.program!.report! }).then((answer) => answer && setReport(answer))}
            >
              <b>{entry.program!.name}</b>
              <small>
                {dateAndTime(entry.unix_s)} · {word("result", entry.program!.result ?? "")} · {duration(entry.program!.took_s ?? 0)}
              </small>
            </button>
          </li>
        ))}
      </ul>
      {report && (
        <Dialog title={report.program} onClose={() => setReport(null)}>
          <dl class="facts">
            {Object.entries(report)
              .filter(([, value]) => typeof value === "string" || typeof value === "number")
              .map(([name, value]) => (
                <div key={name}>
                  <dt>{name.replaceAll("_", " ")}</dt>
                  <dd>{typeof value === "number" ? String(Math.round(value * 1e4) / 1e4) : String(value)}</dd>
                </div>
              ))}
          </dl>
        </Dialog>
      )}
    </Card>
  );
}

export function Programs() {
  const program = useStatus((s) => s.program);
  const picked = useStore(pickedLine);
  return (
    <div class="page programs">
      <div class="column">
        <Card title={t("page-programs")}>
          <Upload />
          <Files />
        </Card>
        <Card kind="program" id="program" label={t("program")} title={program?.name ?? t("no-program")} tools={program && <span class="muted">{t(program.lines === 1 ? "line" : "lines", { n: program.lines })} · {duration(program.planned_time_s)}</span>}>
          <ProgramText onPick={pickLine} picked={picked ?? undefined} />
        </Card>
      </div>
      <div class="column">
        <Card kind="path-card">
          <PathView />
        </Card>
        <StartSettings />
        <Parts />
        <Reports />
      </div>
    </div>
  );
}
