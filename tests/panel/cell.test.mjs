// The page of a cell: node --test tests/panel/cell.test.mjs
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { existsSync, mkdtempSync, readFileSync, readdirSync, rmSync } from "node:fs";
import { createServer } from "node:http";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { test } from "node:test";
import { launch, modules, root } from "./start.mjs";

const dist = join(root, "crates/cell/dist");
const source = (name) => readFileSync(join(root, "crates/cell/web/src", name), "utf8");
const POLICY = /const POLICY: &str = "([^"]+)"/.exec(readFileSync(join(root, "crates/cell/src/page.rs"), "utf8"))[1];

test("what is committed is what the sources give", { skip: existsSync(modules) ? false : "npm ci in crates/panel/web" }, () => {
  const built = mkdtempSync(join(tmpdir(), "cell-page-"));
  execFileSync("node", [join(root, "crates/cell/web/build.mjs"), built]);
  assert.deepEqual(readdirSync(built).sort(), readdirSync(dist).sort());
  for (const name of readdirSync(built)) assert.ok(readFileSync(join(built, name)).equals(readFileSync(join(dist, name))), name);
  rmSync(built, { recursive: true });
  execFileSync(join(modules, ".bin/tsc"), ["-p", join(root, "crates/cell/web")]);
});

test("English and German have the same words, all of which are used", () => {
  const [en, de] = ["en", "de"].map((name) => JSON.parse(source(`messages/${name}.json`)));
  assert.deepEqual(Object.keys(de), Object.keys(en));
  const code = source("main.tsx");
  const groups = /^(order|phase)-|^(running|held|idle|alarm|unknown)$/;
  for (const key of Object.keys(en)) assert.ok(groups.test(key) || code.includes(`"${key}"`), key);
});

/** A supervisor of machines in all states. */
function overview() {
  const now = Date.now() / 1000;
  const machine = (name, use, state = {}) => ({
    name, class: "", alive: use !== "unknown", silent_s: 7, use, panel: use === "running" ? "http://10.0.0.7:8402/" : "javascript:alert(1)",
    state: { activity: "idle", program: "<b>part</b>.ngc", alarm: null, why_not: null, done_percent: 40, remaining_s: 75, parts: 3, ...state },
  });
  const orders = ["open", "held", "done", "cancelled"].map((state, at) => ({
    id: at + 1, program: "part.ngc", count: 5, completed: at, failed: 1, under_way: 1, state, note: "why", unfit: [{ machine: "b", why: "has no axis X" }],
  }));
  const attempts = ["unknown", "refused", "running", "completed", "failed", "interrupted"].map((phase) => ({
    id: phase, order: 1, machine: "a", program: "part.ngc", phase, note: "", sent_unix_s: now, took_s: phase === "completed" ? 100 : null,
  }));
  return {
    unix_s: now,
    machines: [machine("a", "running"), machine("b", "held"), machine("c", "idle"), machine("d", "alarm", { alarm: "hot" }), machine("e", "unknown")],
    alarms: [{ machine: "d", seq: 1, unix_s: now, text: "hot" }],
    orders,
    attempts,
    times: [{ machine: "a", day: 1, what: "running", seconds: 60 }, { machine: "a", day: 1, what: "idle", seconds: 60 }],
    refusals: [{ unix_s: now, text: "10.0.0.9: no certificate" }],
  };
}

test("a browser shows it, in both languages and at both sizes, and finds nothing wrong", { skip: existsSync(modules) ? false : "npm ci in crates/panel/web" }, async (context) => {
  const kinds = { html: "text/html", js: "text/javascript", css: "text/css", svg: "image/svg+xml" };
  const server = createServer((request, answer) => {
    if (request.url === "/overview") return answer.end(JSON.stringify(overview()));
    const name = request.url === "/" ? "index.html" : request.url.slice(1);
    answer.writeHead(200, { "content-type": kinds[name.split(".").pop()], "content-security-policy": POLICY });
    answer.end(readFileSync(join(dist, name)));
  });
  await new Promise((listens) => server.listen(0, "127.0.0.1", listens));
  const browser = await launch().catch(() => null);
  if (!browser) {
    server.close();
    return context.skip("there is no Chromium");
  }
  try {
    for (const [language, width, height] of [["en", 1280, 800], ["de", 390, 844]]) {
      const page = await browser.newPage();
      const told = [];
      page.on("console", (message) => ["error", "warn"].includes(message.type()) && told.push(message.text()));
      page.on("pageerror", (error) => told.push(String(error)));
      await page.setViewport({ width, height });
      await page.evaluateOnNewDocument((chosen) => localStorage.setItem("language", chosen), language);
      await page.goto(`http://127.0.0.1:${server.address().port}/`);
      await page.waitForSelector("[data-machine=e]");
      assert.equal(await page.evaluate(() => document.documentElement.scrollWidth - innerWidth), 0, "it is not wider than the screen");
      const links = await page.$$eval("[data-machine] a", (found) => found.map((one) => one.href));
      assert.deepEqual(links, ["http://10.0.0.7:8402/"]);
      assert.equal((await page.$$("[data-machine] b")).length, 0, "text is no markup");
      const all = await page.$eval("body", (body) => body.innerText);
      assert.ok(all.includes("<b>part</b>.ngc") && !/undefined|NaN|\{\w+\}/.test(all), all);
      assert.deepEqual(told, []);
      await page.evaluate(readFileSync(join(modules, "axe-core/axe.min.js"), "utf8"));
      const found = await page.evaluate(() => axe.run().then(({ violations }) => violations.map((one) => `${one.id}: ${one.nodes[0].html}`)));
      assert.deepEqual(found, []);
      await page.close();
    }
  } finally {
    await browser.close();
    server.close();
  }
});
