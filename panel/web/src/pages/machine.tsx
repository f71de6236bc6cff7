/** The journal, and what runs here. */
import { useEffect, useState } from "preact/hooks";
import { dateAndTime, t } from "../i18n";
import { machine } from "../machine";
import { about } from "../shell";
import { ask, tellRefused, useStatus } from "../store";
import type { Entry } from "../types";
import { Card, Choice } from "../ui";

type Kind = "all" | "alarm" | "warning";

function Journal() {
  const [entries, setEntries] = useState<Entry[]>([]);
  const [kind, setKind] = useState<Kind>("all");
  const last = useStatus((s) => JSON.stringify(s.messages.at(-1) ?? null)) ?? "";
  useEffect(() => {
    let wanted = true;
    const fetch = async (seq: number, known: Entry[]): Promise<void> => {
      const { entries, more, last } = await ask<{ entries: Entry[]; more: boolean; last: number }>("journal.since", { seq });
      const all = [...known, ...entries].slice(-1000);
      if (more && wanted && last !== seq) return fetch(entries.at(-1)?.seq ?? last, all);
      if (wanted) setEntries(all.reverse());
    };
    fetch(0, []).catch(tellRefused);
    return () => void (wanted = false);
  }, [last]);
  const shown = entries.filter((entry) => kind === "all" || entry.kind === kind).slice(0, 300);
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
              {entry.alarm && <code>{entry.alarm.code}</code>} {entry.text}
              {entry.alarm && <small>{about(entry)}</small>}
            </span>
          </li>
        ))}
      </ul>
    </Card>
  );
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

export function Machine() {
  return (
    <div class="page machine-page">
      <div class="column">
        <Journal />
      </div>
      <div class="column">
        <Versions />
      </div>
    </div>
  );
}
