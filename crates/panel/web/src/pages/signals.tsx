/** Pins of the control: all of them, some that are watched, some over time; variables of programs in Structured Text. */
import type { ComponentChildren } from "preact";
import { useEffect, useRef, useState } from "preact/hooks";
import { inWords } from "../control-words";
import { useSmall } from "../hooks";
import { fixed, language, parseNumber, t } from "../i18n";
import { usePinValues } from "../pins";
import { COLOURS, type Cursors, Plot } from "../plot";
import type { Refused } from "../rpc";
import { Rows, Scope } from "../scope";
import { ask, connection, isBlind, order, tellRefused, useStore } from "../store";
import type { Channel, LogicTask, LogicVariable, Pin } from "../types";
import { Button, Card, Choice, Dialog, Field, Form, Icon } from "../ui";
import { unitOf } from "../units";

/** Signals at the same time. */
const WATCHED_MAX = 32;
const LOOK_MS = 500;

function shown({ value, type }: { value: Pin["value"]; type: string }): string {
  if (value === null) return "–";
  if (typeof value === "boolean") return value ? t("on") : t("off");
  return type === "float" ? fixed(value, 4) : String(value);
}

/** All pins, by name; asked for again when the control is another one. */
function usePins(): [Pin[], () => void] {
  const [pins, setPins] = useState<Pin[]>([]);
  const connected = useStore((s) => s.connected);
  const [asked, setAsked] = useState(0);
  useEffect(() => {
    let wanted = connected;
    const fetch = async (from: number, known: Pin[]): Promise<void> => {
      if (!wanted) return;
      const { pins, more } = await ask("hal.list", { from });
      const all = [...known, ...pins];
      if (more) return fetch(all.length, all);
      if (wanted) setPins(all);
    };
    fetch(0, []).catch(tellRefused);
    return () => void (wanted = false);
  }, [connected, asked]);
  return [pins, () => setAsked((n) => n + 1)];
}

/** A value for a pin that nothing drives. */
function SetPin({ pin, onClose }: { pin: Pin; onClose: () => void }) {
  const [text, setText] = useState(String(pin.value ?? ""));
  const number = parseNumber(text);
  const send = (value: boolean | number) => void order("hal.set", { pin: pin.name, value: String(value) }).then((done) => done && onClose());
  return (
    <Dialog id="pin-dialogue" title={pin.name} onClose={onClose}>
      <p class="muted">{t("pin-explained")}</p>
      {pin.type === "bit" ? (
        <div class="row">
          <Button id="pin-on" kind="warn" orders="hal.set" label={t("on")} onClick={() => send(true)} />
          <Button id="pin-off" kind="warn" orders="hal.set" label={t("off")} onClick={() => send(false)} />
        </div>
      ) : (
        <Form kind="row" onSend={() => send(number)}>
          <Field id="pin-value" label={[t("value"), unitOf(pin)].filter(Boolean).join(", ")} value={text} onInput={setText} numeric />
          <Button id="pin-set" kind="warn" label={t("set")} orders="hal.set" disabled={Number.isNaN(number)} submit />
        </Form>
      )}
    </Dialog>
  );
}

function PinRow({ pin, watched, onWatch }: { pin: Pin; watched: boolean; onWatch: () => void }) {
  return (
    <li>
      <button type="button" class="pin" aria-pressed={watched} data-testid={`pin-${pin.name}`} onClick={onWatch}>
        <span>{pin.name}</span>
        <small>
          {pin.type}
          {pin.net && pin.net !== pin.name ? ` · ${pin.net}` : ""}
        </small>
      </button>
    </li>
  );
}

/** Of "joint.0.f-error", "joint.0". */
const group = (name: string) => name.split(".").slice(0, -1).join(".") || name;

/** Pins of one part of the control; `found`: few enough to be shown all. What is shut is not drawn. */
function Group({ name, count, found, children }: { name: string; count: number; found: boolean; children: ComponentChildren }) {
  const [open, setOpen] = useState(false);
  return (
    <details open={found || open} onToggle={(event) => setOpen(event.currentTarget.open)}>
      <summary>
        {name} <small>{count}</small>
      </summary>
      {(found || open) && <ul>{children}</ul>}
    </details>
  );
}

