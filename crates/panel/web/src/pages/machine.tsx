/** The journal, the machine file, this PC, and what runs here. */
import { useEffect, useState } from "preact/hooks";
import { More, Remedy, about } from "../alarms";
import { inWords } from "../control-words";
import { useSmall } from "../hooks";
import { dateAndTime, fixed, t } from "../i18n";
import { machine } from "../machine";
import { ask, authorised, say, tellRefused, useStatus, useStore } from "../store";
import type { Entry, Param } from "../types";
import { Button, Card, Choice, Icon } from "../ui";
import { FileEditor } from "./machine-file";
import { OwnPages } from "./own";

type Kind = "all" | "change" | "alarm" | "warning";

function Journal() {
  const [entries, setEntries] = useState<Entry[]>([]);
  const [kind, setKind] = useState<Kind>("all");
  const last = useStatus((s) => JSON.stringify(s.messages.at(-1) ?? null)) ?? "";
  const connected = useStore((s) => s.connected);
  useEffect(() => {
    if (!connected) return;
    let wanted = true;
    const fetch = async (seq: number, known: Entry[]): Promise<void> => {
      const { entries, more, last } = await ask("journal.since", { seq });
      const all = [...known, ...entries].slice(-1000);
      if (more && wanted && last !== seq) return fetch(entries.at(-1)?.seq ?? last, all);
      if (wanted) setEntries(all.reverse());
    };
    fetch(0, []).catch(tellRefused);
    return () => void (wanted = false);
  }, [last, connected]);
  const shown = entries.filter((entry) => kind === "all" || (kind === "change" ? entry.params?.from !== undefined : entry.kind === kind)).slice(0, 300);
  return (
    <Card
      kind="journal"
      title={t("journal")}
      tools={
        <Choice
          label={t("journal")}
          value={kind}
          options={[
            { value: "all", label: t("all") },
            { value: "change", label: t("journal-changes"), id: "journal-changes" },
            { value: "alarm", label: t("alarm") },
            { value: "warning", label: t("warning") },
          ]}
          onChange={setKind}
        />
      }
    >
      <ul class="messages full" data-testid="journal" tabIndex={0} aria-label={t("journal")}>
        {shown.map((entry) => (
          <li key={entry.seq} class={entry.kind}>
            <time>{dateAndTime(entry.unix_s)}</time>
            <span>
              {entry.alarm && <code>{entry.alarm.code}</code>} <Said entry={entry} />
              {entry.by && <small data-testid="journal-by">{t("journal-by", { by: entry.by })}</small>}
              {entry.alarm && <small>{about(entry)}</small>}
              {entry.alarm && <Remedy entry={entry} />}
            </span>
            {entry.alarm && <More entry={entry} />}
          </li>
        ))}
      </ul>
    </Card>
  );
}

/** What an entry says; of a value that was changed what, from, to. */
function Said({ entry }: { entry: Entry }) {
  const { what, from, to = entry.params?.percent } = entry.params ?? {};
  if (from === undefined || to === undefined) return <>{inWords(entry)}</>;
  return (
    <span class="change" data-testid="journal-change">
      <span>{typeof what === "object" ? inWords(what) : inWords(entry)}</span>
      <span>{valueOf(from)}</span>
      <span aria-label={t("journal-to")}>→</span>
      <b>{valueOf(to)}</b>
    </span>
  );
}

function valueOf(param: Param): string {
  if (typeof param === "object") return inWords(param);
  // As many digits as it has.
  return typeof param === "number" ? fixed(param, Math.min(4, String(param).split(".")[1]?.length ?? 0)) : param || "–";
}

function Versions() {
  const s = useStatus((status) => ({ machine: status.machine, file: status.file, version: status.version, api: status.api, pid: status.pid }));
  const axes = machine.get()?.axes;
  if (!s) return null;
  const rows: [string, string][] = [
    [t("machine"), s.machine],
    [t("machine-file"), s.file],
    ["isocnc", s.version],
    ["API", s.api],
    [t("process"), String(s.pid)],
    ...(axes ?? []).map((axis): [string, string] => [
      axis.axis,
      [axis.travel && `${axis.travel[0]} … ${axis.travel[1]} ${axis.unit}`, axis.velocity_per_s && `${axis.velocity_per_s} ${axis.unit}/s`].filter(Boolean).join(", "),
    ]),
  ];
  return (
    <Card title={t("versions")}>
      <dl class="facts">
        {rows.map(([name, value]) => (
          <div key={name}>
            <dt>{name}</dt>
            <dd>{value}</dd>
          </div>
        ))}
      </dl>
      <p>
        <a href="licences.txt">{t("licences")}</a>
      </p>
    </Card>
  );
}

