/** The page from which programs are run. */
import { useState } from "preact/hooks";
import { about } from "../alarms";
import { inWords } from "../control-words";
import { duration, fixed, t, timeOfDay } from "../i18n";
import { PathView } from "../path/path-view";
import { ProgramText } from "../program-text";
import { refuses } from "../orders";
import { fileName } from "../send";
import { pickedLine } from "../start";
import { order, useStatus, useStore } from "../store";
import { LETTERS } from "../machine";
import type { Status } from "../types";
import { Button, Card, Choice, Icon } from "../ui";
import { useSmall } from "../hooks";
import { goTo } from "../route";
import { OwnCards, useOwn } from "./own";

type Shown = "work" | "machine" | "to-go";

/** Where the machine stands, in the work system. */
export function inWork(status: Status): number[] {
  const off = status.position_mm.map((value, i) => value - (status.work_offset_mm[i] ?? 0));
  const [s, c] = [Math.sin((-status.work_rotation_degrees * Math.PI) / 180), Math.cos((-status.work_rotation_degrees * Math.PI) / 180)];
  return [c * off[0]! - s * off[1]!, s * off[0]! + c * off[1]!, ...off.slice(2)];
}

/** Position of each axis as the operator wants it, by axis. */
function readings(status: Status, shown: Shown): { axis: string; unit: string; joints: number[]; value: number | null }[] {
  const machine = status.position_mm;
  let values: (number | null)[] = machine;
  if (shown === "work") values = inWork(status);
  else if (shown === "to-go") {
    values = status.to_go_mm ?? machine.map(() => null);
  }
  return status.axes.map((axis) => ({ ...axis, value: values[LETTERS.indexOf(axis.axis)] ?? null }));
}

export function Dro() {
  const [shown, setShown] = useState<Shown>("work");
  const has = useStatus((s) => s.to_go_mm !== undefined);
  const rows = useStatus((s) => readings(s, shown));
  const homed = useStatus((s) => s.homed) ?? [];
  const limits = useStatus((s) => [...s.limit_switches.lower, ...s.limit_switches.upper]) ?? [];
  const system = useStatus((s) => s.codes.find((code) => /^G5[4-9]/.test(code)) ?? null);
  const stale = useStore((s) => s.age >= 2000 || (!s.connected && s.status !== null));
  const options = (["work", "machine", ...(has ? ["to-go" as const] : [])] as Shown[]).map((value) => ({
    value,
    label: value === "work" && system ? system : t(value),
    id: `dro-${value}`,
  }));
  return (
    <Card kind={stale ? "dro stale" : "dro"} label={t("position")}>
      <Choice label={t("position")} value={shown} options={options} onChange={setShown} />
      <table>
        <tbody>
          {(rows ?? []).map((row) => {
            const all = row.joints.every((joint) => homed.includes(joint));
            const limit = row.joints.some((joint) => limits.includes(joint));
            return (
              <tr key={row.axis}>
                <th scope="row">{row.axis}</th>
                <td class="value" data-testid={`dro-${row.axis.toLowerCase()}`}>
                  {row.value === null ? "–" : fixed(row.value, 3)}
                </td>
                <td class="unit">{row.unit === "degrees" ? "°" : row.unit}</td>
                <td class={`mark ${limit ? "limit" : all ? "homed" : "unhomed"}`}>
                  <Icon name={limit ? "warning" : all ? "home" : "close"} />
                  <span>{t(limit ? "limit" : all ? "homed" : "not-homed")}</span>
                </td>
              </tr>
            );
          })}
        </tbody>
      </table>
    </Card>
  );
}

function Actual() {
  const speed = useStatus((s) => 60 * s.velocity_mm_s) ?? 0;
  const spindle = useStatus((s) => s.spindle);
  const tool = useStatus((s) => s.tool) ?? 0;
  const coolant = useStatus((s) => [s.coolant.flood && "M8", s.coolant.mist && "M7"].filter(Boolean).join(" "));
  return (
    <Card kind="actual">
      <dl>
        <div>
          <dt>{t("feed")}</dt>
          <dd data-testid="feed">
            <b>{fixed(speed, 0)}</b> mm/min
          </dd>
        </div>
        {spindle && (
          <div>
            <dt>{t("spindle")}</dt>
            <dd data-testid="spindle" class={spindle.on ? "on" : ""}>
              <b>{fixed(spindle.on ? spindle.speed_rpm : 0, 0)}</b> /min
            </dd>
          </div>
        )}
        <div>
          <dt>{t("tool")}</dt>
          <dd data-testid="tool">
            <b>{tool ? `T${tool}` : "–"}</b>
          </dd>
        </div>
        <div>
          <dt>{t("coolant")}</dt>
          <dd>
            <b>{coolant || "–"}</b>
          </dd>
        </div>
      </dl>
    </Card>
  );
}

