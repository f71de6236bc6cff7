/** What the machine file adds to the panel: buttons that run lines or load a program, values of pins, pages. */
import { useRef, useState } from "preact/hooks";
import { inWords } from "../control-words";
import { duration, fixed, parseNumber, t } from "../i18n";
import { useMachine } from "../machine";
import { isBarred } from "../orders";
import { usePinValues } from "../pins";
import type { Refused } from "../rpc";
import { fileName } from "../send";
import { ask, getStore, isBlind, say, tellRefused, useStore } from "../store";
import type { Described, Pin } from "../types";
import { Button, Card, Dialog, Field, Form, barredBecause } from "../ui";

type OwnButton = Described["buttons"][number];
type OwnValue = Described["values"][number];
type Question = OwnButton["questions"][number];

/** Values follow five times a second. */
const LOOK_MS = 200;
/** Two taps in this time are one. */
const DOUBLE_MS = 600;

/** What there is of it; nothing where the control is an older one. */
export function useOwn(): { buttons: OwnButton[]; values: OwnValue[]; pages: string[] } {
  const described = useMachine() as Partial<Described> | null;
  return { buttons: described?.buttons ?? [], values: described?.values ?? [], pages: described?.pages ?? [] };
}

export function OwnCards() {
  const { buttons, values } = useOwn();
  const pins = [...new Set([...buttons.flatMap(({ lamp }) => lamp ?? []), ...values.map(({ pin }) => pin)])];
  const now = usePinValues(pins, LOOK_MS);
  if (buttons.length + values.length === 0) return null;
  return (
    <div class="own" tabIndex={0} role="group" aria-label={t("own-short")}>
      {buttons.length > 0 && <Buttons buttons={buttons} lamps={now.values} />}
      {values.length > 0 && <Values values={values} now={now.values} unknown={now.unknown} />}
    </div>
  );
}

const isOn = (pin: Pin | undefined): boolean => pin !== undefined && pin.value !== null && Number(pin.value) !== 0;

function Buttons({ buttons, lamps }: { buttons: OwnButton[]; lamps: Map<string, Pin> }) {
  const [asked, setAsked] = useState<OwnButton | null>(null);
  const pressed = useRef(-Infinity);
  const press = (button: OwnButton) => {
    const store = getStore();
    if (isBarred(store, "button.press", button.role)) return say("refused", barredBecause(store));
    if (button.ask || button.questions.length > 0) return setAsked(button);
    const now = performance.now();
    if (now - pressed.current < DOUBLE_MS) return;
    pressed.current = now;
    void send(button, {});
  };
  return (
    <Card title={t("own-buttons")} id="own-buttons" kind="own-buttons">
      <div class="pads">
        {buttons.map((button) => (
          <Button
            key={button.name}
            id={`own-${button.name}`}
            kind="pad"
            label={button.label}
            orders={orderOf(button)}
            needs={button.role}
            pressed={button.lamp ? isOn(lamps.get(button.lamp)) : undefined}
            onClick={() => press(button)}
          />
        ))}
      </div>
      {asked && <Asked key={asked.name} button={asked} onClose={() => setAsked(null)} />}
    </Card>
  );
}

/** What it does, as far as it is about whether the control would carry it out. */
const orderOf = ({ program }: OwnButton): string => (program === null ? "mdi" : "program load");

interface Wrong {
  field: string;
  text: string;
}

/** Presses it; what is wrong with an answer, or whether it was carried out. */
async function send(button: OwnButton, answers: Record<string, number>): Promise<Wrong | boolean> {
  if (isBlind()) {
    say("refused", t("not-sent"));
    return false;
  }
  try {
    const { program, planned_time_s, warning } = await ask("button.press", { name: button.name, answers });
    if (program) say("note", t("own-loaded", { name: fileName(program), time: duration(planned_time_s ?? 0) }) + (warning ? ` ${warning}` : ""));
    return true;
  } catch (error) {
    const { field, said } = error as Refused;
    if (field !== undefined && button.questions.some(({ name }) => name === field)) return { field, text: inWords(said) };
    tellRefused(error);
    return false;
  }
}

/** Why an answer cannot be used; "" where it can. */
function wrongWith({ min, max }: Question, text: string): string {
  const value = parseNumber(text);
  if (Number.isNaN(value)) return t("no-number");
  if (value >= (min ?? -Infinity) && value <= (max ?? Infinity)) return "";
  if (min !== null && max !== null) return t("own-between", { min: plain(min), max: plain(max) });
  return min !== null ? t("own-least", { min: plain(min) }) : t("own-most", { max: plain(max!) });
}

