/** What is around every page: state bar, alarm, orders at the foot, dialogues. */
import { useEffect, useState } from "preact/hooks";
import { Alarm } from "./alarms";
import { inWords } from "./control-words";
import { Display } from "./display";
import { type Key, fixed, t, word } from "./i18n";
import { keys } from "./keys";
import { nextStep, refuses, reset } from "./orders";
import { StartButton } from "./start";
import { ask, clientName, connection, controlOf, dismiss, getStore, logIn, order, say, setStore, tellRefused, token, useStatus, useStore } from "./store";
import type { Status, Waiting } from "./types";
import { Button, Dialog, Field, Form, Icon, type IconName } from "./ui";
import { useEveryHalfSecond } from "./hooks";

// ------------------------------------------------------------------------------------------------ state bar

/** Colour and form of a state, beside its word. */
const LOOKS: Record<string, [string, IconName]> = {
  running: ["run", "start"],
  homing: ["run", "home"],
  jogging: ["run", "setup"],
  returning: ["run", "resume"],
  ready: ["ready", "check"],
  held: ["wait", "hold"],
  away: ["wait", "setup"],
  stopping: ["wait", "stop"],
  enabling: ["wait", "power"],
  disabling: ["wait", "power"],
  faulted: ["fault", "warning"],
  estop: ["fault", "warning"],
  silenced: ["fault", "warning"],
};

export function StateBar() {
  const machine = useStatus((s) => s.machine);
  // Between two joints that home one after the other, the machine is ready for an instant.
  const state = useStatus((s) => (s.state === "ready" && s.activity === "homing" ? "homing" : s.state)) ?? "";
  const power = useStatus((s) => s.power) ?? "";
  const mode = useStatus((s) => s.mode);
  const waiting = useStatus((s) => s.waiting);
  const obstruction = useStatus((s) => s.obstruction);
  const held = useStatus(heldBy);
  const [look, icon] = LOOKS[state] ?? ["off", "power"];
  return (
    <header class="bar">
      <div class="name" title={machine ?? ""}>
        <span class="logo" aria-hidden="true" />
        <b>{machine ?? "isocnc"}</b>
      </div>
      <div class={`state ${look}`} data-testid="state" data-state={state} role="status" aria-live="polite" aria-label={t("state")}>
        <Icon name={icon} />
        <b>{state ? word("state", state) : "–"}</b>
        {power === "estop_open" && <span>{t("chain-open")}</span>}
      </div>
      <div class="mode" data-testid="mode" data-mode={mode ?? ""} title={t("mode")}>
        {mode ? word("mode", mode) : ""}
      </div>
      <NextStep />
      <div class="waiting" data-testid="waiting" aria-live="polite">
        {held || (waiting ? waitingFor(waiting, state) : obstruction && inWords(obstruction))}
      </div>
      <ForcedChip />
      <ControlChip />
      <Age />
      <KeysChip />
      <Display />
    </header>
  );
}

/** What holds the program or its feed; "" where nothing does, or it is not known. */
export function heldBy({ held_by }: Status): string {
  return held_by.map(inWords).join("; ");
}

/** In a word of the panel where there is one. */
function waitingFor({ for: code, what }: Waiting, state: string): string {
  // It waits for the operator then, but for no M0.
  if (state === "away") return inWords(what);
  const short = word("wait", code);
  return `${t("waits")}: ${short === code ? inWords(what) : short}`;
}

/** Variables that do not have what pins and programs make of them: told on every page. */
function ForcedChip() {
  const [open, setOpen] = useState(false);
  const count = useStatus((s) => s.forced?.length) ?? 0;
  return (
    <>
      {count > 0 && <Button id="forced" kind="chip halt-chip" icon="warning" label={`${t("forced-chip")} ${count}`} onClick={() => setOpen(!open)} />}
      {open && <ForcedDialog onClose={() => setOpen(false)} />}
    </>
  );
}

function ForcedDialog({ onClose }: { onClose: () => void }) {
  const forced = useStatus((s) => s.forced) ?? [];
  const may = useStore((s) => s.methods.has("logic.release") && s.role === "set-up");
  return (
    <Dialog id="forced-dialogue" title={t("forced-title")} onClose={onClose}>
      <p>{t("forced-explained")}</p>
      <ul class="forced">
        {forced.map(({ program, variable, value }) => (
          <li key={`${program} ${variable}`}>
            <span>
              <b>{variable}</b> = {value} <small>{program}</small>
            </span>
            {may && <Button label={t("release")} orders="logic.release" onClick={() => void order("logic.release", { program, variable })} />}
          </li>
        ))}
        {forced.length === 0 && <li>{t("forced-none")}</li>}
      </ul>
    </Dialog>
  );
}

