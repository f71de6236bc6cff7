// Buttons, values and pages that the machine file adds to the panel, in a real browser: node --test tests/panel/buttons.test.mjs
//
// ISOCNC, CHROMIUM and PICTURES as in browser.test.mjs.
import assert from "node:assert/strict";
import { mkdirSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { launch, missing, modules, start, until as untilOf } from "./start.mjs";

const skip = missing ? `there is no ${missing}` : false;
const pictures = process.env.PICTURES;
const port = 20_000 + ((process.pid + 29) % 20_000);
const url = `http://127.0.0.1:${port}/`;
let folder, control, browser, ask;
const troubles = [];
const until = (what, holds) => untilOf(ask, what, holds);
const id = (name) => `[data-testid="${name}"]`;

const OWN = `
[panel]
pages = "pages"

[[panel.button]]
name = "vise"
label = "Open vise"
mdi = ["M64 P0"]
lamp = "motion.digital-out-00"

[[panel.button]]
name = "park"
label = "Park"
mdi = ["G53 G0 Z0", "G53 G0 X0 Y0"]
ask = "Is the table clear?"

[[panel.button]]
name = "dip"
label = "Dip"
mdi = ["G91 G1 Z-{depth} F{feed}", "G0 Z{depth}", "G90"]
question = [
  { name = "depth", label = "Depth, mm", default = 1.5, min = 0.5, max = 5 },
  { name = "feed", label = "Feed, mm/min", default = 100, min = 1 },
]

[[panel.button]]
name = "warm-up"
label = "Warm up"
program = "warm-up.ngc"

[[panel.button]]
name = "reference"
label = "Reference run"
mdi = ["G53 G0 X5"]
role = "set-up"

[[panel.value]]
label = "X commanded"
pin = "joint.0.motor-pos-cmd"
unit = "mm"
decimals = 1

[[panel.value]]
label = "In position"
pin = "motion.in-position"

[[panel.value]]
label = "Line"
pin = "motion.program-line"

[[panel.value]]
label = "Load"
pin = "spindle.0.load"
unit = "%"
decimals = 0
`;

/** Keeps what is asked; takes the place of the control in what no other way brings about: another role, an older one, `window.answers` to a press. */
function listen(own) {
  window.asked = [];
  window.answers = [];
  const describes = new Set();
  const { send } = WebSocket.prototype;
  const { set } = Object.getOwnPropertyDescriptor(WebSocket.prototype, "onmessage");
  Object.defineProperty(WebSocket.prototype, "onmessage", {
    set(heard) {
      this.heard = heard;
      set.call(
        this,
        heard &&
          (({ data }) => {
            const message = JSON.parse(data);
            if (describes.delete(message.id)) for (const [key, value] of Object.entries(own)) message.result[key] = value ?? undefined;
            if (message.id && message.result?.role) message.result.role = window.role ?? message.result.role;
            heard({ data: JSON.stringify(message) });
          }),
      );
    },
  });
  WebSocket.prototype.send = function (text) {
    const { id, method, params } = JSON.parse(text);
    window.asked.push({ method, params });
    if (method === "machine.describe") describes.add(id);
    const answer = method === "button.press" && window.answers.shift();
    if (!answer) return send.call(this, text);
    setTimeout(() => this.heard({ data: JSON.stringify({ jsonrpc: "2.0", id, ...answer }) }), 20);
  };
}

async function open({ width = 1280, height = 800, language = "en", own = {}, role, hash = "#/operate" } = {}) {
  const page = await (await browser.createBrowserContext()).newPage();
  await page.setViewport({ width, height });
  page.on("console", (message) => message.type() === "error" && troubles.push(message.text()));
  page.on("pageerror", (error) => troubles.push(error.stack));
  await page.evaluateOnNewDocument(listen, own);
  await page.evaluateOnNewDocument((language, role) => {
    localStorage.setItem("language", language);
    window.role = role;
  }, language, role);
  await page.goto(url + hash);
  await page.waitForFunction(() => document.querySelector("[data-testid=state]")?.dataset.state);
  return page;
}

const click = (page, name) => page.waitForSelector(id(name)).then(() => page.$eval(id(name), (element) => element.click()));
const text = (page, name) => page.$eval(id(name), (element) => element.textContent);
const gone = (page, name) => page.waitForFunction((name) => !document.querySelector(`[data-testid="${name}"]`), {}, name);
const fill = async (page, name, value) => {
  await page.waitForSelector(id(name));
  await page.$eval(id(name), (input) => input.select());
  await page.type(id(name), value);
};
const pressed = (page) => page.evaluate(() => window.asked.filter(({ method }) => method === "button.press").map(({ params }) => [params.name, params.answers]));
const picture = async (page, name) => {
  if (pictures) await page.screenshot({ path: join(pictures, `${name}.png`) });
};
const said = (page, pattern) => page.waitForFunction((pattern) => [...document.querySelectorAll("[data-testid=toast]")].some((toast) => new RegExp(pattern).test(toast.textContent)), {}, pattern);

const rest = () => until("rest", async () => ((now) => now.state === "ready" && now.activity === "idle")(await ask("status")));

before(async () => {
  if (skip) return;
  if (pictures) mkdirSync(pictures, { recursive: true });
  ({ folder, control, ask } = await start(port, (folder) => {
    mkdirSync(join(folder, "pages"));
    for (const name of ["Shift report", "fixture"]) writeFileSync(join(folder, `pages/${name}.html`), `<!doctype html><meta charset="utf-8"><title>${name}</title><h1>${name}</h1>`);
    return OWN;
  }));
  await until("the network", () => ask("status").then(({ state }) => state === "disabled", () => false));
  await ask("on");
  await until("on", async () => (await ask("status")).state === "ready");
  await ask("home");
  await until("homed", async () => ((now) => now.homed.length === 3 && now.activity === "idle")(await ask("status")));
  browser = await launch();
});

after(async () => {
  await browser?.close();
  control?.removeAllListeners("exit");
  control?.kill("SIGINT");
  if (folder) rmSync(folder, { recursive: true });
});

test("a button without a question is pressed once, however often it is tapped; one with a question shows its lines first", { skip, timeout: 60_000 }, async () => {
  const page = await open();
  await click(page, "own-vise");
  await click(page, "own-vise");
  assert.deepEqual(await pressed(page), [["vise", {}]]);
  // What it runs lights its lamp.
  await page.waitForFunction(() => document.querySelector("[data-testid=own-vise]").getAttribute("aria-pressed") === "true");
  await picture(page, "own-lit");
  await rest();
  await click(page, "own-park");
  await page.waitForSelector(id("own-dialogue"));
  assert.match(await text(page, "own-dialogue"), /Is the table clear\?.*G53 G0 Z0\nG53 G0 X0 Y0/);
  await picture(page, "own-park");
  // A key that someone is just pressing is no answer.
  await page.keyboard.press("Enter");
  await gone(page, "own-dialogue");
  assert.equal((await pressed(page)).length, 1);
  await click(page, "own-park");
  await click(page, "own-yes");
  await gone(page, "own-dialogue");
  assert.deepEqual((await pressed(page)).at(-1), ["park", {}]);
  await until("it is parked", async () => (await ask("status")).position_mm.slice(0, 3).every((value) => Math.abs(value) < 0.01));
  await rest();
  await page.close();
});

test("answers are checked beside their fields, shown in the lines, and checked again by the control", { skip, timeout: 60_000 }, async () => {
  const page = await open();
  await click(page, "own-dip");
  await page.waitForSelector(id("own-dialogue"));
  assert.equal(await text(page, "own-lines"), "G91 G1 Z-1.5 F100\nG0 Z1.5\nG90");
  const disabled = () => page.$eval(id("own-yes"), (button) => button.disabled);
  for (const [value, why] of [["9", "must be from 0.5 to 5"], ["0,2", "must be from 0.5 to 5"], ["x", "not a number"]]) {
    await fill(page, "own-answer-depth", value);
    assert.equal(await text(page, "own-wrong-depth"), why);
    assert.ok(await disabled());
    await page.keyboard.press("Enter");
  }
  assert.equal(await text(page, "own-lines"), "G91 G1 Z-{depth} F100\nG0 Z{depth}\nG90");
  await fill(page, "own-answer-feed", "0");
  assert.equal(await text(page, "own-wrong-feed"), "must be at least 1");
  await picture(page, "own-wrong");
  await fill(page, "own-answer-feed", "250");
  await fill(page, "own-answer-depth", "2,5");
  assert.equal(await text(page, "own-lines"), "G91 G1 Z-2.5 F250\nG0 Z2.5\nG90");
  assert.deepEqual(await pressed(page), []);
  await page.evaluate(() => window.answers.push({ error: { code: -32602, message: "depth: below the table", data: { field: "depth" } } }, { error: { code: -32000, message: "drives are off" } }));
  await page.keyboard.press("Enter");
  await page.waitForFunction(() => document.querySelector("[data-testid=own-wrong-depth]")?.textContent === "depth: below the table");
  // Another refusal is a notice, and the answers stay.
  await click(page, "own-yes");
  await said(page, "^drives are off");
  assert.equal(await page.$(id("own-wrong-depth")), null);
  await click(page, "own-yes");
  await gone(page, "own-dialogue");
  assert.deepEqual((await pressed(page)).at(-1), ["dip", { depth: 2.5, feed: 250 }]);
  await until("it dips", async () => (await ask("status")).mdi.length > 0 || (await ask("status")).position_mm[2] < -1);
  await rest();
  await page.close();
});

test("a button with a program says what was loaded, and that only Start starts it", { skip, timeout: 60_000 }, async () => {
  const page = await open();
  await page.waitForSelector(id("own-warm-up"));
  await click(page, "own-warm-up");
  await said(page, "warm-up\\.ngc: ");
  // Two taps in 0.6 s are one.
  await new Promise((wake) => setTimeout(wake, 700));
  writeFileSync(join(folder, "state/programs/warm-up.ngc"), "G21 G90 F600\nG0 X0\nG1 X10\nM2\n");
  await click(page, "own-warm-up");
  await said(page, "^warm-up\\.ngc is loaded, planned time 0:0\\d\\. Start starts it\\.");
  assert.match((await ask("status")).program.name, /warm-up\.ngc$/);
  assert.equal((await ask("status")).activity, "idle");
  await page.close();
});

test("a button of the role set-up is dim for others, and says why", { skip, timeout: 60_000 }, async () => {
  const page = await open({ role: "operate" });
  await page.waitForFunction(() => document.querySelector("[data-testid=own-reference]")?.title === "This needs the role set-up.");
  assert.ok(await page.$eval(id("own-reference"), (button) => button.classList.contains("dim")));
  assert.ok(!(await page.$eval(id("own-park"), (button) => button.classList.contains("dim"))));
  await click(page, "own-reference");
  await said(page, "This needs the role set-up");
  assert.deepEqual(await pressed(page), []);
  const other = await open({ role: "set-up" });
  await other.waitForSelector(id("own-reference"));
  assert.ok(!(await other.$eval(id("own-reference"), (button) => button.classList.contains("dim"))));
  await other.close();
  await page.close();
});

test("a lamp lights its button, values follow by one question, and a pin that is unknown says so", { skip, timeout: 60_000 }, async () => {
  const page = await open();
  await page.waitForFunction(() => document.querySelector('[data-testid="own-value-joint.0.motor-pos-cmd"]')?.textContent === "0.0 mm");
  assert.equal(await text(page, "own-value-spindle.0.load"), "there is no pin spindle.0.load");
  assert.equal((await text(page, "own-value-motion.program-line")).trim(), "0");
  assert.match(await text(page, "own-value-motion.in-position"), /on/);
  const lit = () => page.$eval(id("own-vise"), (button) => button.getAttribute("aria-pressed"));
  assert.equal(await lit(), "true");
  await ask("mdi", { line: "M65 P0" });
  await page.waitForFunction(() => document.querySelector("[data-testid=own-vise]").getAttribute("aria-pressed") === "false");
  await rest();
  await ask("mdi", { line: "G53 G1 X12.34 F3000" });
  await page.waitForFunction(() => document.querySelector('[data-testid="own-value-joint.0.motor-pos-cmd"]').textContent === "12.3 mm");
  await rest();
  const questions = () => page.evaluate(() => window.asked.filter(({ method }) => method === "hal.values").length);
  const before = await questions();
  await new Promise((wake) => setTimeout(wake, 2000));
  const during = (await questions()) - before;
  assert.ok(during >= 4 && during <= 20, `${during} questions in 2 s`);
  assert.deepEqual(await page.evaluate(() => window.asked.filter(({ method }) => method === "hal.values").at(-1).params.pins), ["motion.digital-out-00", "joint.0.motor-pos-cmd", "motion.in-position", "motion.program-line"]);
  // Nobody sees it: nothing is asked.
  await page.evaluate(() => {
    Object.defineProperty(document, "visibilityState", { value: "hidden", configurable: true });
    document.dispatchEvent(new Event("visibilitychange"));
  });
  await new Promise((wake) => setTimeout(wake, 500));
  const hidden = await questions();
  await new Promise((wake) => setTimeout(wake, 1500));
  assert.equal(await questions(), hidden);
  await page.close();
});

test("nothing is added where the machine file adds nothing, and where the control is older", { skip, timeout: 60_000 }, async () => {
  for (const own of [{ buttons: null, values: null, pages: null }, { buttons: [], values: [], pages: [] }]) {
    const page = await open({ own });
    await page.waitForSelector(id("dro-x"));
    await new Promise((wake) => setTimeout(wake, 500));
    assert.equal(await page.$(".own"), null);
    await page.evaluate(() => (location.hash = "#/machine"));
    await page.waitForSelector(id("journal"));
    assert.equal(await page.$(id("own-pages")), null);
    assert.deepEqual(await page.evaluate(() => window.asked.filter(({ method }) => method === "hal.values")), []);
    await page.close();
  }
});

test("pages of the user are links on the page Machine", { skip, timeout: 60_000 }, async () => {
  const page = await open({ hash: "#/machine" });
  await page.waitForSelector(id("own-pages"));
  const links = await page.$$eval(`${id("own-pages")} a`, (all) => all.map((link) => [link.textContent, link.getAttribute("href"), link.target]));
  assert.deepEqual(links, [["Shift report", "own/Shift%20report.html", ""], ["fixture", "own/fixture.html", ""]]);
  await picture(page, "own-pages");
  await Promise.all([page.waitForNavigation(), page.$eval(`${id("own-pages")} a`, (link) => link.click())]);
  assert.equal(await page.$eval("h1", (title) => title.textContent), "Shift report");
  await page.close();
});

test("three sizes, two languages: axe finds nothing serious, fingers hit", { skip, timeout: 180_000 }, async () => {
  const all = [];
  for (const [width, height, language] of [[1280, 800, "en"], [768, 1024, "de"], [390, 844, "en"], [390, 844, "de"]]) {
    const page = await open({ width, height, language });
    if (width < 1100) await click(page, "part-own");
    await page.waitForSelector(id("own-dip"));
    const least = await page.$$eval(".pad", (pads) => Math.min(...pads.map((pad) => pad.getBoundingClientRect().height)));
    assert.ok(least >= 80, `${least}`);
    for (const part of ["", "-dialogue"]) {
      if (part) await click(page, "own-dip");
      await picture(page, `own${part}-${width}-${language}`);
      await page.evaluate(readFileSync(join(modules, "axe-core/axe.min.js"), "utf8"));
      const found = await page.evaluate(() => axe.run(document, { runOnly: ["wcag2a", "wcag2aa"] }).then(({ violations }) => violations.filter(({ impact }) => ["serious", "critical"].includes(impact)).map(({ id, nodes }) => `${id}: ${nodes.map(({ html }) => html.slice(0, 160)).join(" | ")}`)));
      const small = await page.evaluate(() =>
        [...document.querySelectorAll("button, a.button")]
          .filter((one) => one.offsetParent)
          .map((one) => ({ html: one.outerHTML.slice(0, 120), ...one.getBoundingClientRect().toJSON() }))
          .filter(({ width, height, left, right }) => width < 43.5 || height < 43.5 || left < -1 || right > innerWidth + 1)
          .map(({ html }) => html),
      );
      all.push(...[...found, ...small].map((one) => `${width} ${language}${part}: ${one}`));
    }
    await page.close();
  }
  assert.deepEqual(all, []);
});

test("nothing went wrong in any page", { skip }, () => {
  assert.deepEqual(troubles, []);
});