const OVERRIDES = [
  { what: "feed", id: "feed-override", min: 0, max: 120 },
  { what: "rapid", id: "rapid-override", min: 0, max: 100 },
  { what: "spindle", id: "spindle-override", min: 50, max: 120 },
] as const;

function Overrides() {
  const spindle = useStatus((s) => s.spindle !== null);
  return (
    <Card kind="overrides" label={t("override")}>
      {OVERRIDES.filter(({ what }) => what !== "spindle" || spindle).map((one) => (
        <Override key={one.what} {...one} />
      ))}
    </Card>
  );
}

function Override({ what, id, min, max }: (typeof OVERRIDES)[number]) {
  const told = useStatus((s) => s.override[`${what}_percent`]) ?? 100;
  const acts = useStatus((s) => (what === "feed" ? s.override.feed_acts : what === "spindle" ? s.override.spindle_acts : true)) ?? true;
  const refused = useStore((s) => refuses(s, "override"));
  const [wanted, setWanted] = useState<number | null>(null);
  const shown = wanted ?? Math.round(told);
  const set = (value: number) => {
    const next = Math.min(max, Math.max(min, value));
    setWanted(next);
    send(what, next, () => setWanted(null));
  };
  return (
    <div class={acts ? "override" : "override off"}>
      <span class="what" id={`${id}-label`}>
        {t(what)}
      </span>
      <Button kind="small" icon="minus" orders="override" onClick={() => set(shown - 10)}>
        <span class="hidden">{`${t(what)}: ${t("less")}`}</span>
      </Button>
      <input
        type="range"
        data-testid={id}
        min={min}
        max={max}
        step={5}
        value={shown}
        aria-labelledby={`${id}-label`}
        aria-valuetext={`${shown} %`}
        disabled={refused}
        onInput={(event) => set(Number(event.currentTarget.value))}
      />
      <Button kind="small" icon="plus" orders="override" onClick={() => set(shown + 10)}>
        <span class="hidden">{`${t(what)}: ${t("more")}`}</span>
      </Button>
      <Button kind={shown === 100 ? "small percent" : "small percent changed"} id={`${id}-reset`} orders="override" onClick={() => set(100)} title={acts ? t("override-reset", { what: t(what) }) : t("override-off")}>
        {shown} %<span class="hidden">{t("override-reset", { what: t(what) })}</span>
      </Button>
    </div>
  );
}

/** One order is under way for each override at a time; of those that come meanwhile the last one counts. */
const pending = new Map<string, number | null>();

function send(what: string, value: number, done: () => void): void {
  if (pending.has(what)) {
    pending.set(what, value);
    return;
  }
  pending.set(what, null);
  void order("override", { [what]: value }).then(() => {
    const next = pending.get(what) ?? null;
    pending.delete(what);
    if (next !== null) send(what, next, done);
    // Until the control has told it, what was wanted stays.
    else setTimeout(done, 300);
  });
}

function Switches() {
  const back = useStatus((s) => s.direction === "reverse" && s.activity !== "idle") ?? false;
  const on = useStatus((s) => ({ single_block: s.single_block, optional_stop: s.optional_stop, block_delete: s.block_delete }));
  return (
    <Card kind="switches">
      {(["single-block", "optional-stop", "block-delete"] as const).map((name) => {
        const method = name.replace("-", "_") as "single_block" | "optional_stop" | "block_delete";
        return <Button key={name} id={name} kind="toggle" pressed={on?.[method] ?? false} label={t(name)} orders={method} onClick={() => void order(method, { on: !on?.[method] })} />;
      })}
      <Button id="reverse" kind="toggle" pressed={back} orders="reverse" label={t("reverse")} title={t("reverse-explained")} onClick={() => void order("reverse", { percent: 100 })} />
      <Button id="skip" kind="toggle" orders="skip" label={t("skip")} onClick={() => void order("skip")} />
    </Card>
  );
}

