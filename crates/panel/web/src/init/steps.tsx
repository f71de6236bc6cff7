/** The five steps, each with its question, its explanation, and what went wrong in it. */
import type { ComponentChildren } from "preact";
import { useEffect, useLayoutEffect, useState } from "preact/hooks";
import { t } from "../i18n";
import { authorised } from "../store";
import { Button, Dialog, Field, Icon } from "../ui";
import { type Axis, type Kept, LETTERS, type Nodes, type Scan, type Typed, ids, isRotary, lowerOf, upperOf, wrongIn } from "./answers";
import { type Answers, EXISTS, LOG_IN, NONE, type Offer, check, scan as scanned, start, statusOf, why, write } from "./contract";
import { Failed, Note, Pick, Step, leave } from "./parts";

type Type = (next: Partial<Typed>) => void;

export function MachineStep({ offer, typed, type }: { offer: Offer; typed: Typed; type: Type }) {
  return (
    <Step number={1} title={t("machine")} done={typed.name.trim() !== ""}>
      <div class="question">
        <Field id="init-name" label={t("init-name")} value={typed.name} onInput={(name) => type({ name })} />
        <p class="muted">{t("init-name-explained")}</p>
      </div>
      <Pick
        id="init-for"
        label={t("init-for")}
        value={typed.to_try ? "try" : "machine"}
        options={[
          { value: "machine", label: t("init-for-machine"), text: t("init-for-machine-explained") },
          { value: "try", label: t("init-for-try"), text: t("init-for-try-explained") },
        ]}
        onChange={(what) => type({ to_try: what === "try" })}
      />
      <Note kind={offer.real_time || typed.to_try ? "good" : "wait"}>{t(offer.real_time ? "init-real-time" : typed.to_try ? "init-no-real-time-try" : "init-no-real-time")}</Note>
    </Step>
  );
}

export function BusStep({ offer, typed, type, scan, onScan, look, done }: { offer: Offer; typed: Typed; type: Type; scan: Scan | null; onScan: (scan: Scan) => void; look: () => Promise<void>; done: boolean }) {
  const [scanning, setScanning] = useState("");
  const [failed, setFailed] = useState("");
  const name = typed.interface.trim();
  const run = async () => {
    setScanning(name);
    setFailed("");
    try {
      onScan({ ...(await scanned(name)), interface: name });
    } catch (error) {
      setFailed(why(error));
    }
    setScanning("");
  };
  const [wired, wireless] = [false, true].map((is) => offer.interfaces.filter((one) => one.wireless === is));
  const known = scan?.interface === name ? scan : null;
  return (
    <Step number={2} title={t("init-bus")} done={done}>
      {offer.interfaces.length ? (
        <Pick
          id="init-interface"
          label={t("init-interface")}
          value={typed.interface}
          options={[...wired!, ...wireless!].map((one) => ({ value: one.name, label: one.name, text: t(one.wireless ? "init-wireless" : one.up ? "init-link" : "init-no-link"), unfit: one.wireless }))}
          onChange={(name) => {
            type({ interface: name });
            setFailed("");
          }}
        />
      ) : (
        <Field id="init-interface" label={t("init-interface")} value={typed.interface} onInput={(name) => type({ interface: name })} />
      )}
      <div class="beside">
        <p class="muted">{t("init-interface-explained")}</p>
        <Button id="init-look" icon="reset" label={t("init-look")} onClick={() => void look()} />
      </div>
      <Pick
        id="init-nodes"
        label={t("init-nodes")}
        value={typed.by_hand ? "hand" : "scan"}
        options={[
          { value: "scan", label: t("init-scan"), text: t("init-scan-explained") },
          { value: "hand", label: t("init-hand"), text: t("init-hand-explained") },
        ]}
        onChange={(how) => type({ by_hand: how === "hand" })}
      />
      {typed.by_hand ? (
        <div class="fields">
          <Ids id="init-drives" label={t("init-drives")} value={typed.drives} wrong={ids(typed.drives)?.length ? "" : t("init-ids-wrong")} onInput={(drives) => type({ drives })} />
          <Ids id="init-io" label={t("init-io")} value={typed.io} wrong={ids(typed.io) ? "" : t("init-ids-wrong")} onInput={(io) => type({ io })} />
        </div>
      ) : (
        <>
          <div class="row">
            <Button id="init-scan" kind={known ? "" : "go"} icon="bus" label={t("init-scan-one", { interface: name })} disabled={!name} dim={scanning !== ""} onClick={() => void (scanning || run())} />
          </div>
          <div role="status" data-testid="init-found">
            {scanning ? (
              <p class="muted">
                {t("init-scanning", { interface: scanning })} <progress aria-label={t("init-scanning", { interface: scanning })} />
              </p>
            ) : (
              known && !failed && <FoundList scan={known} />
            )}
          </div>
          {failed && <Failed id="init-scan-failed" text={failed} />}
        </>
      )}
    </Step>
  );
}

