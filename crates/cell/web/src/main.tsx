/** The page of a cell: all machines at a glance, what is ordered, what has happened. It orders nothing. */
import { type ComponentChildren, render } from "preact";
import { useEffect, useState } from "preact/hooks";
import { type Key, language, span, t, time } from "./words";

const USES = ["alarm", "running", "held", "idle", "unknown"] as const;
type Use = (typeof USES)[number];
const HISTORY = 30;
const OPEN_FIRST = ["open", "held", "done", "cancelled"];

interface Machine {
  name: string;
  class: string;
  alive: boolean;
  silent_s: number | null;
  use: Use;
  panel: string | null;
  state: {
    activity: string;
    program: string | null;
    alarm: string | null;
    why_not: string | null;
    done_percent: number | null;
    remaining_s: number | null;
    parts: number;
  };
}
interface Order {
  id: number;
  program: string;
  count: number;
  completed: number;
  failed: number;
  under_way: number;
  state: string;
  note: string;
  unfit: { machine: string; why: string }[];
}
interface Attempt {
  id: string;
  order: number | null;
  machine: string;
  program: string;
  phase: string;
  note: string;
  sent_unix_s: number;
  took_s: number | null;
}
interface Overview {
  unix_s: number;
  machines: Machine[];
  alarms: { machine: string; seq: number; unix_s: number; text: string }[];
  orders: Order[];
  attempts: Attempt[];
  times: { machine: string; what: Use; seconds: number }[];
  refusals: { unix_s: number; text: string }[];
}

/** What the supervisor said last, and when (ms of this browser). */
function useOverview(): { all: Overview | null; heard: number; now: number } {
  const [told, setTold] = useState<{ all: Overview | null; heard: number; now: number }>({ all: null, heard: Date.now(), now: Date.now() });
  useEffect(() => {
    let timer = 0;
    const look = async () => {
      try {
        const answer = await fetch("overview", { cache: "no-store" });
        if (!answer.ok) throw new Error(String(answer.status));
        const all = (await answer.json()) as Overview;
        setTold({ all, heard: Date.now(), now: Date.now() });
      } catch {
        setTold((before) => ({ ...before, now: Date.now() }));
      }
      timer = setTimeout(look, document.hidden ? 10_000 : 1_000);
    };
    void look();
    return () => clearTimeout(timer);
  }, []);
  return told;
}

function UseOf({ use, count }: { use: Use; count?: number }) {
  return (
    <span class={`use use-${use}`}>
      <i aria-hidden="true" />
      {count === undefined ? t(use) : `${count} ${t(use)}`}
    </span>
  );
}

function Card({ title, children }: { title: string; children: ComponentChildren }) {
  return (
    <section class="card" aria-label={title}>
      <header>
        <h2>{title}</h2>
      </header>
      {children}
    </section>
  );
}

function Table({ title, heads, children }: { title: string; heads: ComponentChildren; children: ComponentChildren }) {
  return (
    // Where it is wider than the screen, keys move it, too.
    <div class="scroll" role="group" aria-label={title} tabIndex={0}>
      <table class="grid cell-table">
        <thead>
          <tr>{heads}</tr>
        </thead>
        <tbody>{children}</tbody>
      </table>
    </div>
  );
}

function MachineCard({ of }: { of: Machine }) {
  const { state } = of;
  // Only addresses of the web: whatever else a control says is shown as a name.
  const link = /^https?:\/\//.test(of.panel ?? "");
  const why = !of.alive
    ? of.silent_s === null
      ? t("never")
      : `${t("silent", { time: span(of.silent_s) })}; ${t("works-alone")}`
    : (state.alarm ?? (of.use === "idle" ? (state.why_not ?? t("ready")) : ""));
  const done = state.done_percent;
  return (
    <li class={`use-${of.use}`} data-machine={of.name}>
      <div class="top">
        <strong>
          {link ? (
            <a href={of.panel!} rel="noreferrer" title={t("open-panel", { name: of.name })}>
              {of.name}
            </a>
          ) : (
            of.name
          )}
        </strong>
        <UseOf use={of.use} />
      </div>
      {of.class && <small>{of.class}</small>}
      {of.alive && state.program && <div>{state.program}</div>}
      {(of.use === "running" || of.use === "held") && done !== null && (
        <progress max={100} value={done} aria-label={t("done", { percent: Math.round(done) })} />
      )}
      {of.alive && of.use !== "idle" && state.remaining_s !== null && <small>{t("left", { time: span(state.remaining_s) })}</small>}
      {why && <small class={of.use === "alarm" ? "bad" : ""}>{why}</small>}
      {of.alive && state.parts > 0 && <small>{t("parts-made", { count: state.parts })}</small>}
    </li>
  );
}