function Tree({ pins, watched, onWatch }: { pins: Pin[]; watched: string[]; onWatch: (name: string) => void }) {
  const [search, setSearch] = useState("");
  const words = search.toLowerCase().split(/\s+/).filter(Boolean);
  const found = pins.filter((pin) => words.every((part) => `${pin.name} ${pin.net ?? ""}`.toLowerCase().includes(part)));
  const groups = new Map<string, Pin[]>();
  for (const pin of found) groups.set(group(pin.name), [...(groups.get(group(pin.name)) ?? []), pin]);
  const open = words.length > 0 && found.length <= 60;
  return (
    <Card title={t("pins")} kind="tree">
      <Field id="pin-search" label={t("search")} value={search} onInput={setSearch} />
      <div class="scroll" tabIndex={0} role="group" aria-label={t("pins")} data-testid="pins" data-count={found.length}>
        {[...groups].map(([name, members]) => (
          <Group key={name} name={name} count={members.length} found={open}>
            {members.map((pin) => (
              <PinRow key={pin.name} pin={pin} watched={watched.includes(pin.name)} onWatch={() => onWatch(pin.name)} />
            ))}
          </Group>
        ))}
      </div>
    </Card>
  );
}

function Watch({
  pins,
  names,
  shownOnScope,
  onScope,
  onRemove,
}: {
  pins: Pin[];
  names: string[];
  shownOnScope: string[];
  onScope: (name: string) => void;
  onRemove: (name: string) => void;
}) {
  const { values } = usePinValues(names, LOOK_MS);
  const [setting, setSetting] = useState<Pin | null>(null);
  const maySet = useStore((s) => s.methods.has("hal.set") && s.role === "set-up");
  if (names.length === 0) return <Card title={t("watch")}>{<p class="muted">{t("watch-explained")}</p>}</Card>;
  return (
    <Card title={t("watch")} kind="watch">
      <ul data-testid="watch" class="scroll" tabIndex={0} aria-label={t("watch")}>
        {names.map((name) => {
          const pin = values.get(name) ?? pins.find((one) => one.name === name);
          if (!pin) return null;
          const at = shownOnScope.indexOf(name);
          return (
            <li key={name} class="watched">
              <button type="button" class={at < 0 ? "signal" : `signal colour-${at % COLOURS}`} aria-pressed={at >= 0} aria-label={`${t("scope")}: ${name}`} onClick={() => onScope(name)} />
              <span class="name">{name}</span>
              <output data-testid={`value-${name}`}>
                {shown(pin)} {unitOf(pin)}
              </output>
              {maySet && pin.source === null && pin.net === null && pin.direction === "in" && <Button kind="plain" label={t("set")} onClick={() => setSetting(pin)} />}
              <button type="button" class="button plain" title={t("watch-end")} aria-label={`${t("watch-end")}: ${name}`} onClick={() => onRemove(name)}>
                <Icon name="close" />
              </button>
            </li>
          );
        })}
      </ul>
      {setting && <SetPin pin={setting} onClose={() => setSetting(null)} />}
    </Card>
  );
}

/** Between two pictures of the oscilloscope. */
const DRAW_MS = 100;
const SECONDS = [0.5, 2, 10, 60];

function useScope(pins: string[], running: boolean, wanted: { seconds: number; trigger: string; single: boolean }): Scope | null {
  const [scope, setScope] = useState<Scope | null>(null);
  const [, setDrawn] = useState(0);
  const connected = useStore((s) => s.connected);
  const has = useStore((s) => s.methods.has("scope.begin"));
  const key = JSON.stringify([pins, wanted]);
  useEffect(() => {
    if (!running || pins.length === 0 || !connected || !has) return;
    let timer = 0;
    const draw = () => {
      timer ||= window.setTimeout(() => {
        timer = 0;
        setDrawn((n) => n + 1);
      }, DRAW_MS);
    };
    const made = new Scope({ pins, ...wanted }, draw);
    setScope(made);
    return () => {
      made.stop();
      clearTimeout(timer);
    };
  }, [running, key, connected, has]);
  return scope;
}

/** Unit and scale of a trace; a bit is off or on, whatever the scale. */
function legend(channel: Channel, step: number | undefined): string {
  if (channel.type === "bit") return "0 / 1";
  const unit = unitOf(channel);
  if (!step) return unit;
  const [size, name] = unit === "ns" && step >= 1e6 ? [step / 1e6, "ms"] : unit === "ns" && step >= 1e3 ? [step / 1e3, "µs"] : [step, unit];
  return t("per-division", { step: `${size.toLocaleString(language, { maximumSignificantDigits: 2, useGrouping: false })} ${name}`.trim() });
}

/** The value of a channel at a time. */
function at(rows: Rows, channel: number, time: number | null): number | null {
  if (time === null || rows.time.length === 0) return null;
  let [low, high] = [0, rows.time.length - 1];
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (rows.time[middle]! <= time) low = middle;
    else high = middle - 1;
  }
  return rows.greatest[channel]![low]!;
}