/** Without an exponent, which no line of G-code has. */
function plain(value: number): string {
  const text = String(value);
  return text.includes("e") ? value.toFixed(12).replace(/\.?0+$/, "") : text;
}

function Asked({ button, onClose }: { button: OwnButton; onClose: () => void }) {
  const { questions, mdi, program } = button;
  const [typed, setTyped] = useState<Record<string, string>>(() => Object.fromEntries(questions.map(({ name, default: value }) => [name, plain(value)])));
  const [refused, setRefused] = useState<Wrong | null>(null);
  const [sending, setSending] = useState(false);
  const wrong = (question: Question) => wrongWith(question, typed[question.name]!) || (refused?.field === question.name ? refused.text : "");
  const answers = Object.fromEntries(questions.map(({ name }) => [name, parseNumber(typed[name]!)]));
  const sound = questions.every((question) => !wrongWith(question, typed[question.name]!));
  const line = (text: string) => text.replace(/\{([^}]+)\}/g, (place, name: string) => (Number.isFinite(answers[name]) ? plain(answers[name]!) : place));
  const run = async () => {
    if (!sound || sending) return;
    setSending(true);
    const done = await send(button, answers);
    setSending(false);
    if (done === true) onClose();
    else setRefused(done || null);
  };
  return (
    <Dialog id="own-dialogue" title={button.label} onClose={onClose}>
      {button.ask && <p class="strong">{button.ask}</p>}
      <Form onSend={() => void run()}>
        {questions.map((question) => {
          const { name, label } = question;
          const why = wrong(question);
          return (
            <div key={name} class={why ? "job-field wrong" : "job-field"}>
              <Field
                id={`own-answer-${name}`}
                numeric
                label={label}
                value={typed[name]!}
                onInput={(value) => {
                  setTyped({ ...typed, [name]: value });
                  setRefused(null);
                }}
              />
              {why && (
                <p class="error" role="alert" data-testid={`own-wrong-${name}`}>
                  {why}
                </p>
              )}
            </div>
          );
        })}
        {program === null ? (
          <>
            <p class="muted">{t("own-lines")}</p>
            <pre class="own-lines" data-testid="own-lines" tabIndex={0} aria-label={t("own-lines")}>
              {mdi.map(line).join("\n")}
            </pre>
          </>
        ) : (
          <p data-testid="own-program">{t("own-loads", { name: program })}</p>
        )}
        <footer>
          <Button id="own-yes" kind="go tall" label={t(program === null ? "run" : "load-program")} orders={orderOf(button)} needs={button.role} disabled={!sound || sending} submit />
        </footer>
      </Form>
    </Dialog>
  );
}

function Values({ values, now, unknown }: { values: OwnValue[]; now: Map<string, Pin>; unknown: ReadonlySet<string> }) {
  const stale = useStore((s) => s.age >= 2000 || !s.connected);
  return (
    <Card title={t("own-values")} id="own-values" kind={stale ? "own-values stale" : "own-values"}>
      <dl>
        {values.map((value, at) => (
          <div key={at}>
            <dt title={value.pin}>{value.label}</dt>
            <dd data-testid={`own-value-${value.pin}`}>{unknown.has(value.pin) ? <small>{t("pin-unknown", { pin: value.pin })}</small> : <Shown {...value} now={now.get(value.pin)} />}</dd>
          </div>
        ))}
      </dl>
    </Card>
  );
}

function Shown({ decimals, unit, now }: OwnValue & { now: Pin | undefined }) {
  if (now?.type === "bit") {
    const on = isOn(now);
    return (
      <>
        <i class={on ? "lamp on" : "lamp"} aria-hidden="true" /> {t(on ? "on" : "off")}
      </>
    );
  }
  const text = typeof now?.value !== "number" ? "–" : now.type === "float" ? fixed(now.value, decimals) : String(now.value);
  return (
    <>
      <b>{text}</b> {unit ?? now?.unit}
    </>
  );
}

/** Links to the pages of the user, which take the place of this one. */
export function OwnPages() {
  const { pages } = useOwn();
  if (pages.length === 0) return null;
  return (
    <nav class="own-pages" aria-label={t("own-pages")} data-testid="own-pages">
      {pages.map((name) => (
        <a key={name} class="button small" href={`own/${encodeURIComponent(name)}`}>
          {name.replace(/\.html$/, "")}
        </a>
      ))}
    </nav>
  );
}
