// The page Jobs in a real browser: numbers, program, picture, load, start: node --test tests/panel/jobs.test.mjs
//
// ISOCNC and CHROMIUM as in browser.test.mjs. SCREENS=write makes screens/jobs-1280.webp again: look at it before it is committed.
import assert from "node:assert/strict";
import { readFileSync, rmSync } from "node:fs";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { launch, missing, modules, root, start, until as untilOf } from "./start.mjs";

const skip = missing ? `there is no ${missing}` : false;
const port = 20_000 + ((process.pid + 7) % 20_000);
const url = `http://127.0.0.1:${port}/`;
let folder, control, browser, ask;
const troubles = [];
const until = (what, holds) => untilOf(ask, what, holds);
const id = (name) => `[data-testid="${name}"]`;

async function open({ width = 1280, height = 800, language = "en" } = {}) {
  const page = await (await browser.createBrowserContext()).newPage();
  await page.setViewport({ width, height });
  page.on("console", (message) => message.type() === "error" && troubles.push(message.text()));
  page.on("pageerror", (error) => troubles.push(error.stack));
  await page.evaluateOnNewDocument((language) => localStorage.setItem("language", language), language);
  await page.goto(`${url}#/jobs`);
  await page.waitForSelector(id("job-kind"));
  return page;
}

const click = (page, name) => page.waitForSelector(id(name)).then(() => page.$eval(id(name), (element) => element.click()));
const type = async (page, name, value) => {
  await page.$eval(id(`job-${name}`), (input) => input.select());
  await page.type(id(`job-${name}`), value);
};
/** The program, once it has this in it. */
const text = (page, part) =>
  page
    .waitForFunction((part) => document.querySelector("[data-testid=job-program]")?.textContent.includes(part), { timeout: 20_000 }, part)
    .catch(async () => assert.fail(`no ${part} in: ${await page.$eval("main", (main) => main.textContent)}`))
    .then(() => page.$eval(id("job-program"), (element) => element.textContent));
const isDisabled = (page, name) => page.$eval(id(name), (button) => button.disabled);

before(async () => {
  if (skip) return;
  ({ folder, control, ask } = await start(port));
  await until("the network", () => ask("status").then(({ state }) => state === "disabled", () => false));
  browser = await launch();
});

after(async () => {
  await browser?.close();
  control?.removeAllListeners("exit");
  control?.kill("SIGINT");
  if (folder) rmSync(folder, { recursive: true });
});