function Oscilloscope({ pins }: { pins: string[] }) {
  const [running, setRunning] = useState(true);
  const [seconds, setSeconds] = useState(2);
  const [typed, setTyped] = useState("");
  const [trigger, setTrigger] = useState("");
  const [single, setSingle] = useState(false);
  const [own, setOwn] = useState(true);
  const [cursors, setCursors] = useState<Cursors>({ a: null, b: null });
  const [steps, setSteps] = useState<Record<string, number>>({});
  const next = useRef<"a" | "b">("a");
  const scope = useScope(pins, running, { seconds, trigger, single });
  const rows = scope?.rows ?? new Rows(0);
  const channels = scope?.channels ?? [];
  const save = () => {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([rows.csv(channels)], { type: "text/csv" }));
    link.download = "isocnc-scope.csv";
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
  };
  const state = scope?.error || (running ? t(`scope-${scope?.state ?? "waiting"}`) : t("scope-stopped"));
  return (
    <Card
      id="scope"
      title={t("scope")}
      kind="scope"
      tools={
        <Choice
          label={t("time")}
          value={seconds}
          options={SECONDS.map((value) => ({ value, label: `${value} s` }))}
          onChange={(value) => {
            setCursors({ a: null, b: null });
            setSeconds(value);
          }}
        />
      }
    >
      <Form kind="row" onSend={() => setTrigger(typed.trim())}>
        <Button id="scope-run" icon={running ? "hold" : "start"} pressed={running} label={running ? t("scope-stop") : t("scope-run")} onClick={() => setRunning(!running)} />
        <Field id="trigger" label={t("trigger")} value={typed} onInput={setTyped} />
        <Button id="trigger-set" label={t("set")} disabled={typed.trim() === trigger} submit />
        <Button pressed={single} label={t("scope-single")} disabled={!trigger} onClick={() => setSingle(!single)} />
        <Button pressed={own} label={t("scope-own")} onClick={() => setOwn(!own)} />
        <Button id="scope-csv" label="CSV" disabled={rows.time.length === 0} onClick={save} />
      </Form>
      {pins.length === 0 && <p class="muted">{t("scope-explained")}</p>}
      <p class="state-of-scope" data-testid="scope-state" data-rows={rows.time.length} data-lost={scope?.lost ?? 0} role="status">
        {state}
        {scope && scope.lost > 0 && ` · ${t("scope-lost", { n: scope.lost })}`}
      </p>
      {pins.length > 0 && (
        <Plot
          rows={rows}
          channels={channels}
          own={own}
          cursors={cursors}
          label={t("scope")}
          onSteps={setSteps}
          onCursor={(time) => {
            const which = next.current;
            next.current = which === "a" ? "b" : "a";
            setCursors((before) => ({ ...before, [which]: time }));
          }}
        />
      )}
      {channels.length > 0 && (
        <div class="scroll" tabIndex={0} role="group" aria-label={t("scope-figures")}>
          <table class="figures">
            <thead>
              <tr>
                <th>{t("signal")}</th>
                <th>{t("now")}</th>
                <th>{t("least")}</th>
                <th>{t("greatest")}</th>
                <th>A</th>
                <th>B</th>
                <th>B − A</th>
              </tr>
            </thead>
            <tbody>
              <tr>
                <td>t, s</td>
                <td colSpan={3} />
                <td>{cursors.a === null ? "" : fixed(cursors.a, 4)}</td>
                <td>{cursors.b === null ? "" : fixed(cursors.b, 4)}</td>
                <td>{cursors.a === null || cursors.b === null ? "" : fixed(cursors.b - cursors.a, 4)}</td>
              </tr>
              {channels.map((channel, place) => {
                const number = (value: number | null | undefined) => (value === null || value === undefined || !Number.isFinite(value) ? "" : fixed(value, channel.type === "bit" ? 0 : 4));
                const [a, b] = [at(rows, place, cursors.a), at(rows, place, cursors.b)];
                const [least, greatest] = [rows.least[place]!.reduce((x, y) => Math.min(x, y), Infinity), rows.greatest[place]!.reduce((x, y) => Math.max(x, y), -Infinity)];
                return (
                  <tr key={channel.name} data-testid={`figures-${channel.name}`} data-least={least} data-greatest={greatest}>
                    <td>
                      <i class={`signal colour-${place % COLOURS}`} /> {channel.name}
                      <small class="per-division">{legend(channel, steps[channel.name])}</small>
                    </td>
                    <td>{number(rows.greatest[place]!.at(-1))}</td>
                    <td>{number(least)}</td>
                    <td>{number(greatest)}</td>
                    <td>{number(a)}</td>
                    <td>{number(b)}</td>
                    <td>{a === null || b === null ? "" : number(b - a)}</td>
                  </tr>
                );
              })}
            </tbody>
          </table>
        </div>
      )}
    </Card>
  );
}

