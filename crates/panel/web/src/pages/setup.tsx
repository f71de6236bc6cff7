/** Jogging, MDI, zero points, tools, probing, spindle and coolant by hand. */
import { useEffect, useState } from "preact/hooks";
import { type Key, fixed, parseNumber, t } from "../i18n";
import { isHeld, press, release, step } from "../jog";
import { SPEEDS_MM_MIN, STEPS_MM, jogSettings } from "../jog-settings";
import { refuses } from "../orders";
import { useSmall } from "../hooks";
import { ask, order, tellRefused, useStatus, useStore } from "../store";
import { Button, Card, Choice, Dialog, Field, Form } from "../ui";
import { Offsets, TouchOff, workOf } from "./offsets";
import { Dro } from "./operate";
import { Tools } from "./tools";

// ------------------------------------------------------------------------------------------------ jog

/** Directions of a button, and where it is in the cross. */
const CROSS: [string, [string, 1 | -1][]][] = [
  ["↖", [["X", -1], ["Y", 1]]],
  ["Y+", [["Y", 1]]],
  ["↗", [["X", 1], ["Y", 1]]],
  ["Z+", [["Z", 1]]],
  ["X−", [["X", -1]]],
  ["", []],
  ["X+", [["X", 1]]],
  ["", []],
  ["↙", [["X", -1], ["Y", -1]]],
  ["Y−", [["Y", -1]]],
  ["↘", [["X", 1], ["Y", -1]]],
  ["Z−", [["Z", -1]]],
];

function JogButton({ label, moves, fast }: { label: string; moves: [string, 1 | -1][]; fast?: boolean }) {
  const axes = useStatus((s) => s.axes.map((axis) => axis.axis)) ?? [];
  const dim = useStore((s) => refuses(s, "jog"));
  if (!moves.length || !moves.every(([axis]) => axes.includes(axis))) return <span aria-hidden="true" />;
  const name = moves.map(([axis, sign]) => `${axis.toLowerCase()}-${sign > 0 ? "plus" : "minus"}`).join("-");
  const begin = () => {
    const speeds = moves.map(([axis, sign]) => ({ what: jogSettings.what(axis), velocity_mm_s: sign * jogSettings.speed(axis, fast ?? false) }));
    if (jogSettings.step_mm === 0) press(speeds);
    else for (const { what, velocity_mm_s } of speeds) step(what, Math.sign(velocity_mm_s) * jogSettings.step_mm, Math.abs(velocity_mm_s));
  };
  const end = () => release();
  return (
    <button
      type="button"
      class={`button jog${dim ? " dim" : ""}`}
      data-testid={`jog-${name}`}
      aria-label={`${t("jog")} ${moves.map(([axis, sign]) => `${axis}${sign > 0 ? "+" : "−"}`).join(" ")}`}
      onPointerDown={(event) => {
        if (event.button !== 0) return;
        event.currentTarget.setPointerCapture(event.pointerId);
        begin();
      }}
      onPointerMove={(event) => {
        // A hand that slides off the button has left it; it comes back by a new press.
        if (isHeld() && !isOver(event)) end();
      }}
      onPointerUp={end}
      onPointerCancel={end}
      onLostPointerCapture={end}
      onContextMenu={(event) => event.preventDefault()}
      onBlur={end}
      onKeyDown={(event) => {
        if (event.key !== " " && event.key !== "Enter") return;
        event.preventDefault();
        event.stopPropagation();
        if (!event.repeat) begin();
      }}
      onKeyUp={end}
    >
      {label}
    </button>
  );
}

/** Whether the pointer is over the element that hears of it, which has it captured. */
function isOver({ currentTarget, clientX, clientY }: { currentTarget: HTMLElement; clientX: number; clientY: number }): boolean {
  const { left, right, top, bottom } = currentTarget.getBoundingClientRect();
  return clientX >= left && clientX <= right && clientY >= top && clientY <= bottom;
}

