/** Programs: sent, looked at, started with settings; parts, and what was run. */
import { useEffect, useState } from "preact/hooks";
import { useFolder } from "../files";
import { dateAndTime, duration, parseNumber, t, word } from "../i18n";
import { PathView } from "../path/path-view";
import { ProgramText } from "../program-text";
import { fileName } from "../send";
import { pickLine, pickedLine } from "../start";
import { type StartWith, ask, getStore, order, setStore, tellRefused, useStatus, useStore } from "../store";
import type { Entry, Report } from "../types";
import { Button, Card, Dialog, Field, Form } from "../ui";
import { FileList, Upload } from "./program-files";

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
              <b>{fileName(entry.program!.name)}</b>
              <small>
                {dateAndTime(entry.unix_s)} · {word("result", entry.program!.result ?? "")} · {duration(entry.program!.took_s ?? 0)}
              </small>
            </button>
          </li>
        ))}
      </ul>
      {report && (
        <Dialog title={fileName(report.program)} onClose={() => setReport(null)}>
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
  const folder = useFolder();
  const program = useStatus((s) => s.program);
  const picked = useStore(pickedLine);
  return (
    <div class="page programs">
      <div class="column">
        <Card title={t("page-programs")}>
          <Upload folder={folder} />
          {folder.files && folder.files.length > 0 && <FileList files={folder.files} refresh={folder.refresh} />}
        </Card>
        <Card kind="program" id="program" label={t("program")} title={program ? fileName(program.name) : t("no-program")} tools={program && <span class="muted">{t(program.lines === 1 ? "line" : "lines", { n: program.lines })} · {duration(program.planned_time_s)}</span>}>
          <ProgramText onPick={pickLine} picked={picked ?? undefined} />
        </Card>
      </div>
      <div class="column">
        <Card kind="path-card">
          <PathView previews />
        </Card>
        <StartSettings />
        <Parts />
        <Reports />
      </div>
    </div>
  );
}
