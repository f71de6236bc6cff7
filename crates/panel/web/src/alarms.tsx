/** Alarms: the first cause that still stands, its remedy, and what the docs say of it. */
import { useState } from "preact/hooks";
import { inWords } from "./control-words";
import { dateAndTime, t, timeOfDay, word } from "./i18n";
import { isEstop, reset } from "./orders";
import { fileName } from "./send";
import { getStore, useStatus } from "./store";
import type { Entry } from "./types";
import { Button, Dialog, Icon } from "./ui";

/** Rows of the table of docs/faults.md, by the codes that docs/alarms.md has for them: build.mjs puts them here. */
declare const FAULTS: Record<string, { what: string; remedy: string }>;

/** Stands above every page until someone acknowledges it. */
export function Alarm() {
  const alarm = useStatus((s) => s.alarm);
  const power = useStatus((s) => s.power);
  const entry = useStatus((s) => s.alarms[0]);
  const others = useStatus((s) => s.alarms.length - 1) ?? 0;
  const estop = isEstop(power);
  return (
    <div class={alarm || estop ? "alarm shown" : "alarm"} data-testid="alarm" role="alert" aria-live="assertive">
      {(alarm || estop) && (
        <>
          <Icon name="warning" />
          <div>
            <b>
              {entry?.alarm?.code && <code>{entry.alarm.code}</code>} {alarm ? inWords(alarm) : t("state-estop")}
            </b>
            {entry && <Remedy entry={entry} />}
            {entry?.alarm && (
              <small>
                {about(entry)}
                {others > 0 && ` · ${t("alarms-others", { n: others })}`}
              </small>
            )}
          </div>
          {entry?.alarm && <More entry={entry} />}
          <Button id="acknowledge" kind="warn" icon={estop ? "reset" : "check"} label={t(estop ? "reset" : "acknowledge")} orders="reset" onClick={() => getStore().status && void reset(getStore().status!)} />
        </>
      )}
    </div>
  );
}

/** What to do about it, in one sentence; nothing where this panel does not know the code. */
export function Remedy({ entry }: { entry: Entry }) {
  const remedy = remedyOf(entry.alarm?.code ?? "");
  return remedy ? (
    <span class="remedy" data-testid="remedy">
      {t("alarm-remedy")}: {remedy}
    </span>
  ) : null;
}

function remedyOf(code: string): string | null {
  const remedy = word("remedy", code);
  return remedy === code ? null : remedy;
}

/** A button, and behind it the row of the docs. */
export function More({ entry }: { entry: Entry }) {
  const [open, setOpen] = useState(false);
  const code = entry.alarm!.code;
  const row = FAULTS[code];
  return (
    <>
      <Button id={`more-${code}`} kind="small" label={t("alarm-more")} onClick={() => setOpen(!open)}>
        <span class="hidden">{code}</span>
      </Button>
      {open && (
        <Dialog id="alarm-dialogue" title={t("alarm-more-title", { code })} onClose={() => setOpen(false)}>
          <p class="strong">{inWords(entry)}</p>
          <p>{about(entry)}</p>
          <Remedy entry={entry} />
          {row && (
            <>
              <h3>{t("alarm-docs")}</h3>
              <p lang="en">{row.what}</p>
              <p lang="en">{row.remedy.split("`").map((part, i) => (i % 2 ? <code key={i}>{part}</code> : part))}</p>
            </>
          )}
        </Dialog>
      )}
    </>
  );
}

/** When, where, what the machine did about it, and who has acknowledged it. */
export function about(entry: Entry): string {
  const { alarm } = entry;
  if (!alarm) return "";
  const parts = [dateOrTime(entry.unix_s)];
  if (alarm.line !== null && alarm.program !== null) parts.push(t("alarm-at", { line: alarm.line, program: fileName(alarm.program) }));
  parts.push(t("alarm-reaction", { reaction: word("reaction", alarm.reaction) }));
  if (alarm.acknowledged) parts.push(t("acknowledged-by", { by: alarm.acknowledged.by, time: timeOfDay(alarm.acknowledged.unix_s) }));
  return parts.join(" · ");
}

function dateOrTime(unix_s: number): string {
  return Date.now() / 1000 - unix_s < 12 * 3600 ? timeOfDay(unix_s) : dateAndTime(unix_s);
}