function Jog() {
  const [, setChanged] = useState(0);
  const small = useSmall();
  const rest = useStatus((s) => s.axes.filter((axis) => !"XYZ".includes(axis.axis)).map((axis) => axis.axis)) ?? [];
  const place = useStatus((s) => s.axes.map((axis) => `${axis.axis} ${fixed(workOf(s, axis.axis), 3)}`).join("   "));
  // As it is being typed; null: the speed itself.
  const [typed, setTyped] = useState<string | null>(null);
  const axes = useStatus((s) => s.axes) ?? [];
  const slow = axes.filter(({ axis }) => jogSettings.most(axis) * 60 < jogSettings.mm_min);
  const wrong = typed !== null && !(parseNumber(typed) > 0);
  const slower = wrong
    ? t("no-number")
    : slow.map(({ axis, unit }) => t("jog-most", { axis, speed: fixed(60 * jogSettings.most(axis), 0), unit: unit === "degrees" ? "°" : unit })).join(", ");
  const change = (values: Partial<typeof jogSettings>) => {
    release();
    Object.assign(jogSettings, values);
    setChanged((n) => n + 1);
  };
  return (
    <Card kind="jog-card" label={t("jog")}>
      {small && <p class="place">{place}</p>}
      <div class="cross">
        {CROSS.map(([label, moves], i) => (
          <JogButton key={i} label={label} moves={moves} />
        ))}
      </div>
      {rest.map((axis) => (
        <div class="rotary" key={axis}>
          <JogButton label={`${axis}−`} moves={[[axis, -1]]} />
          <JogButton label={`${axis}+`} moves={[[axis, 1]]} />
        </div>
      ))}
      <Choice
        label={t("step")}
        value={jogSettings.step_mm}
        options={STEPS_MM.map((value) => ({ value, label: value ? String(value) : t("hold-to-move"), id: `step-${value}` }))}
        onChange={(step_mm) => change({ step_mm })}
      />
      <div class="jog-speed">
        <Field
          numeric
          id="jog-speed"
          label={t("jog-speed")}
          value={typed ?? String(jogSettings.mm_min)}
          onInput={(text) => {
            const mm_min = parseNumber(text);
            setTyped(text);
            if (mm_min > 0) change({ mm_min });
          }}
        />
        <Choice
          label={t("jog-speed")}
          value={jogSettings.mm_min}
          options={SPEEDS_MM_MIN.map((value) => ({ value, label: String(value), id: `jog-speed-${value}` }))}
          onChange={(mm_min) => {
            setTyped(null);
            change({ mm_min });
          }}
        />
      </div>
      {slower && <p class="muted" data-testid="jog-slower">{slower}</p>}
    </Card>
  );
}

// ------------------------------------------------------------------------------------------------ parts

function Home() {
  const joints = useStatus((s) => s.axes.flatMap((axis) => axis.joints.map((joint) => ({ joint, axis: axis.axis, homed: s.homed.includes(joint) })))) ?? [];
  // Joints that are homed, and are to be homed again; none: all.
  const [again, setAgain] = useState<number[] | null>(null);
  const home = (wanted: number[], homed: boolean) => (homed ? setAgain(wanted) : void order("home", wanted.length ? { joints: wanted } : {}));
  return (
    <Card title={t("homing")}>
      <div class="row">
        <Button id="home-all" kind="go tall" icon="home" orders="home" label={t("home-all")} onClick={() => home([], joints.every(({ homed }) => homed))} />
        {joints.map(({ joint, axis, homed }) => (
          <Button key={joint} id={`home-${joint}`} icon={homed ? "check" : "home"} orders="home" label={`${axis} (${joint})`} onClick={() => home([joint], homed)} />
        ))}
      </div>
      {again && (
        <Dialog id="home-dialogue" title={t("home-again")} onClose={() => setAgain(null)}>
          <p>{again.length ? t("home-again-one", { axis: joints.find(({ joint }) => joint === again[0])?.axis ?? "" }) : t("home-again-all")}</p>
          <footer>
            <Button
              id="home-yes"
              kind="go tall"
              icon="home"
              orders="home"
              label={t("home-again")}
              onClick={() => {
                setAgain(null);
                home(again, false);
              }}
            />
          </footer>
        </Dialog>
      )}
    </Card>
  );
}

function Mdi() {
  const [line, setLine] = useState("");
  const [history, setHistory] = useState<string[]>([]);
  const waiting = useStatus((s) => s.mdi) ?? [];
  const codes = useStatus((s) => s.codes) ?? [];
  const fetch = () => ask("mdi.history").then(({ lines }) => setHistory(lines.slice(-30).reverse()), tellRefused);
  useEffect(() => void fetch(), []);
  const send = async () => {
    if (!line.trim()) return;
    if ((await order("mdi", { line })) === undefined) return;
    setLine("");
    void fetch();
  };
  return (
    <Card title="MDI" kind="mdi">
      <Form kind="row wide" onSend={() => void send()}>
        <Field id="mdi" label={t("mdi-line")} value={line} onInput={setLine} />
        <Button id="mdi-send" kind="go" icon="start" orders="mdi" label={t("run")} submit />
      </Form>
      {waiting.length > 0 && (
        <p class="muted">
          {t("queue")}: {waiting.join(" · ")}
        </p>
      )}
      <p class="codes">
        {codes.map((code) => (
          <code key={code}>{code}</code>
        ))}
      </p>
      <ul class="history" aria-label={t("history")}>
        {history.map((one, i) => (
          <li key={i}>
            <button type="button" class="button small line" onClick={() => setLine(one)}>
              <code>{one}</code>
            </button>
          </li>
        ))}
      </ul>
    </Card>
  );
}

