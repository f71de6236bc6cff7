// @ts-check
// The page of a cell. Text is put in as text only, never as markup.

/** @typedef {Record<string, any>} Any */

const USES = ["running", "held", "idle", "alarm", "unknown"];
const HISTORY = 30;

/** @param {string} id */
const at = (id) => /** @type {HTMLElement} */ (document.getElementById(id));

/**
 * @param {string} tag
 * @param {Record<string, string>} [attributes]
 * @param {(Node | string)[]} children
 */
function make(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.append(...children);
  return made;
}

/** @param {number | null | undefined} s */
function span(s) {
  if (s === null || s === undefined) return "";
  const minutes = Math.round(s / 60);
  return s < 90 ? `${Math.round(s)} s` : minutes < 90 ? `${minutes} min` : `${(s / 3600).toFixed(1)} h`;
}

/** @param {number} unix_s */
const time = (unix_s) => new Date(unix_s * 1000).toLocaleString();

/**
 * @param {HTMLElement} place
 * @param {string[]} heads
 * @param {(Node | string)[][]} rows
 * @param {string} none
 */
function table(place, heads, rows, none) {
  if (rows.length === 0) return place.replaceChildren(make("p", { class: "none" }, none));
  const head = make("tr", {}, ...heads.map((text) => make("th", { scope: "col" }, text)));
  const body = rows.map((row) => make("tr", {}, ...row.map((cell) => make("td", {}, cell))));
  place.replaceChildren(make("table", {}, make("thead", {}, head), make("tbody", {}, ...body)));
}

/** @param {Any} machine */
function card(machine) {
  const { state } = machine;
  // Only addresses of the web: whatever else a control says is shown as a name.
  const link = /^https?:\/\//.test(machine.panel ?? "");
  const name = make("strong", {}, machine.name);
  const title = link ? make("a", { href: machine.panel, rel: "noreferrer" }, name) : name;
  const lines = [machine.class, machine.alive ? state.alarm ?? state.activity : `not reached for ${span(machine.silent_s)}`];
  if (machine.alive && state.program) lines.push(state.program);
  const made = make("div", { class: `machine ${machine.use}` }, title, " ", machine.use);
  for (const line of lines) if (line) made.append(make("div", {}, String(line)));
  if (machine.use === "running" && state.done_percent !== null) {
    made.append(make("progress", { max: "100", value: String(state.done_percent), "aria-label": `done: ${Math.round(state.done_percent)} %` }));
    if (state.remaining_s !== null) made.append(make("div", {}, `${span(state.remaining_s)} left`));
  }
  return made;
}

/** @param {Record<string, number>} times */
function bar(times) {
  const total = USES.reduce((sum, use) => sum + (times[use] ?? 0), 0);
  const text = USES.map((use) => `${use} ${Math.round((100 * (times[use] ?? 0)) / (total || 1))} %`).join(", ");
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  svg.setAttribute("role", "img");
  svg.setAttribute("aria-label", text);
  let x = 0;
  for (const use of USES) {
    const width = (100 * (times[use] ?? 0)) / (total || 1);
    const part = document.createElementNS("http://www.w3.org/2000/svg", "rect");
    part.setAttribute("class", `bar-${use}`);
    part.setAttribute("x", `${x}%`);
    part.setAttribute("width", `${width}%`);
    part.setAttribute("height", "18");
    svg.append(part);
    x += width;
  }
  return { svg, text };
}

/** @param {Any} all */
function show(all) {
  const there = all.machines.filter((/** @type {Any} */ machine) => machine.alive).length;
  const running = all.machines.filter((/** @type {Any} */ machine) => machine.use === "running").length;
  at("summary").textContent = `${there} of ${all.machines.length} machines reached, ${running} running, ${all.alarms.length} alarms`;
  at("machines").replaceChildren(...all.machines.map(card));
  table(at("alarms"), ["machine", "since", "what"], all.alarms.map((/** @type {Any} */ alarm) => [alarm.machine, time(alarm.unix_s), alarm.text]), "none");
  table(
    at("orders"),
    ["order", "program", "parts", "state", "why not elsewhere"],
    all.orders.map((/** @type {Any} */ order) => [
      String(order.id),
      order.program,
      `${order.completed} of ${order.count}` + (order.under_way ? `, ${order.under_way} under way` : "") + (order.failed ? `, ${order.failed} failed` : ""),
      `${order.state} ${order.note}`,
      order.state === "open" ? order.unfit.map((/** @type {Any} */ one) => `${one.machine}: ${one.why}`).join("; ") : "",
    ]),
    "nothing is ordered",
  );
  /** @type {Record<string, Record<string, number>>} */
  const times = {};
  for (const { machine, what, seconds } of all.times) {
    const of = (times[machine] ??= {});
    of[what] = (of[what] ?? 0) + seconds;
  }
  const rows = Object.entries(times).map(([machine, of]) => {
    const { svg, text } = bar(of);
    return [machine, svg, text];
  });
  table(at("use"), ["machine", "share of time", "in words"], rows, "nothing is known yet");
  table(
    at("history"),
    ["sent", "machine", "program", "order", "result", "took"],
    all.attempts.slice(0, HISTORY).map((/** @type {Any} */ one) => [
      time(one.sent_unix_s), one.machine, one.program, String(one.order ?? ""), `${one.phase} ${one.note}`, span(one.took_s),
    ]),
    "nothing was run",
  );
  table(at("refusals"), ["when", "who"], all.refusals.map((/** @type {Any} */ one) => [time(one.unix_s), one.text]), "nobody");
}

async function look() {
  try {
    const answer = await fetch("/overview", { cache: "no-store" });
    if (!answer.ok) throw new Error(String(answer.status));
    show(await answer.json());
    at("stale").hidden = true;
  } catch {
    at("stale").hidden = false;
  }
  setTimeout(look, document.hidden ? 10_000 : 1_000);
}

look();