/** Variables that are asked for at once, and how many more with each wish for more. */
const VARIABLES = 500;

/** The variables that have these words in their name or pin, `most` at the most, and whether there are more. */
async function lookAt(program: string, search: string, most: number): Promise<{ variables: LogicVariable[]; more: boolean }> {
  const all: LogicVariable[] = [];
  for (;;) {
    const { variables, more } = await connection.call("logic.look", { program, search, from: all.length });
    all.push(...variables);
    if (!more || all.length >= most) return { variables: all, more };
  }
}

/** What forcing means, and a value for a variable; `now`: as it was behind the last scan. */
function Force({ program, now, onClose }: { program: string; now: LogicVariable; onClose: () => void }) {
  // Nothing until something is typed: a key that somebody is just pressing forces nothing.
  const [text, setText] = useState("");
  const [wrong, setWrong] = useState("");
  const force = async (value: string) => {
    if (isBlind()) return setWrong(t("not-sent"));
    try {
      await ask("logic.force", { program, variable: now.name, value });
      onClose();
    } catch (error) {
      const { code, said, message } = error as Refused;
      setWrong(code === 0 ? t("not-sent") : said ? inWords(said) : message);
    }
  };
  return (
    <Dialog id="force-dialogue" title={now.name} onClose={onClose}>
      <p class="strong">{t("force-explained")}</p>
      <p>{t("force-safety")}</p>
      <p class="muted" data-testid="force-now">
        {now.type}
        {now.pin && ` · ${now.pin}`} · {t("now")} {now.value} {now.forced && <strong>{t("forced")}</strong>}
      </p>
      {now.type === "BOOL" ? (
        <div class="row">
          {["TRUE", "FALSE"].map((value) => (
            <Button key={value} id={`force-${value}`} kind="warn" orders="logic.force" needs="set-up" label={t("force-to", { value })} onClick={() => void force(value)} />
          ))}
        </div>
      ) : (
        <Form kind="row" onSend={() => void force(text)}>
          <Field
            id="force-value"
            label={t("value")}
            value={text}
            onInput={(value) => {
              setText(value);
              setWrong("");
            }}
          />
          <Button id="force-set" kind="warn" label={t("force")} orders="logic.force" needs="set-up" disabled={text.trim() === ""} submit />
        </Form>
      )}
      {wrong && (
        <p class="error" role="alert" data-testid="force-wrong">
          {wrong}
        </p>
      )}
      {now.forced && (
        <footer>
          <Button
            id="force-release"
            label={t("release")}
            orders="logic.release"
            needs="set-up"
            onClick={() => void order("logic.release", { program, variable: now.name }).then((done) => done && onClose())}
          />
        </footer>
      )}
    </Dialog>
  );
}