function FoundList({ scan: { bus, nodes } }: { scan: Scan }) {
  const drives = nodes.filter((node) => node.is_drive).length;
  return (
    <>
      <p class="strong">{t("init-found", { bus, drives, io: nodes.length - drives })}</p>
      <ul class="found">
        {nodes.map(({ id, name, is_drive }) => (
          <li key={id}>
            <Icon name={is_drive ? "setup" : "bus"} />
            <span>
              <b>{t(is_drive ? "init-drive" : "init-inputs")}</b> {name ?? <i>{t("init-nameless")}</i>}
            </span>
            <small>
              {t("node")} {id}
            </small>
          </li>
        ))}
      </ul>
      {drives === 0 && <Note kind="wait">{t("init-no-drive")}</Note>}
    </>
  );
}

function Ids({ id, label, value, wrong, onInput }: { id: string; label: string; value: string; wrong: string; onInput: (value: string) => void }) {
  return (
    <div class={wrong ? "job-field wrong" : "job-field"}>
      <Field id={id} label={label} value={value} onInput={onInput} />
      {wrong && <WrongText id={id} text={wrong} />}
    </div>
  );
}

const WrongText = ({ id, text }: { id: string; text: string }) => (
  <p class="error" role="alert" data-testid={`${id}-wrong`}>
    {text}
  </p>
);

export function AxesStep({ typed, type, nodes, done }: { typed: Typed; type: Type; nodes: Nodes | null; done: boolean }) {
  const axes = typed.axes.slice(0, nodes?.drives.length ?? 0);
  const wrong = wrongIn(axes);
  return (
    <Step number={3} title={t("init-axes")} done={done && nodes !== null}>
      {!nodes && <p class="muted">{t("init-axes-wait")}</p>}
      {nodes && (
        <>
          <dl class="explained">
            <dt>{t("init-letter")}</dt>
            <dd>{t("init-letter-explained")}</dd>
            <dt>{t("init-scale")}</dt>
            <dd>{t("init-scale-explained")}</dd>
            <dt>{t("init-ends")}</dt>
            <dd>{t("init-ends-explained")}</dd>
            <dt>{t("init-speed", { unit: "mm" })}</dt>
            <dd>{t("init-speed-explained")}</dd>
          </dl>
          {axes.map((axis, at) => (
            <AxisFields
              key={at}
              number={at}
              axis={axis}
              drive={nodes.drives[at]!}
              wrong={wrong[at]!}
              change={(next) => type({ axes: typed.axes.map((one, other) => (other === at ? { ...one, ...next } : one)) })}
            />
          ))}
        </>
      )}
    </Step>
  );
}