function Progress() {
  const s = useStatus((status) => ({
    elapsed: Math.floor(status.elapsed_s),
    remaining: status.remaining_s === null ? null : Math.ceil(status.remaining_s),
    note: status.remaining_note,
    done: status.done_percent,
    planned: status.program?.planned_time_s ?? null,
    running: status.activity !== "idle",
    parts: status.parts,
    left: status.runs_left,
  }));
  if (!s) return null;
  const done = Math.round(10 * (s.done ?? 0)) / 10;
  return (
    <div class="progress">
      <div class="track" role="progressbar" aria-label={t("program")} aria-valuenow={Math.round(done)} aria-valuemin={0} aria-valuemax={100}>
        <div style={{ width: `${done}%` }} />
      </div>
      <dl>
        <div>
          <dt>{t("elapsed")}</dt>
          <dd data-testid="elapsed">{duration(s.elapsed)}</dd>
        </div>
        <div>
          <dt>{t(s.running && s.remaining !== null ? "remaining" : "planned")}</dt>
          <dd data-testid="remaining" title={s.note ?? ""}>
            {s.running && s.remaining !== null ? `${s.note ? "~" : ""}${duration(s.remaining)}` : s.planned === null ? "–" : duration(s.planned)}
          </dd>
        </div>
        <div>
          <dt>{t("parts")}</dt>
          <dd data-testid="parts">
            {s.parts.count}
            {s.parts.target ? ` ${t("of")} ${s.parts.target}` : ""}
            {s.left > 0 ? ` (+${s.left})` : ""}
          </dd>
        </div>
      </dl>
    </div>
  );
}

function Codes() {
  const codes = useStatus((s) => s.codes) ?? [];
  return (
    <p class="codes" data-testid="codes" role="group" aria-label={t("codes")}>
      {codes.map((code) => (
        <code key={code}>{code}</code>
      ))}
    </p>
  );
}

function Program() {
  const program = useStatus((s) => s.program);
  const picked = useStore(pickedLine);
  return (
    <Card
      kind="program"
      id="program"
      label={t("program")}
      title={program ? fileName(program.name) : t("no-program")}
      tools={<Button kind="small" id="load" label={t("load-program")} onClick={() => goTo("programs")} />}
    >
      {program && (
        <p class="muted">
          {t(program.lines === 1 ? "line" : "lines", { n: program.lines })} {program.dry_run && <em class="tag">{t("dry-run")}</em>}
        </p>
      )}
      <ProgramText follow picked={picked ?? undefined} />
    </Card>
  );
}

function Messages() {
  const messages = useStatus((s) => s.messages.slice(-6).reverse()) ?? [];
  return (
    <Card kind="messages" title={t("alarms")} tools={<Button kind="small" label={t("journal")} onClick={() => goTo("machine")} />}>
      <ul>
        {messages.map((entry) => (
          <li key={entry.seq} class={entry.kind}>
            <time>{timeOfDay(entry.unix_s)}</time>
            <span title={about(entry)}>
              {entry.alarm && <code>{entry.alarm.code}</code>} {inWords(entry)}
            </span>
          </li>
        ))}
      </ul>
    </Card>
  );
}

type Part = "path" | "program" | "messages" | "own";

export function Operate() {
  const small = useSmall();
  const own = useOwn();
  const adds = own.buttons.length + own.values.length > 0;
  // On a small screen one of these at a time.
  const [part, setPart] = useState<Part>("path");
  return (
    <div class="page operate" data-part={part}>
      <div class="column">
        <Dro />
        {!small && <Actual />}
        <Overrides />
        {!small && <Switches />}
      </div>
      <div class="parts">
        <Choice
          label={t("program")}
          value={part}
          options={[
            { value: "path", label: t("path-short") },
            { value: "program", label: t("program") },
            { value: "messages", label: t("alarms-short") },
            ...(adds ? [{ value: "own" as const, label: t("own-short"), id: "part-own" }] : []),
          ]}
          onChange={setPart}
        />
      </div>
      <div class="middle">
        <Card kind="path-card">
          <PathView />
          <Progress />
          {small && <Actual />}
        </Card>
        {adds && !small && <OwnCards />}
      </div>
      {adds && small && part === "own" && <OwnCards />}
      <div class="column right">
        {small && <Switches />}
        <Program />
        <Codes />
        <Messages />
      </div>
    </div>
  );
}
