// The page of `isocnc init --panel` in a real browser, against a server that takes nothing but what docs/panel-api.md says:
// node --test tests/panel/init.test.mjs
//
// CHROMIUM as in browser.test.mjs. PICTURES names a folder for pictures, to be looked at.
import assert from "node:assert/strict";
import { existsSync, mkdirSync, readFileSync } from "node:fs";
import { createServer } from "node:http";
import { extname, join } from "node:path";
import { after, afterEach, before, test } from "node:test";
import { chromium, launch, modules, root } from "./start.mjs";

const lacks = !chromium ? "Chromium" : !existsSync(modules) ? "npm ci in crates/panel/web" : "";
const skip = lacks ? `there is no ${lacks}` : false;
const pictures = process.env.PICTURES;
const dist = join(root, "crates/panel/dist");
const KINDS = { ".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml", ".txt": "text/plain" };
const POLICY = "default-src 'self'; object-src 'none'; base-uri 'none'; frame-ancestors 'none'; form-action 'self'; img-src 'self' data: blob:";
const FILE = "/etc/isocnc/mill.toml";

/** Nodes of a bus: two drives with a terminal between them. */
const NODES = [
  { id: 1, name: "CS3E-D507E", is_drive: true },
  { id: 2, name: null, is_drive: false },
  { id: 3, name: null, is_drive: true },
];

/** What the server is like; each test begins with this. */
const USUAL = {
  offer: {
    file: FILE,
    exists: false,
    name: "mill",
    real_time: true,
    interfaces: [
      { name: "wlan0", up: true, wireless: true },
      { name: "eth0", up: false, wireless: false },
      { name: "eth1", up: true, wireless: false },
    ],
    cycle_us: 1000,
  },
  scan: () => ({ bus: "EtherCAT", nodes: NODES }),
  /** A refusal of answers that are of the right types, in words. */
  refuses: () => null,
  slow_ms: 0,
  /** A token without which nothing is said. */
  token: null,
  /** The control after `start`: it is there after so many ms; null: it never is. */
  control_ms: 300,
};
let server, url, browser, is;

class Refusal extends Error {
  constructor(status, message) {
    super(message);
    this.status = status;
  }
}

const isText = (value) => typeof value === "string" && value !== "";
const isId = (value) => Number.isInteger(value) && value >= 1 && value <= 255;
const TYPES = {
  name: isText,
  interface: isText,
  scan: (value) => typeof value === "boolean",
  axes: (value) => /^[XYZABCUVW]+$/.test(value),
  drives: (value) => Array.isArray(value) && value.every(isId),
  io: (value) => Array.isArray(value) && value.every(isId),
  scales: (value, { axes }) => value.length === axes.length && value.every((one) => /^[1-9]\d*\/[1-9]\d*$/.test(one)),
  travels: (value, { axes }) => value.length === axes.length && value.every((one) => /^-?\d+(\.\d+)?:-?\d+(\.\d+)?$/.test(one) && Number(one.split(":")[0]) < Number(one.split(":")[1])),
  speeds: (value, { axes }) => value.length === axes.length && value.every((one) => /^\d+(\.\d+)?$/.test(one) && Number(one) > 0),
  to_try: (value) => typeof value === "boolean",
  cycle_us: (value) => value === USUAL.offer.cycle_us,
};

/** The machine file that answers make. */
function machineFile(answers) {
  const broken = (what) => is.broken.push(`${what} of ${JSON.stringify(answers)}`);
  assert.deepEqual(Object.keys(answers).sort(), Object.keys(TYPES).sort());
  for (const [key, right] of Object.entries(TYPES)) if (!right(answers[key], answers)) broken(key);
  if (answers.scan) {
    if (is.scanned?.interface !== answers.interface) throw new Refusal(422, `${answers.interface} has not been scanned`);
    const ids = (drives) => is.scanned.nodes.filter(({ is_drive }) => is_drive === drives).map(({ id }) => id);
    if (JSON.stringify([ids(true), ids(false)]) !== JSON.stringify([answers.drives, answers.io])) broken("nodes");
  }
  if (answers.drives.length !== answers.axes.length) broken("axes");
  const why = is.refuses(answers);
  if (why) throw new Refusal(422, why);
  return `# Written by isocnc init\n[machine]\nname = "${answers.name}"\n\n${[...answers.axes].map((letter, at) => `[[joint]] # ${letter}\ncounts_per_unit = [${answers.scales[at].replace("/", ", ")}]\ntravel_mm = [${answers.travels[at].replace(":", ", ")}]\n`).join("\n")}`;
}