function AxisFields({ number, axis, drive, wrong, change }: { number: number; axis: Axis; drive: Nodes["drives"][number]; wrong: ReturnType<typeof wrongIn>[number]; change: (next: Partial<Axis>) => void }) {
  const unit = isRotary(axis.letter) ? "°" : "mm";
  const field = (key: keyof Axis, label: string, value: string) => (
    <div class={wrong[key] ? "job-field wrong" : "job-field"}>
      <Field numeric id={`init-${key}-${number}`} label={label} value={value} onInput={(text) => change({ [key]: text })} />
      {wrong[key] && <WrongText id={`init-${key}-${number}`} text={wrong[key]} />}
    </div>
  );
  return (
    <fieldset class="axis">
      <legend>
        {t("init-drive-of", { number: drive.id })} {drive.name && <small>{drive.name}</small>}
      </legend>
      <div class="fields">
        <div class={wrong.letter ? "job-field wrong" : "job-field"}>
          <label class="field">
            <span>{t("init-letter")}</span>
            <select data-testid={`init-letter-${number}`} value={axis.letter} onChange={(event) => change({ letter: event.currentTarget.value })}>
              {[...LETTERS].map((letter) => (
                <option key={letter}>{letter}</option>
              ))}
            </select>
          </label>
          {wrong.letter && <WrongText id={`init-letter-${number}`} text={wrong.letter} />}
        </div>
        {field("counts", t("init-counts"), axis.counts)}
        {field("units", t("init-units", { unit }), axis.units)}
        {field("lower", t("init-lower", { unit }), lowerOf(axis))}
        {field("upper", t("init-upper", { unit }), upperOf(axis))}
        {field("speed", t("init-speed", { unit }), axis.speed)}
      </div>
    </fieldset>
  );
}

/** Behind the last key the file is made after so long, ms. */
const TYPING_MS = 300;

export function FileStep({
  offer,
  answers,
  turn,
  again,
  written,
  onWritten,
  ready,
}: {
  offer: Offer;
  answers: Answers | null;
  turn: number;
  again: () => void;
  written: Kept["written"];
  onWritten: (written: Kept["written"]) => void;
  ready: boolean;
}) {
  const [checked, setChecked] = useState<{ key: string; text?: string; wrong?: string } | null>(null);
  const [failed, setFailed] = useState("");
  const [asks, setAsks] = useState(false);
  const [writing, setWriting] = useState(false);
  const json = JSON.stringify(answers);
  const key = `${turn} ${json}`;
  useEffect(() => {
    setFailed("");
    setAsks(false);
    if (!answers) return;
    let wanted = true;
    const told = (what: { text?: string; wrong?: string }) => wanted && setChecked({ key, ...what });
    const waits = setTimeout(() => void check(answers).then(told, (error) => told({ wrong: why(error) })), TYPING_MS);
    return () => {
      wanted = false;
      clearTimeout(waits);
    };
  }, [key]);
  const isNow = checked?.key === key;
  const isWritten = written?.answers === json;
  const put = async (replace: boolean) => {
    setWriting(true);
    setFailed("");
    try {
      const { written } = await write(answers!, replace);
      onWritten({ answers: json, file: written });
      setAsks(false);
    } catch (error) {
      const exists = !replace && statusOf(error) === EXISTS;
      setAsks(exists);
      if (!exists) setFailed(why(error));
    }
    setWriting(false);
  };
  return (
    <Step number={4} title={t("machine-file")} done={isWritten}>
      <p class="muted">{t(answers ? "init-file-explained" : ready ? "init-file-wrong" : "init-file-wait", { file: offer.file })}</p>
      {answers && (
        <>
          {isNow && checked.wrong && (
            <>
              <Failed id="init-check-failed" text={checked.wrong} />
              <div class="row">
                <Button id="init-check" icon="reset" label={t("init-again")} onClick={again} />
              </div>
            </>
          )}
          {/* The last one stays while the next one is made: nothing on the page jumps. */}
          {checked?.text !== undefined && (
            <pre class={isNow ? "job-text" : "job-text old"} data-testid="init-text" tabIndex={0} role="region" aria-label={t("machine-file")} aria-busy={!isNow}>
              {checked.text}
            </pre>
          )}
          {!isNow && <p class="muted">{t("checking")}</p>}
          {failed && <Failed id="init-write-failed" text={failed} />}
          <div class="row">
            <Button id="init-write" kind={isWritten ? "" : "go"} icon="check" label={t("init-write", { file: offer.file })} disabled={!isNow || checked.wrong !== undefined} dim={writing} onClick={() => void (writing || put(false))} />
          </div>
          <div role="status" data-testid="init-written">
            {written && <Note kind={isWritten ? "good" : "wait"}>{t(isWritten ? "init-written" : "init-changed", { file: written.file })}</Note>}
          </div>
        </>
      )}
      {asks && (
        <Replace file={offer.file} onClose={() => setAsks(false)}>
          <Button id="init-replace" kind="warn" label={t("file-replace-yes")} dim={writing} onClick={() => void (writing || put(true))} />
        </Replace>
      )}
    </Step>
  );
}