/** Programs in Structured Text and their variables, as they were behind one scan. */
function Logic() {
  const [tasks, setTasks] = useState<LogicTask[]>([]);
  const [chosen, setChosen] = useState(0);
  const [{ variables, more }, setFound] = useState<{ variables: LogicVariable[]; more: boolean }>({ variables: [], more: false });
  const [search, setSearch] = useState("");
  const [most, setMost] = useState(VARIABLES);
  const [forcing, setForcing] = useState<LogicVariable | null>(null);
  const mayForce = useStore((s) => s.methods.has("logic.force") && s.role === "set-up");
  const task = tasks[chosen];
  useEffect(() => {
    let [wanted, asked] = [true, false];
    const look = async () => {
      // A slow answer is waited for.
      if (asked) return;
      asked = true;
      try {
        const { programs } = await connection.call("logic.list");
        const program = programs[chosen];
        const found = program && (await lookAt(program.name, search, most));
        if (!wanted) return;
        setTasks(programs);
        if (found) setFound(found);
      } catch {
        // Asked again soon; that there is no connection is told elsewhere.
      } finally {
        asked = false;
      }
    };
    void look();
    const timer = setInterval(() => void look(), LOOK_MS);
    return () => {
      wanted = false;
      clearInterval(timer);
    };
  }, [chosen, search, most]);
  if (!task) return <Card title={t("logic")}>{<p class="muted">{t("logic-none")}</p>}</Card>;
  const anew = () => setMost(VARIABLES);
  return (
    <Card
      id="logic"
      kind="logic"
      title={t("logic")}
      tools={
        tasks.length > 1 && (
          <Choice
            label={t("logic")}
            value={chosen}
            options={tasks.map(({ name }, value) => ({ value, label: name }))}
            onChange={(value) => {
              setChosen(value);
              setForcing(null);
              anew();
            }}
          />
        )
      }
    >
      <p class="muted">
        {task.file} · {task.period_ms} ms · {fixed(task.scan_us, 1)} µs ({t("late-max")} {fixed(task.scan_max_us, 1)} µs) · {task.overruns} {t("cycles-skipped")}
        {task.stands && <strong> · {t("logic-stands")}</strong>}
      </p>
      <Field
        id="logic-search"
        label={t("search")}
        value={search}
        onInput={(text) => {
          setSearch(text);
          anew();
        }}
      />
      <div class="scroll" tabIndex={0} role="group" aria-label={t("logic")} data-testid="variables" data-count={variables.length}>
        {variables.length === 0 && <p class="muted">{t("logic-nothing")}</p>}
        <table class="figures">
          <tbody>
            {variables.map((variable) => (
              <tr key={variable.name} data-testid={`variable-${variable.name}`}>
                <td>
                  {mayForce ? (
                    <button type="button" class="variable" title={t("force-tap")} onClick={() => setForcing(variable)}>
                      {variable.name} <small>{variable.type}</small>
                    </button>
                  ) : (
                    <>
                      {variable.name} <small>{variable.type}</small>
                    </>
                  )}
                </td>
                <td>
                  {variable.value} {variable.forced && <strong>{t("forced")}</strong>}
                </td>
                <td>
                  <small>{variable.pin}</small>
                </td>
              </tr>
            ))}
          </tbody>
        </table>
        {more && <Button id="logic-more" label={t("logic-more", { n: VARIABLES })} onClick={() => setMost(most + VARIABLES)} />}
      </div>
      {mayForce && <p class="muted">{t("force-tap")}</p>}
      {forcing && <Force key={forcing.name} program={task.name} now={variables.find(({ name }) => name === forcing.name) ?? forcing} onClose={() => setForcing(null)} />}
    </Card>
  );
}

type Part = "pins" | "scope" | "logic";

export function Signals() {
  const small = useSmall();
  const has = useStore((s) => ({ pins: s.methods.has("hal.list"), logic: s.methods.has("logic.list") }));
  const [pins] = usePins();
  const [part, setPart] = useState<Part>("pins");
  const kept = (name: string): string[] => JSON.parse(localStorage.getItem(name) ?? "[]") as string[];
  const [names, setNames] = useState(() => kept("watched"));
  const [onScope, setOnScope] = useState(() => kept("scoped"));
  useEffect(() => localStorage.setItem("watched", JSON.stringify(names)), [names]);
  useEffect(() => localStorage.setItem("scoped", JSON.stringify(onScope)), [onScope]);
  const turn = (list: string[], name: string) => (list.includes(name) ? list.filter((one) => one !== name) : [...list, name].slice(-WATCHED_MAX));
  // A pin that this machine does not have is not asked for.
  const there = new Set(pins.map((pin) => pin.name));
  const [watched, scoped] = [names, onScope].map((list) => list.filter((name) => there.has(name))) as [string[], string[]];
  const remove = (name: string) => {
    setNames(names.filter((one) => one !== name));
    setOnScope(onScope.filter((one) => one !== name));
  };
  const add = (name: string) => {
    if (names.includes(name)) return remove(name);
    setNames(turn(names, name));
    if (onScope.length < COLOURS) setOnScope(turn(onScope, name));
  };
  const parts = [
    { value: "pins", label: t("pins"), id: "part-pins" },
    ...(small ? [{ value: "scope", label: t("scope"), id: "part-scope" }] : []),
    ...(has.logic ? [{ value: "logic", label: t("logic"), id: "part-logic" }] : []),
  ] as { value: Part; label: string; id: string }[];
  const left = part === "logic" && has.logic;
  return (
    <div class="page signals">
      <div class="column">
        {parts.length > 1 && <Choice label={t("page-signals")} value={part} options={parts} onChange={setPart} />}
        {left ? (
          <Logic />
        ) : small && part === "scope" ? (
          <Oscilloscope pins={scoped} />
        ) : (
          <>
            <Watch pins={pins} names={watched} shownOnScope={scoped} onScope={(name) => setOnScope(turn(onScope, name))} onRemove={remove} />
            <Tree pins={pins} watched={watched} onWatch={add} />
          </>
        )}
      </div>
      {!small && (
        <div class="column">
          <Oscilloscope pins={scoped} />
        </div>
      )}
    </div>
  );
}