function Machines({ all, only }: { all: Overview; only: Use | null }) {
  const shown = all.machines.filter((one) => only === null || one.use === only);
  return (
    <Card title={t("machines")}>
      {shown.length === 0 ? (
        <p class="muted">{t(all.machines.length === 0 ? "no-machines" : "no-such")}</p>
      ) : (
        <ul class="machines-of-cell">
          {shown.map((one) => (
            <MachineCard key={one.name} of={one} />
          ))}
        </ul>
      )}
    </Card>
  );
}

function Alarms({ all }: { all: Overview }) {
  return (
    <Card title={t("alarms")}>
      <div aria-live="assertive">
        {all.alarms.length === 0 ? (
          <p class="muted">{t("no-alarms")}</p>
        ) : (
          <ul>
            {all.alarms.map((one) => (
              <li key={`${one.machine} ${one.seq}`}>
                <strong>{one.machine}</strong> <span class="bad">{one.text}</span> <small>{t("since", { time: time(one.unix_s) })}</small>
              </li>
            ))}
          </ul>
        )}
      </div>
    </Card>
  );
}

function Queue({ all }: { all: Overview }) {
  if (all.orders.length === 0)
    return (
      <Card title={t("queue")}>
        <p class="muted">{t("no-orders")}</p>
      </Card>
    );
  const orders = [...all.orders].sort((a, b) => OPEN_FIRST.indexOf(a.state) - OPEN_FIRST.indexOf(b.state) || b.id - a.id);
  const heads = (["order", "program", "parts", "state"] as const).map((key) => (
    <th key={key} scope="col">
      {t(key)}
    </th>
  ));
  return (
    <Card title={t("queue")}>
      <Table title={t("queue")} heads={heads}>
        {orders.map((one) => (
          <tr key={one.id}>
            <td>{one.id}</td>
            <td>{one.program}</td>
            <td class="parts">
              <span class="number">{t("of", { done: one.completed, count: one.count })}</span>
              <progress max={one.count} value={one.completed} aria-hidden="true" />
              {one.under_way > 0 && <small>{t("under-way", { count: one.under_way })}</small>}
              {one.failed > 0 && <small class="bad">{t("failed", { count: one.failed })}</small>}
            </td>
            <td>
              <span class={one.state === "held" ? "bad" : ""}>{t(`order-${one.state}` as Key)}</span>
              {one.note && <small>{one.note}</small>}
              {one.state === "open" && one.unfit.map((no) => <small key={no.machine}>{t("not-on", { machine: no.machine, why: no.why })}</small>)}
            </td>
          </tr>
        ))}
      </Table>
    </Card>
  );
}

/** How the time of each machine was spent, and of all of them. */
function UseOfTime({ all }: { all: Overview }) {
  const of = new Map<string, Record<Use, number>>();
  for (const { machine, what, seconds } of all.times) {
    const known = of.get(machine) ?? { running: 0, held: 0, idle: 0, alarm: 0, unknown: 0 };
    known[what] += seconds;
    of.set(machine, known);
  }
  if (of.size === 0)
    return (
      <Card title={t("use")}>
        <p class="muted">{t("no-use")}</p>
      </Card>
    );
  const order: Use[] = ["running", "held", "idle", "alarm", "unknown"];
  const heads = [
    <th key="machine" scope="col">
      {t("machine")}
    </th>,
    <th key="use" scope="col">
      {order.map((use) => (
        <span key={use}>
          <svg class={`shares share-${use}`} style={{ display: "inline", width: "12px", minWidth: 0, height: "12px" }} aria-hidden="true">
            <rect width="12" height="12" />
          </svg>{" "}
          {t(use)}{" "}
        </span>
      ))}
    </th>,
    <th key="running" scope="col">
      {t("running")}
    </th>,
  ];
  return (
    <Card title={t("use")}>
      <Table title={t("use")} heads={heads}>
        {[...of].sort(([a], [b]) => a.localeCompare(b)).map(([machine, times]) => {
          const total = order.reduce((sum, use) => sum + times[use], 0) || 1;
          const share = (use: Use) => (100 * times[use]) / total;
          let x = 0;
          const text = order.map((use) => `${t(use)} ${Math.round(share(use))} %`).join(", ");
          return (
            <tr key={machine}>
              <td>{machine}</td>
              <td>
                <svg class="shares" role="img" aria-label={text}>
                  <title>{text}</title>
                  {order.map((use) => {
                    const at = x;
                    x += share(use);
                    return <rect key={use} class={`share-${use}`} x={`${at}%`} width={`${share(use)}%`} height="18" />;
                  })}
                </svg>
              </td>
              <td class="number">{Math.round(share("running"))} %</td>
            </tr>
          );
        })}
      </Table>
    </Card>
  );
}