interface Doctor {
  about: string[];
  lines: { name: string; group: string; level: string; state: "ok" | "missing" | "unknown"; found: string; wanted: string; fix: string | null }[];
}

/** What of this PC stands in the way of real time. */
function DoctorCard() {
  const [report, setReport] = useState<Doctor | null>(null);
  const [looking, setLooking] = useState(false);
  const look = () => {
    setLooking(true);
    ask("machine.doctor")
      .then((answer) => setReport(answer as unknown as Doctor), tellRefused)
      .finally(() => setLooking(false));
  };
  const missing = report?.lines.filter(({ state }) => state === "missing") ?? [];
  const rest = report?.lines.filter(({ state }) => state !== "missing") ?? [];
  return (
    <Card title={t("doctor")} kind="doctor" tools={<Button id="doctor" label={looking ? t("checking") : t("doctor-look")} disabled={looking} onClick={look} />}>
      {!report && <p class="muted">{t("doctor-explained")}</p>}
      {report && (
        <div class="scroll" tabIndex={0} role="group" aria-label={t("doctor")} data-testid="doctor-lines" data-count={report.lines.length}>
          {report.about.map((line) => (
            <p key={line} class="muted">
              {line}
            </p>
          ))}
          <ul class="findings">
            {[...missing, ...rest].map((line) => (
              <li key={line.name} class={line.state}>
                <Icon name={line.state === "ok" ? "check" : "warning"} />
                <span>
                  <b>{line.name}</b> <small>{t(`doctor-${line.state}`)} · {line.level}</small>
                  <br />
                  {line.found} {line.state !== "ok" && <small>({line.wanted})</small>}
                  {line.fix && line.state !== "ok" && <code class="fix">{line.fix}</code>}
                </span>
              </li>
            ))}
          </ul>
        </div>
      )}
    </Card>
  );
}

/** The folder of the state and the machine file as one file. */
function BackupCard() {
  const may = useStore((s) => s.role === "set-up");
  const name = useStatus((s) => s.machine) ?? "isocnc";
  const save = async () => {
    const answer = await fetch("backup", { headers: authorised() });
    if (!answer.ok) return say("refused", ((await answer.json()) as { error: string }).error);
    const link = document.createElement("a");
    link.href = URL.createObjectURL(await answer.blob());
    link.download = `${name}-${new Date().toISOString().slice(0, 10)}.tar`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
    say("note", t("backup-done", { name: link.download }));
  };
  return (
    <Card title={t("backup")}>
      <p class="muted">{t("backup-explained")}</p>
      <Button id="backup" label={t("backup-save")} disabled={!may} onClick={() => void save().catch(tellRefused)} />
    </Card>
  );
}

type Part = "journal" | "file" | "pc" | "versions";

export function Machine() {
  const small = useSmall();
  const [part, setPart] = useState<Part>("journal");
  const parts: { value: Part; label: string; id: string }[] = [
    { value: "journal", label: t("journal"), id: "part-journal" },
    { value: "file", label: t("machine-file"), id: "part-file" },
    { value: "pc", label: t("doctor"), id: "part-pc" },
    ...(small ? [{ value: "versions" as const, label: t("versions"), id: "part-versions" }] : []),
  ];
  const about = (
    <>
      <Versions />
      <BackupCard />
    </>
  );
  return (
    <div class="page machine-page">
      <div class="column">
        <Choice label={t("page-machine")} value={part} options={parts} onChange={setPart} />
        <OwnPages />
        {part === "file" ? <FileEditor /> : part === "pc" ? <DoctorCard /> : part === "versions" ? about : <Journal />}
      </div>
      {!small && <div class="column">{about}</div>}
    </div>
  );
}