const ORDERS = {
  async scan(body) {
    if (JSON.stringify(Object.keys(body)) !== '["interface"]' || !isText(body.interface)) is.broken.push(`scan of ${JSON.stringify(body)}`);
    const found = is.scan(body.interface);
    is.scanned = { ...found, interface: body.interface };
    return [200, found];
  },
  check: async (answers) => [200, { text: machineFile(answers) }],
  async write({ replace, ...answers }) {
    if (typeof replace !== "boolean") is.broken.push(`replace ${replace}`);
    const text = machineFile(answers);
    if (is.offer.exists && !replace) throw new Refusal(409, "the file is there already");
    is.written.push({ text, replace });
    return [200, { written: FILE }];
  },
  async start(body) {
    assert.deepEqual(body, {});
    if (is.written.length === 0) throw new Refusal(409, "no machine file is written yet");
    is.started = Date.now();
    return [202, {}];
  },
};

async function answer(request) {
  const { pathname } = new URL(request.url, url);
  const is_up = is.started && is.control_ms !== null && Date.now() - is.started > is.control_ms;
  if (!/^\/init(\/|$)/.test(pathname)) {
    const name = pathname === "/" ? (is_up ? "index.html" : "init.html") : pathname.slice(1);
    if (!existsSync(join(dist, name))) throw new Refusal(404, "there is no such page");
    return [200, readFileSync(join(dist, name)), KINDS[extname(name)]];
  }
  if (is_up) throw new Refusal(404, "a control runs here");
  if (is.token && request.headers.authorization !== `Bearer ${is.token}`) throw new Refusal(401, "log in");
  if (request.method === "GET" && pathname === "/init") return [200, is.offer];
  const order = ORDERS[pathname.slice("/init/".length)];
  if (request.method !== "POST" || !order) throw new Refusal(404, `no ${request.method} ${pathname}`);
  let text = "";
  for await (const part of request) text += part;
  is.asked.push(pathname);
  await new Promise((wake) => setTimeout(wake, is.slow_ms));
  return order(JSON.parse(text));
}

before(async () => {
  if (skip) return;
  if (pictures) mkdirSync(pictures, { recursive: true });
  server = createServer(async (request, response) => {
    // Where nobody listens, a connection ends at once.
    if (is.away || (is.started && is.control_ms === null)) return request.socket.destroy();
    const [status, body, kind = "application/json"] = await answer(request).catch((error) => {
      if (!(error instanceof Refusal)) is.broken.push(error.stack);
      return [error.status ?? 500, { error: error.message }];
    });
    response.writeHead(status, { "Content-Type": kind, "Content-Security-Policy": POLICY, "Cache-Control": "no-cache" });
    response.end(Buffer.isBuffer(body) ? body : JSON.stringify(body));
  });
  await new Promise((ready) => server.listen(0, "127.0.0.1", ready));
  url = `http://127.0.0.1:${server.address().port}/`;
  browser = await launch();
});

after(async () => {
  await browser?.close();
  server?.closeAllConnections();
  server?.close();
});

const troubles = [];
afterEach(() => {
  if (skip) return;
  assert.deepEqual(is?.broken ?? [], [], "the server was asked what it does not know");
  assert.deepEqual(troubles.splice(0), []);
});

const id = (name) => `[data-testid="${name}"]`;