function Age() {
  useEveryHalfSecond();
  const connected = useStore((s) => s.connected);
  const age = useStore((s) => s.age);
  const ms = connection.age();
  return (
    <div class={`age ${connected && age === 0 ? "fresh" : "old"}`} data-testid="age" title={t("age")}>
      <i aria-hidden="true" />
      <span>{connected && age === 0 ? t("live") : `${fixed(ms / 1000, 0)} s`}</span>
    </div>
  );
}

function KeysChip() {
  const on = useStore((s) => s.keysOn);
  return (
    <Button
      id="keys"
      icon="keys"
      kind={`chip ${on ? "on" : ""}`}
      pressed={on}
      label={t("keys")}
      title={t(on ? "keys-on" : "keys-off")}
      onClick={() => {
        keys.set(!on);
        say("note", t(on ? "keys-off" : "keys-on"));
      }}
    />
  );
}

// ------------------------------------------------------------------------------------------------ control

function ControlChip() {
  const [open, setOpen] = useState(false);
  const control = useStatus((s) => s.control);
  const who = useStore(controlOf);
  const role = useStore((s) => s.role);
  const text = role === "watch" ? t("role-watch") : who === "mine" ? t("control-mine") : who === "free" ? t("control-free") : (control?.name ?? "");
  return (
    <>
      <Button id="control" kind={`chip control ${who}`} icon="hand" title={t("control-dialogue")} onClick={() => setOpen(!open)}>
        <span class="label">
          {t("control")}: <b>{text}</b>
        </span>
      </Button>
      {open && <ControlDialog onClose={() => setOpen(false)} />}
    </>
  );
}

function ControlDialog({ onClose }: { onClose: () => void }) {
  const control = useStatus((s) => s.control);
  const who = useStore(controlOf);
  const [name, setName] = useState(clientName());
  const take = async (force: boolean) => {
    localStorage.setItem("name", name);
    const taken = await order("control.take", { name, ...(force ? { force } : {}) });
    if (!taken) return;
    setStore({ client: taken.client });
    onClose();
  };
  return (
    <Dialog id="control-dialogue" title={t("control-dialogue")} onClose={onClose}>
      <p>{t("control-explained")}</p>
      {control?.taken && who !== "mine" && <p class="strong">{t("control-held", { name: control.name })}</p>}
      <Form onSend={() => void take(false)}>
        <Field label={t("control-name")} value={name} onInput={setName} />
        <footer>
          {who === "mine" && <Button id="control-release" label={t("control-release")} orders="control.release" onClick={() => void order("control.release").then(onClose)} />}
          {who === "other" && <Button id="control-force" kind="warn" label={t("control-force", { name: control?.name ?? "" })} orders="control.take" onClick={() => void take(true)} />}
          {who !== "other" && <Button id="control-take" kind="go" label={t("control-take")} orders="control.take" submit />}
        </footer>
      </Form>
    </Dialog>
  );
}

/** Control that was taken is kept: who says nothing for 30 s loses it. */
const RENEW_MS = 10_000;
setInterval(() => {
  const store = getStore();
  if (store.connected && controlOf(store) === "mine" && document.visibilityState === "visible") {
    ask("control.take", { name: clientName() }).catch(() => {});
  }
}, RENEW_MS);

// ------------------------------------------------------------------------------------------------ banners

export function Banners() {
  const connected = useStore((s) => s.connected);
  const status = useStore((s) => s.status !== null);
  const age = useStore((s) => s.age);
  const stalled = useStore((s) => s.stalled);
  const reason = useStore((s) => s.reason);
  const denied = useStore((s) => s.denied);
  useEveryHalfSecond();
  const s = fixed(connection.age() / 1000, 0);
  let text = "";
  if (denied) text = "";
  else if (!connected) text = status ? t("no-connection", { s }) : t("connecting");
  else if (age >= 1000) text = t("no-data", { s });
  else if (stalled) text = t("stalled");
  return (
    <>
      {text && (
        <div class="banner" role="alert" data-testid="connection">
          <Icon name="warning" />
          <span>
            {text} {reason && <small>{reason}</small>}
          </span>
        </div>
      )}
      <Alarm />
    </>
  );
}

// ------------------------------------------------------------------------------------------------ orders

export function Actions() {
  const power = useStatus((s) => s.power) ?? "";
  const nothing = useStore((s) => refuses(s, "reset"));
  const on = power === "on" || power === "switching";
  return (
    <footer class="actions" role="group">
      <Button id="estop" icon="estop" kind="tall estop" label={t("estop")} title={t("estop-explained")} orders="estop" onClick={() => void order("estop")} />
      <Button id="power" icon="power" kind={on ? "tall lit" : "tall"} pressed={on} label={t(on ? "power-off" : "power-on")} orders={on ? "off" : "on"} onClick={() => switchDrives(on)} />
      <Button id="reset" icon="reset" kind={nothing ? "tall" : "tall warn"} label={t("reset")} orders="reset" onClick={() => getStore().status && void reset(getStore().status!)} />
      <StartButton />
      <Button id="resume" icon="resume" kind="tall go" label={t("resume")} orders="resume" onClick={() => void resume()} />
      <Button id="hold" icon="hold" kind="tall wait" label={t("hold")} orders="hold" onClick={() => void order("hold")} />
      <Button id="stop" icon="stop" kind="tall halt" label={t("stop")} orders="stop" onClick={() => void order("stop")} />
    </footer>
  );
}