test("a pocket from its numbers to its end", { skip, timeout: 300_000 }, async (pocket) => {
  const page = await open();
  await pocket.test("every kind has its picture and its program", async () => {
    const kinds = await page.$$eval(`${id("job-kind")} option`, (all) => all.map((one) => one.value));
    assert.deepEqual(kinds, ["facing", "rectangular_pocket", "circular_pocket", "bolt_circle", "hole_rows", "thread_milling", "engraving"]);
    for (const kind of kinds) {
      await page.select(id("job-kind"), kind);
      await text(page, "G64 P0.003");
      const { shapes, words } = await page.$eval(id("job-picture"), (picture) => ({ shapes: picture.querySelectorAll("circle, rect, path, .letters").length, words: picture.textContent }));
      assert.ok(shapes > 1, `${kind}: ${shapes}`);
      assert.doesNotMatch(words + (await page.$eval("main", (main) => main.textContent)), /NaN|undefined|job-|_/, kind);
    }
  });

  await pocket.test("a wrong number is explained at its field, and nothing can be loaded", async () => {
    await page.select(id("job-kind"), "circular_pocket");
    await text(page, "(Circular pocket of 40 mm");
    await type(page, "tool_diameter", "50");
    await page.waitForSelector(id("job-tool_diameter-wrong"));
    assert.equal(await page.$eval(id("job-tool_diameter-wrong"), (element) => element.textContent), "a tool of 50 mm does not fit into a pocket of 40 mm: take a smaller one");
    assert.ok(await isDisabled(page, "job-load"));
    await type(page, "tool_diameter", "eight");
    await page.waitForFunction(() => /expected a number/.test(document.querySelector("[data-testid=job-tool_diameter-wrong]")?.textContent));
    // A comma, as in German.
    await type(page, "tool_diameter", "8,0");
    await text(page, "(Tool 1: end mill of 8 mm)");
    assert.equal(await page.$(id("job-tool_diameter-wrong")), null);
  });

  await pocket.test("numbers stay", async () => {
    for (const [name, value] of Object.entries({ x: "40", y: "40", diameter: "20", depth: "1", stepdown: "1", feed: "3000", plunge_feed: "2000", ramp_angle: "20", safe_height: "5" })) await type(page, name, value);
    await text(page, "(Circular pocket of 20 mm, 1 mm deep)");
    await page.reload();
    const made = await text(page, "(Circular pocket of 20 mm, 1 mm deep)");
    assert.match(made, /\(Middle at X40 Y40\)/);
    assert.equal(await page.$eval(id("job-kind"), (select) => select.value), "circular_pocket");
  });

  await pocket.test("what is loaded is drawn, and does not start by itself", async () => {
    await ask("home");
    await until("homed", async () => (await ask("status")).homed.length === 3);
    await until("rest", async () => (await ask("status")).activity === "idle");
    await click(page, "job-load");
    await until("the program", async () => (await ask("status")).program?.name === "circular_pocket.ngc");
    await page.waitForFunction(() => document.querySelector("[data-testid=path]")?.dataset.whole === "true", { timeout: 60_000 });
    assert.ok((await page.$eval(id("path"), (canvas) => Number(canvas.dataset.segments))) > 10);
    const { lines } = await ask("program.text", { lines: 500 });
    assert.equal(lines.join("\n").trim(), (await page.$eval(id("job-program"), (element) => element.textContent)).trim());
    assert.equal((await ask("status")).activity, "idle");
    if (process.env.SCREENS === "write") await page.screenshot({ path: join(root, "tests/panel/screens/jobs-1280.webp"), type: "webp", quality: 60 });
  });

  await pocket.test("it runs to its end", async () => {
    await ask("mdi", { line: "M61 Q1" });
    await until("the tool", async () => (await ask("status")).tool === 1 && (await ask("status")).activity === "idle");
    await click(page, "start");
    await until("the end", async () => {
      const { last_program, activity } = await ask("status");
      return activity === "idle" && last_program?.name === "circular_pocket.ngc" && last_program.result === "completed";
    });
    const { position_mm } = await ask("status");
    // At the end of the arc off the wall: the wall is 6 mm from the middle for the tool, the arc has a radius of 2.9 mm.
    const [x, y] = [position_mm[0] - 20 - 40, position_mm[1] - 20 - 40];
    assert.ok(Math.hypot(x - 3.1, y - 2.9) < 0.01, `${x} ${y}`);
  });
  assert.deepEqual(troubles, []);
});

test("in German, on a telephone, for everyone", { skip, timeout: 120_000 }, async () => {
  const page = await open({ width: 390, height: 844, language: "de" });
  await page.select(id("job-kind"), "engraving");
  await text(page, "(Text: ISOCNC)");
  await type(page, "text", "5 €");
  await page.waitForSelector(id("job-text-wrong"));
  assert.equal(await page.$eval(id("job-text-wrong"), (element) => element.textContent), "die Schrift hat keine Zeichen €: anders schreiben");
  assert.match(await page.$eval("main", (main) => main.textContent), /Gravieren.*Zeichenabstand/s);
  await type(page, "text", "5 Stück");
  await text(page, "(Text: 5 Stück)");
  const wide = await page.evaluate(() => document.documentElement.scrollWidth);
  assert.ok(wide <= 390, `${wide} wide`);
  await page.evaluate(readFileSync(join(modules, "axe-core/axe.min.js"), "utf8"));
  const serious = await page.evaluate(() => axe.run(document, { runOnly: ["wcag2a", "wcag2aa"] }).then(({ violations }) => violations.filter(({ impact }) => ["serious", "critical"].includes(impact)).map(({ id, nodes }) => `${id}: ${nodes.map(({ html }) => html.slice(0, 160)).join(" | ")}`)));
  assert.deepEqual(serious, []);
  assert.deepEqual(troubles, []);
});