async function open(change = {}, { width = 1280, height = 800, language = "en", theme = "dark", hash = "" } = {}) {
  is = { ...structuredClone({ ...USUAL, scan: undefined, refuses: undefined }), scan: USUAL.scan, refuses: USUAL.refuses, ...change, asked: [], written: [], broken: [] };
  const page = await (await browser.createBrowserContext()).newPage();
  await page.setViewport({ width, height });
  page.on("pageerror", (error) => troubles.push(error.stack));
  page.on("request", (request) => request.url().startsWith(url) || troubles.push(`fetches ${request.url()}`));
  await page.evaluateOnNewDocument(
    (language, theme) => {
      localStorage.setItem("language", localStorage.getItem("language") ?? language);
      localStorage.setItem("theme", theme);
      document.addEventListener("securitypolicyviolation", (event) => {
        throw new Error(`policy: ${event.violatedDirective} ${event.blockedURI}`);
      });
    },
    language,
    theme,
  );
  await page.goto(url + hash);
  await page.waitForSelector("h1");
  return page;
}

const text = (page, name) => page.$eval(id(name), (element) => element.textContent);
const click = (page, name) => page.waitForSelector(id(name)).then(() => page.$eval(id(name), (element) => element.click()));
const said = (page, name, pattern) =>
  page
    .waitForFunction((name, pattern) => new RegExp(pattern).test(document.querySelector(`[data-testid="${name}"]`)?.textContent), { timeout: 10_000 }, name, pattern)
    .catch(async () => assert.fail(`${name} does not say ${pattern}: ${await page.$eval("#app", (app) => app.textContent)}`));
const gone = (page, name) => page.waitForFunction((name) => !document.querySelector(`[data-testid="${name}"]`), {}, name);
const enabled = (page, name) => page.waitForFunction((name) => document.querySelector(`[data-testid="${name}"]`)?.disabled === false, { timeout: 10_000 }, name);
const isDisabled = (page, name) => page.$eval(id(name), (element) => element.disabled);
const fill = async (page, name, value) => {
  await page.$eval(id(name), (input) => {
    input.value = "";
    input.dispatchEvent(new Event("input", { bubbles: true }));
  });
  await page.type(id(name), value);
};
const value = (page, name) => page.$eval(id(name), (input) => input.value);
const isDone = (page, number) => page.$eval(id(`step-${number}`), (step) => step.classList.contains("done"));
const picture = async (page, name) => {
  if (!pictures) return;
  await page.evaluate(() => scrollTo(0, 0));
  await page.screenshot({ path: join(pictures, `init-${name}.png`), fullPage: true });
};