/** Cycles of docs/probing.md and their arguments; `set` is the last of those that can set something. */
const CYCLES: [string, string[]][] = [
  ["surface", ["down", "set"]],
  ["edge", ["x", "y", "set"]],
  ["corner-outside", ["x", "y", "set"]],
  ["corner-inside", ["x", "y", "set"]],
  ["bore", ["diameter", "set"]],
  ["boss", ["diameter", "depth", "set"]],
  ["pocket", ["x", "y", "set"]],
  ["block", ["x", "y", "depth", "set"]],
  ["angle", ["x", "y", "along", "set"]],
  ["calibrate", ["width", "set"]],
  ["tool-length", ["set"]],
  ["tool-check", ["most"]],
];

function Probing() {
  const [cycle, setCycle] = useState<string | null>(null);
  const chosen = CYCLES.find(([name]) => name === cycle);
  return (
    <Card title={t("probing")}>
      <ul class="cycles">
        {CYCLES.map(([name]) => (
          <li key={name}>
            <button type="button" class="button cycle" data-testid={`probe-${name}`} onClick={() => setCycle(name)}>
              <img src={`probe-${name}.svg`} alt="" loading="lazy" />
              <span>{t(`probe-${name}` as Key)}</span>
            </button>
          </li>
        ))}
      </ul>
      {chosen && <ProbeForm key={chosen[0]} name={chosen[0]} args={chosen[1]} onClose={() => setCycle(null)} />}
    </Card>
  );
}

function ProbeForm({ name, args, onClose }: { name: string; args: string[]; onClose: () => void }) {
  const [values, setValues] = useState<Record<string, string>>({});
  const [sets, setSets] = useState<0 | 1>(0);
  const numbers = args.map((arg) => (arg === "set" ? sets : parseNumber(values[arg] ?? "0")));
  const line = `o<probe-${name}> call ${numbers.map((n) => `[${n}]`).join(" ")}`;
  return (
    <Dialog id="probe-form" title={t(`probe-${name}` as Key)} onClose={onClose}>
      <img class="large" src={`probe-${name}.svg`} alt="" />
      <div class="row">
        {args.filter((arg) => arg !== "set").map((arg) => (
          <Field key={arg} numeric label={t(`argument-${arg}` as Key)} value={values[arg] ?? "0"} onInput={(text) => setValues({ ...values, [arg]: text })} />
        ))}
      </div>
      {args.includes("set") && (
        <Choice label={t("set")} value={sets} options={[{ value: 0, label: t("only-measure") }, { value: 1, label: t("set-zero") }]} onChange={setSets} />
      )}
      <code>{line}</code>
      <footer>
        <Button id="probe-run" kind="go tall" icon="start" label={t("run")} orders="mdi" disabled={numbers.some(Number.isNaN)} onClick={() => void order("mdi", { line }).then((answer) => answer !== undefined && onClose())} />
      </footer>
    </Dialog>
  );
}

function Spindle() {
  const [speed, setSpeed] = useState("1000");
  const spindle = useStatus((s) => s.spindle);
  const coolant = useStatus((s) => s.coolant);
  const rpm = parseNumber(speed);
  const turn = (speed_rpm: number) => () => void order("spindle", { speed_rpm });
  return (
    <Card title={t("by-hand")}>
      {spindle && (
        <div class="row">
          <Field numeric label={`${t("spindle")}, 1/min`} value={speed} onInput={setSpeed} />
          <Button id="spindle-forward" orders="spindle" label={t("forward")} disabled={Number.isNaN(rpm)} onClick={turn(rpm)} />
          <Button id="spindle-backward" orders="spindle" label={t("backward")} disabled={Number.isNaN(rpm)} onClick={turn(-rpm)} />
          <Button id="spindle-stop" orders="spindle" label={t("stop")} onClick={turn(0)} />
        </div>
      )}
      <div class="row">
        {(["flood", "mist"] as const).map((what) => (
          <Button key={what} id={`coolant-${what}`} kind="toggle" pressed={coolant?.[what] ?? false} orders="coolant" label={t(what)} onClick={() => void order("coolant", { [what]: !coolant?.[what] })} />
        ))}
      </div>
    </Card>
  );
}

const PARTS = { "mdi-part": Mdi, "touch-off": TouchOff, offsets: Offsets, tools: Tools, probing: Probing } as const;

export function Setup() {
  const small = useSmall();
  const [part, setPart] = useState<keyof typeof PARTS>("mdi-part");
  const Part = PARTS[part];
  return (
    <div class="page setup">
      <div class="column">
        {!small && <Dro />}
        <Jog />
      </div>
      <div class="column">
        <Choice
          label={t("page-setup")}
          value={part}
          options={(Object.keys(PARTS) as (keyof typeof PARTS)[]).map((value) => ({ value, label: t(value), id: `part-${value}` }))}
          onChange={setPart}
        />
        {part === "mdi-part" && <Home />}
        <Part />
        {part === "mdi-part" && <Spindle />}
      </div>
    </div>
  );
}