function Replace({ file, onClose, children }: { file: string; onClose: () => void; children: ComponentChildren }) {
  const [asked] = useState(() => document.activeElement as HTMLElement | null);
  useLayoutEffect(() => {
    const pressed = (event: KeyboardEvent) => event.key === "Escape" && onClose();
    window.addEventListener("keydown", pressed);
    return () => {
      window.removeEventListener("keydown", pressed);
      asked?.focus();
    };
  }, []);
  return (
    <Dialog id="init-replace-dialogue" title={t("init-exists")}>
      <p>{t("init-replace-explained", { file })}</p>
      <footer>
        <Button id="init-keep" label={t("file-replace-no")} onClick={onClose} />
        {children}
      </footer>
    </Dialog>
  );
}

const EVERY_MS = 1000;
/** A control that has not come after so long has a reason, s. */
const START_S = 30;

/** `file`: the one that was written last. */
export function StartStep({ file, done }: { file: string | null; done: boolean }) {
  const [state, setState] = useState<"" | "asked" | "starts" | "late">("");
  const [failed, setFailed] = useState("");
  const run = async () => {
    setState("asked");
    setFailed("");
    try {
      await start();
      setState("starts");
    } catch (error) {
      setFailed(why(error));
      // It may come all the same.
      setState(state);
    }
  };
  const waits = state === "starts" || state === "late";
  // A button that is pressed keeps the focus: it is dim, not disabled.
  const begins = state === "asked" || state === "starts";
  useEffect(() => {
    if (!waits) return;
    const look = () =>
      // With a control there, its own token is asked for, or there is no such page.
      fetch("init", { cache: "no-store", headers: authorised() }).then(
        ({ status }) => [NONE, LOG_IN].includes(status) && leave(),
        () => {},
      );
    const [looks, late] = [setInterval(look, EVERY_MS), setTimeout(() => setState("late"), 1000 * START_S)];
    return () => {
      clearInterval(looks);
      clearTimeout(late);
    };
  }, [waits]);
  return (
    <Step number={5} title={t("start")} done={false}>
      <p>{t("init-start-explained")}</p>
      <Note kind="wait">{t("init-start-safety")}</Note>
      <div class="row">
        <Button id="init-start" kind="go tall" icon="start" label={t("init-start")} disabled={!done} dim={begins} onClick={() => void (begins || run())} />
        {!done && <p class="muted">{t("init-start-wait")}</p>}
      </div>
      {failed && <Failed id="init-start-failed" text={failed} />}
      {state === "starts" && (
        <p class="muted" role="status" data-testid="init-starting">
          {t("init-starting")} <progress aria-label={t("init-starting")} />
        </p>
      )}
      {state === "late" && (
        <>
          <Failed id="init-late" text={t("init-late", { s: START_S })} />
          <code>isocnc run {file}</code>
          <p class="muted">{t("init-late-looks")}</p>
        </>
      )}
    </Step>
  );
}