test("from a bare PC to a control: scan, axes, file, start", { skip, timeout: 60_000 }, async () => {
  const page = await open();
  await page.waitForSelector(id("step-5"));
  assert.equal(await value(page, "init-name"), "mill");
  assert.ok(await page.$eval(id("init-for-machine"), ({ checked }) => checked), "this PC has real time");
  // The best port is proposed: connected, and no Wi-Fi.
  assert.ok(await page.$eval(id("init-interface-eth1"), ({ checked }) => checked));
  assert.match(await text(page, "step-2"), /eth0not connected.*eth1connected.*wlan0Wi-Fi: not suitable/);
  assert.equal(await text(page, "init-scan"), "Scan eth1");
  assert.ok(await isDisabled(page, "init-start"));
  assert.equal(await page.$(id("init-write")), null);
  assert.deepEqual(is.asked, [], "nothing is asked by itself");

  is.slow_ms = 600;
  await click(page, "init-scan");
  await said(page, "init-found", "Scanning eth1");
  await click(page, "init-scan");
  await said(page, "init-found", "EtherCAT: drives 2, inputs and outputs 1");
  is.slow_ms = 0;
  assert.equal(is.asked.filter((what) => what === "/init/scan").length, 1, "once is enough");
  assert.match(await text(page, "init-found"), /Drive CS3E-D507Enode 1.*Inputs and outputs no namenode 2.*Drive no namenode 3/);

  // Usual values are filled in, for as many axes as there are drives; Z has its own.
  assert.deepEqual(await page.$$eval(".axis legend", (all) => all.map((one) => one.textContent.trim())), ["Drive 1 CS3E-D507E", "Drive 3"]);
  for (const [name, usual] of Object.entries({ letter: "X", counts: "10000", units: "1", lower: "-5", upper: "205", speed: "1000" })) assert.equal(await value(page, `init-${name}-0`), usual);
  await page.select(id("init-letter-1"), "Z");
  assert.deepEqual([await value(page, "init-lower-1"), await value(page, "init-upper-1")], ["-105", "5"]);
  await fill(page, "init-units-0", "2,5");
  await fill(page, "init-upper-0", "310.5");
  await fill(page, "init-name", "my mill");
  await said(page, "init-text", String.raw`name = "my mill"[^]*= \[100000, 25\]\s+travel_mm = \[-5, 310.5\]\s+\[\[joint\]\] # Z\s+counts_per_unit = \[10000, 1\]\s+travel_mm = \[-105, 5\]`);
  assert.deepEqual(await Promise.all([1, 2, 3, 4].map((step) => isDone(page, step))), [true, true, true, false]);
  assert.equal(is.written.length, 0);

  await enabled(page, "init-write");
  assert.equal(await text(page, "init-write"), `Write ${FILE}`);
  await click(page, "init-write");
  await said(page, "init-written", "mill.toml is written");
  assert.equal(is.written.length, 1);
  assert.equal(is.written[0].replace, false);
  await picture(page, "written");

  // What is changed later has to be written, too; another language forgets nothing.
  await enabled(page, "init-start");
  await fill(page, "init-speed-1", "900");
  await said(page, "init-written", "changed after");
  assert.ok(await isDisabled(page, "init-start"));
  await fill(page, "init-speed-1", "1000");
  await enabled(page, "init-start");
  await click(page, "language");
  await page.waitForFunction(() => document.documentElement.lang === "de");
  await said(page, "init-text", "my mill");
  assert.equal(await value(page, "init-units-0"), "2,5");
  assert.match(await text(page, "step-5"), /Nichts bewegt sich, bevor jemand die Antriebe einschaltet/);

  await enabled(page, "init-start");
  await click(page, "init-start");
  await said(page, "init-starting", "startet");
  await page.waitForFunction(() => document.querySelector("script[type=module]").src.endsWith("/app.js"), { timeout: 10_000 });
  assert.equal(await page.evaluate(() => location.pathname + location.hash), "/#/setup");
  await page.browserContext().close();
});

