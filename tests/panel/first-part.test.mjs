// docs/first-part.md, followed to the letter in a real browser: node --test tests/panel/first-part.test.mjs
//
// Its lines "- Press **X**." and the like are the steps; the words in bold are those on the screen. What is missing, and where pictures go, as
// in browser.test.mjs.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { mkdirSync, mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { test } from "node:test";
import { launch, missing, program, root } from "./start.mjs";

const skip = missing ? `there is no ${missing}` : false;
const pictures = process.env.PICTURES;
const port = 20_000 + ((process.pid + 7) % 20_000);
/** Longest that any step may take. */
const PATIENCE_MS = 120_000;

const STEP = /^- (Press|Open|Wait for) \*\*(.+)\*\*\.$|^- (Wait until) \*\*(.+)\*\* is gone\.$|^- (Type) `(.+)` into \*\*(.+)\*\*\.$|^- (Upload) `(.+)` with \*\*(.+)\*\*\.$/;

/** The steps of a page: what to do, and with what. */
function steps(text) {
  return text
    .split("\n")
    .filter((line) => line.startsWith("- "))
    .map((line) => {
      const found = STEP.exec(line);
      assert.ok(found, `no step: ${line}`);
      const [verb, ...words] = found.slice(1).filter((part) => part !== undefined);
      return { line, verb, words };
    });
}

/** The element that a person finds by this word: one that can be seen, its name is the word or begins with it. */
const find = (page, kinds, word) =>
  page.waitForFunction(
    (kinds, word) => {
      const name = (element) => (element.getAttribute("aria-label") ?? element.labels?.[0]?.textContent ?? element.textContent).trim();
      const seen = [...document.querySelectorAll(kinds)].filter((element) => element.checkVisibility() && !element.disabled);
      return seen.find((element) => name(element) === word) ?? seen.find((element) => name(element).startsWith(word));
    },
    { timeout: PATIENCE_MS },
    kinds,
    word,
  );

const STATES = ["drives off", "homing", "ready", "running", "held"];
const BUTTONS = "button, [role=tab], [role=radio], label.choice, a";

const doing = {
  Press: async (page, word) => (await find(page, BUTTONS, word)).click(),
  Open: async (page, word) => (await find(page, "nav a, nav button", word)).click(),
  Type: async (page, text, word) => (await find(page, "input", word)).type(text),
  Upload: async (page, file, word) => {
    const [chooser] = await Promise.all([page.waitForFileChooser(), (await find(page, BUTTONS, word)).click()]);
    await chooser.accept([join(root, file)]);
  },
  "Wait until": (page, word) => page.waitForFunction((word) => !document.body.innerText.toLowerCase().includes(word), { timeout: PATIENCE_MS }, word),
  // A state is that of the machine, at the top; anything else may stand anywhere.
  "Wait for": (page, word) =>
    page.waitForFunction(
      (word, isState) => {
        const text = (isState ? document.querySelector("[data-testid=state]") : document.body).innerText.toLowerCase();
        return isState ? text.trim() === word : text.includes(word.toLowerCase());
      },
      { timeout: PATIENCE_MS },
      word,
      STATES.includes(word),
    ),
};

test("docs/first-part.md leads to a part", { skip, timeout: 600_000 }, async () => {
  const todo = steps(readFileSync(join(root, "docs/first-part.md"), "utf8"));
  assert.ok(todo.length > 15, `${todo.length} steps`);
  const folder = mkdtempSync(join(tmpdir(), "first-part-"));
  const begun = Date.now();
  const control = spawn(program, ["demo", "--memory", "--panel", `127.0.0.1:${port}`], { cwd: folder, stdio: ["ignore", "ignore", "inherit"] });
  const browser = await launch();
  try {
    if (pictures) mkdirSync(pictures, { recursive: true });
    const page = await browser.newPage();
    await page.setViewport({ width: 1280, height: 800 });
    const url = `http://127.0.0.1:${port}/`;
    for (;;) {
      const there = await page.goto(url).then(() => true, () => false);
      if (there) break;
      assert.equal(control.exitCode, null, "the control has ended");
      await new Promise((wake) => setTimeout(wake, 200));
    }
    await page.waitForFunction(() => document.querySelector("[data-testid=state]")?.dataset.state === "disabled", { timeout: PATIENCE_MS });
    let waited_ms = 0;
    for (const [number, { line, verb, words }] of todo.entries()) {
      const since = Date.now();
      await doing[verb](page, ...words).catch((error) => {
        throw new Error(`step ${number + 1} of docs/first-part.md: ${line}: ${error.message}`);
      });
      if (verb.startsWith("Wait")) waited_ms += Date.now() - since;
      if (pictures) await page.screenshot({ path: join(pictures, `first-part-${String(number + 1).padStart(2, "0")}.png`) });
    }
    // It was cut: to its end, with the zero that the page has set.
    const ended = await page.evaluate(() => document.querySelector("[data-testid=state]").dataset.state);
    assert.equal(ended, "disabled");
    const history = await (async () => {
      await doing.Open(page, "Programs");
      // The list of programs has it as well.
      const entry = await page.waitForFunction(() => [...document.querySelectorAll("button")].find((one) => /^first-part\.ngc.*completed/s.test(one.textContent)), { timeout: PATIENCE_MS });
      return entry.evaluate((element) => element.textContent);
    })();
    assert.match(history, /completed/);
    console.log(`first part: ${((Date.now() - begun) / 1000).toFixed(0)} s in all, waited ${(waited_ms / 1000).toFixed(0)} s of them for the machine`);
  } finally {
    await browser.close();
    control.kill("SIGINT");
    await new Promise((ended) => (control.exitCode === null ? control.once("exit", ended) : ended()));
    rmSync(folder, { recursive: true });
  }
});