function History({ all }: { all: Overview }) {
  if (all.attempts.length === 0)
    return (
      <Card title={t("history")}>
        <p class="muted">{t("no-history")}</p>
      </Card>
    );
  const heads = (["when", "machine", "program", "order", "result", "took"] as const).map((key) => (
    <th key={key} scope="col" class={key === "order" || key === "took" ? "wide" : ""}>
      {t(key)}
    </th>
  ));
  return (
    <Card title={t("history")}>
      <Table title={t("history")} heads={heads}>
        {all.attempts.slice(0, HISTORY).map((one) => (
          <tr key={one.id}>
            <td>{time(one.sent_unix_s)}</td>
            <td>{one.machine}</td>
            <td>{one.program}</td>
            <td class="wide">{one.order ?? ""}</td>
            <td>
              <span class={one.phase === "failed" || one.phase === "interrupted" ? "bad" : ""}>{t(`phase-${one.phase}` as Key)}</span>
              {one.note && one.note !== one.phase && <small>{one.note}</small>}
            </td>
            <td class="wide number">{one.took_s === null ? "" : span(one.took_s)}</td>
          </tr>
        ))}
      </Table>
    </Card>
  );
}

function Refused({ all }: { all: Overview }) {
  return (
    <Card title={t("refused")}>
      {all.refusals.length === 0 ? (
        <p class="muted">{t("no-refused")}</p>
      ) : (
        <ul>
          {all.refusals.map((one, at) => (
            <li key={at}>
              <small>{time(one.unix_s)}</small> {one.text}
            </li>
          ))}
        </ul>
      )}
    </Card>
  );
}

const chosenTheme = () => localStorage.getItem("theme") ?? (matchMedia("(prefers-color-scheme: light)").matches ? "light" : "dark");

function App() {
  const { all, heard, now } = useOverview();
  const [only, setOnly] = useState<Use | null>(null);
  const old = (now - heard) / 1000;
  const count = (use: Use) => all?.machines.filter((one) => one.use === use).length ?? 0;
  const there = all?.machines.filter((one) => one.alive).length ?? 0;
  return (
    <>
      <header class="bar cell-bar">
        <div class="name">
          <span class="logo" />
          <h1>{t("title")}</h1>
        </div>
        <div class="uses" role="group" aria-label={t("machines")}>
          {all && (
            <button type="button" class="button chip" aria-pressed={only === null} onClick={() => setOnly(null)}>
              {t("reached", { there, all: all.machines.length })}
            </button>
          )}
          {all &&
            USES.filter((use) => count(use) > 0 || only === use).map((use) => (
              <button key={use} type="button" class="button chip" aria-pressed={only === use} onClick={() => setOnly(only === use ? null : use)}>
                <UseOf use={use} count={count(use)} />
              </button>
            ))}
        </div>
        <button
          type="button"
          class="button chip"
          aria-label={t("theme")}
          onClick={() => {
            const next = chosenTheme() === "dark" ? "light" : "dark";
            localStorage.setItem("theme", next);
            document.documentElement.dataset.theme = next;
          }}
        >
          <svg class="icon" viewBox="0 0 24 24" aria-hidden="true">
            <path d="M12 4a8 8 0 1 0 0 16zM12 4v16" />
          </svg>
        </button>
        <button
          type="button"
          class="button chip"
          onClick={() => {
            localStorage.setItem("language", language === "en" ? "de" : "en");
            location.reload();
          }}
        >
          <span lang={language === "en" ? "de" : "en"}>{language === "en" ? "DE" : "EN"}</span>
          <span class="hidden">{t("language")}</span>
        </button>
      </header>
      {all && old > 3 && (
        <p class="banner" role="alert">
          {t("stale", { age: span(old) })}
        </p>
      )}
      <main>
        {all ? (
          <div class="page cell-page">
            {all.alarms.length > 0 && <Alarms all={all} />}
            <Machines all={all} only={only} />
            <Queue all={all} />
            <UseOfTime all={all} />
            <History all={all} />
            <Refused all={all} />
          </div>
        ) : (
          <p class="muted page">{t("connecting")}</p>
        )}
      </main>
    </>
  );
}

document.documentElement.lang = language;
document.documentElement.dataset.theme = chosenTheme();
document.title = `isocnc · ${t("title")}`;
render(<App />, document.getElementById("app")!);