test("what is refused is told in its step, and nothing that was typed is lost", { skip, timeout: 60_000 }, async () => {
  const page = await open({ offer: { ...USUAL.offer, real_time: false } });
  await page.waitForSelector(id("step-5"));
  // Without real time it is to try; a machine is warned of.
  assert.ok(await page.$eval(id("init-for-try"), ({ checked }) => checked));
  await click(page, "init-for-machine");
  await said(page, "step-1", "the control will refuse to run here");
  await fill(page, "init-name", "lathe");

  is.scan = () => {
    throw new Refusal(502, "eth1: no frame came back: is a cable plugged in?");
  };
  await click(page, "init-scan");
  await said(page, "init-scan-failed", "no frame came back");
  assert.ok(await page.$(`${id("step-2")} ${id("init-scan-failed")}`));
  await picture(page, "scan-failed");
  is.scan = () => ({ bus: "POWERLINK", nodes: [{ id: 20, name: "io", is_drive: false }] });
  await click(page, "init-scan");
  await said(page, "step-2", "POWERLINK: drives 0, inputs and outputs 1.*No drive has answered");
  assert.equal(await isDone(page, 2), false);
  await said(page, "step-4", "once the drives of step 2 are known");
  is.scan = USUAL.scan;
  await click(page, "init-scan");
  await said(page, "init-text", 'name = "lathe"');
  // Another port has not been scanned.
  await click(page, "init-interface-eth0");
  await gone(page, "init-text");
  await click(page, "init-interface-eth1");
  await said(page, "init-text", 'name = "lathe"');

  // What no server has to look at.
  for (const [name, wrong, right, words] of [
    ["counts-0", "1e4", "10000", "whole number"],
    ["units-0", "0", "1", "above 0"],
    ["lower-0", "x", "-5", "not a number"],
    ["upper-0", "-5", "205", "above the lower end"],
    ["speed-1", "-1", "1000", "above 0"],
  ]) {
    await fill(page, `init-${name}`, wrong);
    await said(page, `init-${name}-wrong`, words);
    assert.equal(await isDone(page, 3), false);
    assert.equal(await page.$(id("init-write")), null);
    if (name === "upper-0") await picture(page, "wrong");
    await fill(page, `init-${name}`, right);
    await gone(page, `init-${name}-wrong`);
  }
  await page.select(id("init-letter-1"), "X");
  await said(page, "init-letter-1-wrong", "X is taken already");
  await page.select(id("init-letter-1"), "A");
  assert.match(await text(page, "step-3"), /Distance, °.*Max speed, °\/min/);
  await enabled(page, "init-write");

  // What the server says, in its words; the last word counts.
  is.refuses = ({ name }) => (name.includes(" ") ? `name: "${name}" has a blank` : null);
  is.slow_ms = 300;
  await fill(page, "init-name", "my lathe");
  await said(page, "init-check-failed", "has a blank");
  assert.ok(await isDisabled(page, "init-write"));
  await fill(page, "init-name", "lathe");
  await gone(page, "init-check-failed");
  await enabled(page, "init-write");
  is.slow_ms = 0;
  is.refuses = () => `${FILE}: cannot be written: Permission denied`;
  await click(page, "init-write");
  await said(page, "init-write-failed", "Permission denied");
  assert.equal(is.written.length, 0);
  is.refuses = USUAL.refuses;

  // It goes away, and comes back without what it has scanned.
  is.away = true;
  await click(page, "init-write");
  await said(page, "init-write-failed", "still runs in its terminal");
  await fill(page, "init-name", "lathe2");
  await said(page, "init-check-failed", "still runs in its terminal");
  is.away = false;
  is.scanned = null;
  await click(page, "init-check");
  await said(page, "init-check-failed", "eth1 has not been scanned");
  await click(page, "init-scan");
  await said(page, "init-text", 'name = "lathe2"');
  await enabled(page, "init-write");
  for (const [name, kept] of [["init-name", "lathe2"], ["init-letter-1", "A"], ["init-upper-0", "205"]]) assert.equal(await value(page, name), kept);
  await page.browserContext().close();
});

test("a file that is there is replaced only when someone has said so", { skip, timeout: 60_000 }, async () => {
  const page = await open({ offer: { ...USUAL.offer, exists: true } });
  await click(page, "init-scan");
  await enabled(page, "init-write");
  await page.focus(id("init-write"));
  await page.keyboard.press("Enter");
  await said(page, "init-replace-dialogue", "is there already");
  await picture(page, "exists");
  // Enter once more answers nothing; who has gone back is where he was.
  await page.keyboard.press("Enter");
  await page.keyboard.press("Escape");
  await gone(page, "init-replace-dialogue");
  await page.waitForFunction(() => document.activeElement.dataset.testid === "init-write", { timeout: 5000 });
  await click(page, "init-write");
  await click(page, "init-keep");
  await gone(page, "init-replace-dialogue");
  assert.equal(is.written.length, 0);
  assert.ok(await isDisabled(page, "init-start"));
  await click(page, "init-write");
  await click(page, "init-replace");
  await said(page, "init-written", "is written");
  assert.deepEqual(is.written.map(({ replace }) => replace), [true]);
  await enabled(page, "init-start");
  await page.browserContext().close();
});