let switched = -Infinity;

/** Who taps twice wants them on, not on and off. */
function switchDrives(on: boolean): void {
  const now = performance.now();
  if (now - switched < DOUBLE_MS) return;
  switched = now;
  void order(on ? "off" : "on");
}

/** Two taps in this time are one. */
const DOUBLE_MS = 600;

export async function resume(): Promise<void> {
  const answer = await order("resume");
  if (answer?.returns?.length) say("note", t("returns", { way: answer.returns.map(inWords).join(" · ") }));
}

// ------------------------------------------------------------------------------------------------ tools

/** What the program waits for a person to do. Not closed by a key that moves the machine. */
export function ToolDialogue() {
  const waits = useStatus((s) => (s.waiting?.for === "tool_change" ? s.waiting.what : null));
  const now = useStatus((s) => s.tool);
  const [tool, setTool] = useState<{ length: number; diameter: number; remark: string; unit: string } | null>(null);
  const wanted = Number(waits?.params?.tool ?? 0);
  useEffect(() => {
    setTool(null);
    if (!waits || !wanted) return;
    ask("tool.list").then(({ tools, unit }) => {
      const found = tools.find((one) => one.tool === wanted);
      if (found) setTool({ ...found, unit });
    }, tellRefused);
  }, [waits]);
  if (!waits) return null;
  return (
    <Dialog id="tool-dialogue" title={t("tool-dialogue")}>
      <p class="tool-number" aria-hidden="true">
        T{wanted}
      </p>
      <p class="strong">{wanted ? t("tool-in", { tool: wanted }) : t("tool-out")}</p>
      {tool && (
        <p>
          {t("tool-details", { length: `${fixed(tool.length, 3)} ${tool.unit}`, diameter: `${fixed(tool.diameter, 3)} ${tool.unit}` })}
          {tool.remark && <br />}
          {tool.remark}
        </p>
      )}
      <p class="muted">{t("in-spindle", { tool: now ? `T${now}` : t("tool-none") })}</p>
      <footer>
        <Button id="tool-changed" kind="go tall" icon="check" label={t(wanted ? "tool-changed" : "tool-removed")} orders="tool.changed" onClick={() => void order("tool.changed")} />
      </footer>
    </Dialog>
  );
}

/** Whoever comes from elsewhere shows a token, which this asks for where the address did not bring it. */
export function TokenDialogue() {
  const denied = useStore((s) => s.denied);
  const [text, setText] = useState("");
  const wanted = text.trim();
  if (!denied) return null;
  return (
    <Dialog id="token-dialogue" title={t("token-dialogue")}>
      <p class="strong">{t(token ? "token-wrong" : "token-missing")}</p>
      <p>{t("token-explained")}</p>
      <Form onSend={() => logIn(wanted)}>
        <Field id="token" label={t("token")} value={text} onInput={setText} />
        <footer>
          <Button id="log-in" kind="go" label={t("log-in")} disabled={!wanted} submit />
        </footer>
      </Form>
    </Dialog>
  );
}

export function Toasts() {
  const toasts = useStore((s) => s.toasts);
  return (
    <div class="toasts" role="log" aria-live="assertive">
      {toasts.map((toast) => (
        <div class={`toast ${toast.kind}`} key={toast.id} data-testid="toast">
          <Icon name={toast.kind === "refused" ? "warning" : "check"} />
          <Said text={toast.text} />
          <Button icon="close" kind="plain" label={t("close")} onClick={() => dismiss(toast.id)} />
        </div>
      ))}
    </div>
  );
}

/** A sentence; below it the lines of a program that it is about, where it has some. */
function Said({ text }: { text: string }) {
  const [first, ...lines] = text.split("\n");
  return (
    <span>
      {first}
      {lines.length > 0 && <code class="lines">{lines.join("\n")}</code>}
    </span>
  );
}

function NextStep() {
  const step = useStatus((s) => nextStep(s));
  const idle = useStatus((s) => s.activity === "idle" || s.power === "alarm");
  if (!step || !idle) return null;
  return (
    <div class="next">
      <span>{t("next-step")}</span>
      <Button id="next" kind="go" label={t(step.word as Key)} orders={step.method} onClick={() => void order(step.method)} />
    </div>
  );
}