test("without a bus the nodes are typed by hand", { skip, timeout: 60_000 }, async () => {
  const page = await open({ offer: { ...USUAL.offer, interfaces: [] } });
  await click(page, "init-nodes-hand");
  // A PC without a port that is known: its name is typed.
  assert.equal(await isDone(page, 3), false);
  is.offer.interfaces = [{ name: "wlan0", up: true, wireless: true }];
  await fill(page, "init-interface", "enp3s0");
  await fill(page, "init-drives", "1; 2 x");
  await said(page, "init-drives-wrong", "whole numbers from 1 to 239");
  await fill(page, "init-drives", "4, 5");
  await fill(page, "init-io", "240");
  await said(page, "init-io-wrong", "whole numbers");
  await fill(page, "init-io", "20");
  await enabled(page, "init-write");
  await click(page, "init-write");
  await said(page, "init-written", "is written");
  assert.match(is.written[0].text, /# X[^]*# Y/);
  assert.deepEqual([...new Set(is.asked)], ["/init/check", "/init/write"]);
  // A port that is plugged in meanwhile.
  await click(page, "init-look");
  await page.waitForSelector(id("init-interface-wlan0"));
  await page.browserContext().close();
});

test("a control that never comes is told, with what to look at; one that comes late is found", { skip, timeout: 90_000 }, async () => {
  const page = await open({ control_ms: null });
  await click(page, "init-scan");
  await enabled(page, "init-write");
  await click(page, "init-write");
  await enabled(page, "init-start");
  await click(page, "init-start");
  await said(page, "init-starting", "is starting");
  await click(page, "init-start");
  await new Promise((wake) => setTimeout(wake, 27_000));
  assert.equal(is.asked.filter((what) => what === "/init/start").length, 1, "once is enough");
  assert.equal(await page.$(id("init-late")), null, "not before its time");
  await said(page, "init-late", "has not come up in 30 s");
  assert.match(await text(page, "step-5"), /isocnc run \/etc\/isocnc\/mill\.toml/);
  await picture(page, "late");
  // What cannot be started again says so, and the page goes on looking.
  await click(page, "init-start");
  await said(page, "init-start-failed", "No answer");
  is.control_ms = 0;
  await page.waitForFunction(() => location.hash === "#/setup" && document.querySelector("script[type=module]").src.endsWith("/app.js"), { timeout: 10_000 });
  await page.browserContext().close();
});

test("a start that is refused, a server that is away, one that asks for a token, and one that is none", { skip, timeout: 60_000 }, async (t) => {
  await t.test("refused", async () => {
    const page = await open();
    await click(page, "init-scan");
    await enabled(page, "init-write");
    await click(page, "init-write");
    await enabled(page, "init-start");
    is.written = [];
    await click(page, "init-start");
    await said(page, "init-start-failed", "no machine file is written yet");
    // It is written once more, and begins.
    await click(page, "init-write");
    await enabled(page, "init-start");
    await click(page, "init-start");
    await said(page, "init-starting", "is starting");
    await page.browserContext().close();
  });
  await t.test("a token", async () => {
    const page = await open({ token: "s3cret" });
    await page.waitForSelector(id("token"));
    await picture(page, "token");
    await fill(page, "token", "other");
    await click(page, "log-in");
    await page.waitForFunction(() => /invalid/.test(document.querySelector("#app")?.textContent));
    await fill(page, "token", "s3cret");
    await click(page, "log-in");
    await page.waitForSelector(id("step-1"));
    await click(page, "init-scan");
    await enabled(page, "init-write");
    const linked = await open({ token: "s3cret" }, { hash: "#token=s3cret" });
    await linked.waitForSelector(id("step-1"));
    assert.equal(await linked.evaluate(() => location.hash), "");
    for (const one of [page, linked]) await one.browserContext().close();
  });
  await t.test("away as the page comes up", async () => {
    const page = await open();
    is.away = true;
    await page.evaluate(() => sessionStorage.clear());
    await page.setRequestInterception(true);
    // The page itself comes from the browser's own memory.
    page.on("request", (request) => (request.url() === `${url}init` ? request.continue() : request.respond(local(request.url()))));
    await page.reload();
    await said(page, "init-failed", "No answer");
    is.away = false;
    await click(page, "init-again");
    await page.waitForSelector(id("step-1"));
    await page.browserContext().close();
  });
  await t.test("a control that runs already", async () => {
    const page = await open();
    is.started = 1;
    await page.goto(`${url}init.html`);
    await page.waitForFunction(() => location.pathname === "/" && location.hash === "#/setup");
    await page.browserContext().close();
  });
});

const local = (address) => {
  const name = new URL(address).pathname.slice(1) || "init.html";
  return { status: 200, contentType: KINDS[extname(name)], body: readFileSync(join(dist, name)) };
};

test("by the keyboard alone", { skip, timeout: 60_000 }, async () => {
  const page = await open();
  await page.waitForSelector(id("step-5"));
  const at = () => page.evaluate(() => document.activeElement.dataset.testid);
  const to = async (name) => {
    for (let keys = 0; keys < 60; keys++) {
      if ((await at()) === name) return;
      await page.keyboard.press("Tab");
    }
    assert.fail(`Tab does not lead to ${name}`);
  };
  await to("init-name");
  await to("init-for-machine");
  await page.keyboard.press("ArrowDown");
  assert.equal(await at(), "init-for-try");
  await to("init-interface-eth1");
  await to("init-nodes-scan");
  await to("init-scan");
  await page.keyboard.press("Enter");
  await said(page, "init-found", "EtherCAT");
  assert.equal(await at(), "init-scan");
  await to("init-speed-1");
  await enabled(page, "init-write");
  await to("init-text");
  await to("init-write");
  await page.keyboard.press("Enter");
  await enabled(page, "init-start");
  await to("init-start");
  await page.keyboard.press("Enter");
  await said(page, "init-starting", "is starting");
  await page.browserContext().close();
});

test("three sizes, two languages: no wider than the screen, axe finds nothing serious, fingers hit", { skip, timeout: 180_000 }, async () => {
  const axe = readFileSync(join(modules, "axe-core/axe.min.js"), "utf8");
  const all = [];
  for (const [width, height] of [[390, 844], [768, 1024], [1280, 800]]) {
    for (const [language, theme] of [["en", "dark"], ["de", "light"]]) {
      const name = `${width}-${language}`;
      const page = await open({ offer: { ...USUAL.offer, real_time: false }, refuses: ({ name }) => (name === "mill" ? null : 'name: a name has the letters a to z, digits and "-"\nline 3: machine.name') }, { width, height, language, theme });
      const looks = async (what) => {
        await picture(page, `${name}-${what}`);
        const wide = await page.evaluate(() => document.documentElement.scrollWidth);
        if (wide > width) all.push(`${name} ${what}: ${wide} wide`);
        await page.evaluate(axe);
        const serious = await page.evaluate(() => axe.run(document, { runOnly: ["wcag2a", "wcag2aa"] }).then(({ violations }) => violations.filter(({ impact }) => ["serious", "critical"].includes(impact)).map(({ id, nodes }) => `${id}: ${nodes.map(({ html, any }) => `${html.slice(0, 160)} ${any[0]?.message ?? ""}`).join(" | ")}`)));
        all.push(...serious.map((one) => `${name} ${what}: ${one}`));
        const small = await page.evaluate(() => [...document.querySelectorAll("button, select, input:not([type=radio]), label.pick")].filter((one) => one.offsetParent).map((one) => [one.outerHTML.slice(0, 120), one.getBoundingClientRect()]).filter(([, { width, height }]) => width < 43.5 || height < 43.5).map(([what]) => what));
        all.push(...small.map((one) => `${name} ${what}: too small for a finger: ${one}`));
        const words = await page.$eval("#app", (app) => app.textContent);
        if (/undefined|NaN|init-|\{\w+\}/.test(words)) all.push(`${name} ${what}: ${words}`);
      };
      await page.waitForSelector(id("step-5"));
      await looks("begin");
      await click(page, "init-scan");
      await page.waitForSelector(id("init-text"));
      await fill(page, "init-counts-1", "1,5");
      await page.waitForSelector(id("init-counts-1-wrong"));
      await looks("wrong");
      await fill(page, "init-counts-1", "10000");
      await fill(page, "init-name", "Mühle");
      await page.waitForSelector(id("init-check-failed"));
      await looks("refused");
      await fill(page, "init-name", "mill");
      is.offer.exists = true;
      await enabled(page, "init-write");
      await click(page, "init-write");
      await page.waitForSelector(id("init-replace-dialogue"));
      await looks("exists");
      await click(page, "init-replace");
      await enabled(page, "init-start");
      await looks("written");
      await click(page, "init-nodes-hand");
      await looks("hand");
      await page.browserContext().close();
    }
  }
  assert.deepEqual(all, []);
});
