// Programs that the control keeps, in a real browser: upload, replace, list, rename, delete: node --test tests/panel/programs.test.mjs
//
// ISOCNC, CHROMIUM and PICTURES as in browser.test.mjs.
import assert from "node:assert/strict";
import { existsSync, mkdirSync, readFileSync, readdirSync, rmSync, utimesSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { launch, missing, modules, start, until as untilOf } from "./start.mjs";

const skip = missing ? `there is no ${missing}` : false;
const pictures = process.env.PICTURES;
const port = 20_000 + ((process.pid + 13) % 20_000);
const url = `http://127.0.0.1:${port}/`;
let folder, control, browser, ask, programs;
const troubles = [];
const until = (what, holds) => untilOf(ask, what, holds);
const id = (name) => `[data-testid="${name}"]`;

/** A page that collects what goes wrong in it, and the methods and addresses that it asks for. */
async function open({ width = 1280, height = 800, language = "en", hash = "#/programs" } = {}) {
  const page = await (await browser.createBrowserContext()).newPage();
  await page.setViewport({ width, height });
  // That a file exists is an answer, not a trouble.
  page.on("console", (message) => message.type() === "error" && !/412|422/.test(message.text()) && troubles.push(message.text()));
  page.on("pageerror", (error) => troubles.push(error.stack));
  page.requests = [];
  page.on("request", (request) => request.url().includes("/files/") && page.requests.push(`${request.method()} ${decodeURIComponent(request.url().split("/files/")[1])}`));
  await page.evaluateOnNewDocument((language) => {
    localStorage.setItem("language", language);
    window.sent = [];
    const { send } = WebSocket.prototype;
    WebSocket.prototype.send = function (text) {
      window.sent.push(JSON.parse(text));
      return send.call(this, text);
    };
  }, language);
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
const ordered = (page, method) => page.evaluate((method) => window.sent.filter((one) => one.method === method).map(({ params }) => params), method);
const names = (page) => page.$$eval(".stored b", (all) => all.map((one) => one.textContent));
const listed = (page, wanted) =>
  page
    .waitForFunction((wanted) => JSON.stringify([...document.querySelectorAll(".stored b")].map((one) => one.textContent)) === wanted, { timeout: 20_000 }, JSON.stringify(wanted))
    .catch(async () => assert.deepEqual(await names(page), wanted));
const picture = async (page, name) => {
  if (pictures) await page.screenshot({ path: join(pictures, `${name}.png`) });
};
const upload = async (page, ...files) => (await page.waitForSelector(id("upload"))).uploadFile(...files.map((name) => join(folder, name)));
const write = (name, x) => writeFileSync(join(folder, name), `G21 G90 G54 F1200\nG0 X0\nG1 X${x}\nM2\n`);
const loaded = (name) => until(`${name} is loaded`, async () => (await ask("status")).program?.name.endsWith(name));

before(async () => {
  if (skip) return;
  if (pictures) mkdirSync(pictures, { recursive: true });
  ({ folder, control, ask } = await start(port));
  await until("the network", () => ask("status").then(({ state }) => state === "disabled", () => false));
  programs = join(folder, "state/programs");
  browser = await launch();
});

after(async () => {
  await browser?.close();
  control?.removeAllListeners("exit");
  control?.kill("SIGINT");
  if (folder) rmSync(folder, { recursive: true });
});

test("an uploaded program is kept, loaded and marked; another one of its name asks first", { skip, timeout: 120_000 }, async () => {
  const page = await open();
  write("part 1.ngc", 10);
  await upload(page, "part 1.ngc");
  await loaded("part 1.ngc");
  await listed(page, ["part 1.ngc"]);
  await page.waitForFunction(() => document.querySelector(".stored .tag")?.textContent === "loaded");
  const { revision } = (await ask("status")).program;

  write("part 1.ngc", 200 / 3);
  utimesSync(join(folder, "part 1.ngc"), 1_700_000_000, 1_700_000_000);
  const before = readFileSync(join(programs, "part 1.ngc"), "utf8");
  await upload(page, "part 1.ngc");
  await page.waitForSelector(id("replace-dialogue"));
  const said = await text(page, "replace-dialogue");
  // Size and time of both, and what becomes of the loaded one.
  assert.match(said, /existing file34 B.*your file49 B.*2023.*own copy/);
  await picture(page, "replace");
  await click(page, "replace-no");
  await gone(page, "uploading");
  assert.equal(readFileSync(join(programs, "part 1.ngc"), "utf8"), before);
  assert.equal((await ask("status")).program.revision, revision);

  // Closed by a key that someone is just pressing: kept as it is.
  await upload(page, "part 1.ngc");
  await page.waitForSelector(id("replace-dialogue"));
  await page.keyboard.press("Enter");
  await gone(page, "replace-dialogue");
  await gone(page, "uploading");
  assert.equal(readFileSync(join(programs, "part 1.ngc"), "utf8"), before);

  await upload(page, "part 1.ngc");
  await click(page, "replace-yes");
  await until("another revision", async () => (await ask("status")).program.revision > revision).catch(async (error) => assert.fail(`${await page.$eval("main", (main) => main.textContent)}: ${error.message}`));
  assert.notEqual(readFileSync(join(programs, "part 1.ngc"), "utf8"), before);
  await page.close();
});

test("one of the same name that has come meanwhile is not replaced unasked", { skip, timeout: 60_000 }, async () => {
  const page = await open();
  write("late.ngc", 5);
  // The panel asks for the list first: what comes between that and its upload, only the control sees.
  await page.setRequestInterception(true);
  const hide = async (request) => {
    if (request.method() === "GET" && request.url().endsWith("/files/") && !existsSync(join(programs, "late.ngc"))) {
      writeFileSync(join(programs, "late.ngc"), "M2\n");
      return request.respond({ status: 200, contentType: "application/json", body: JSON.stringify({ files: [] }) });
    }
    return request.continue();
  };
  page.on("request", (request) => void hide(request));
  await upload(page, "late.ngc");
  await page.waitForSelector(id("replace-dialogue"));
  assert.equal(readFileSync(join(programs, "late.ngc"), "utf8"), "M2\n");
  await click(page, "replace-yes");
  await loaded("late.ngc");
  rmSync(join(programs, "late.ngc"));
  await page.close();
});

test("several programs at once are kept, none of them is loaded, and one with an error is explained", { skip, timeout: 60_000 }, async () => {
  const page = await open();
  const before = (await ask("status")).program.revision;
  for (const name of ["a10.ngc", "a9.ngc"]) write(name, 7);
  writeFileSync(join(folder, "wrong.ngc"), "G21\nG1 X\nM2\n");
  await upload(page, "a10.ngc", "wrong.ngc", "a9.ngc");
  await page.waitForSelector(id("not-kept"));
  assert.match(await text(page, "not-kept"), /wrong\.ngc is not kept:.*X needs a number.*wrong\.ngc:2:4/s);
  // By their numbers, not by their letters.
  await listed(page, ["a9.ngc", "a10.ngc", "part 1.ngc"]);
  assert.match(await text(page, "toast"), /2 programs are kept/);
  assert.equal((await ask("status")).program.revision, before);
  await picture(page, "not-kept");
  utimesSync(join(programs, "a9.ngc"), 1_600_000_000, 1_600_000_000);
  await page.evaluate(() => dispatchEvent(new Event("focus")));
  await click(page, "sort-time");
  await page.waitForFunction(() => [...document.querySelectorAll(".stored b")].at(-1).textContent === "a9.ngc");
  await click(page, "sort-name");
  await page.close();
});

test("dropped files are uploaded; a tap loads; what comes another way is listed once the window has the focus", { skip, timeout: 60_000 }, async () => {
  const page = await open();
  await page.waitForSelector(id("drop"));
  await page.$eval(id("drop"), (drop) => {
    const data = new DataTransfer();
    data.items.add(new File(["G21 G90 F600\nG1 X1\nM2\n"], "dropped.ngc"));
    drop.dispatchEvent(new DragEvent("drop", { dataTransfer: data, bubbles: true, cancelable: true }));
  });
  await loaded("dropped.ngc");
  writeFileSync(join(programs, "by-scp.ngc"), "G21 G90 F600\nG1 X2\nM2\n");
  await page.evaluate(() => dispatchEvent(new Event("focus")));
  await page.waitForSelector(id("file-by-scp.ngc"));
  await click(page, "file-load-by-scp.ngc");
  await loaded("by-scp.ngc");
  await page.waitForFunction(() => document.querySelector('[data-testid="file-by-scp.ngc"] .tag'));
  assert.equal((await page.$$(".stored .tag")).length, 1);
  await page.close();
});

test("a program is renamed, downloaded and deleted, also the loaded one, of which the control keeps its copy", { skip, timeout: 120_000 }, async () => {
  const page = await open();
  await click(page, "file-menu-by-scp.ngc");
  await page.waitForSelector(id("file-dialogue"));
  assert.match(await text(page, "file-dialogue"), /own copy/);
  assert.equal(await page.$eval(id("file-download"), (link) => link.getAttribute("href")), "files/by-scp.ngc");
  await picture(page, "file-menu");
  await fill(page, "file-name", "part 1.ngc");
  await click(page, "file-rename");
  await page.waitForFunction(() => document.querySelector("[data-testid=file-wrong]")?.textContent === "part 1.ngc already exists.");
  assert.ok(existsSync(join(programs, "by-scp.ngc")));
  await fill(page, "file-name", "Prüfteil 100 %.ngc");
  await page.keyboard.press("Enter");
  await gone(page, "file-dialogue");
  await page.waitForSelector(id("file-Prüfteil 100 %.ngc"));
  assert.ok(existsSync(join(programs, "Prüfteil 100 %.ngc")), readdirSync(programs).join());
  assert.ok(!existsSync(join(programs, "by-scp.ngc")));

  await click(page, "file-load-Prüfteil 100 %.ngc");
  await loaded("Prüfteil 100 %.ngc");
  await click(page, "file-menu-Prüfteil 100 %.ngc");
  await click(page, "file-delete");
  await page.waitForSelector(id("file-delete-dialogue"));
  assert.match(await text(page, "file-delete-dialogue"), /Delete Prüfteil 100 %\.ngc.*own copy/);
  await picture(page, "file-delete");
  await page.keyboard.press("Enter");
  await gone(page, "file-delete-dialogue");
  assert.ok(existsSync(join(programs, "Prüfteil 100 %.ngc")), "a key that someone is just pressing is no answer");
  await click(page, "file-menu-Prüfteil 100 %.ngc");
  await click(page, "file-delete");
  await click(page, "file-delete-yes");
  await gone(page, "file-Prüfteil 100 %.ngc");
  assert.ok(!existsSync(join(programs, "Prüfteil 100 %.ngc")));
  assert.match((await ask("status")).program.name, /Prüfteil/);
  await page.close();
});

test("a preview runs through the planned time, in the picture and in the text, and is never the machine", { skip, timeout: 120_000 }, async () => {
  const page = await open();
  const lines = Array.from({ length: 40 }, (_, i) => `G1 X${i % 2 ? 0 : 40} Y${i}`);
  await ask("program.load", { name: "pocket.ngc", text: `G21 G90 G54 F600\nG0 X0 Y0 Z5\nG1 Z0\n${lines.join("\n")}\nG0 Z5\nM2\n` });
  await page.waitForFunction(() => document.querySelector("[data-testid=path-note]")?.textContent === "X 40 × Y 39 × Z 5 mm", { timeout: 60_000 });
  const { planned_time_s } = (await ask("status")).program;
  const before = (await ask("status")).position_mm;
  await page.waitForSelector(id("preview"));
  assert.ok(!(await page.$(id("preview-tag"))));
  await page.$eval(id("preview-slider"), (slider) => {
    slider.value = slider.max / 2;
    slider.dispatchEvent(new Event("input", { bubbles: true }));
  });
  await page.waitForSelector(id("preview-tag"));
  const line = () => page.$eval(".program-text .previewed", (row) => Number(row.dataset.line));
  await page.waitForSelector(".program-text .previewed");
  assert.ok(Math.abs((await line()) - 23) <= 3, `line ${await line()}`);
  await page.waitForFunction(() => document.querySelector("[data-testid=path]").dataset.busy === "false");
  // Two tools, each in its colour.
  const markers = await page.evaluate(async () => {
    const canvas = document.querySelector("[data-testid=path]");
    const drawn = canvas.dataset.drawn;
    canvas.dispatchEvent(new WheelEvent("wheel", { deltaY: 0 }));
    await new Promise((resolve) => {
      const look = () => (canvas.dataset.drawn !== drawn ? resolve() : requestAnimationFrame(look));
      look();
    });
    const copy = document.createElement("canvas");
    [copy.width, copy.height] = [canvas.width, canvas.height];
    const context = copy.getContext("2d");
    context.drawImage(canvas, 0, 0);
    const { data } = context.getImageData(0, 0, copy.width, copy.height);
    let [real, preview] = [0, 0];
    for (let i = 0; i < data.length; i += 4) {
      const [r, g, b] = [data[i], data[i + 1], data[i + 2]];
      if (r > 120 && r - b > 80 && g - b > 20) real++;
      if (b > 90 && b - g > 50 && r - g > 20) preview++;
    }
    return { real, preview };
  });
  assert.ok(markers.real > 40 && markers.preview > 40, JSON.stringify(markers));
  await picture(page, "preview");
  await click(page, "preview-60");
  await click(page, "preview-play");
  await page.waitForFunction((end) => Number(document.querySelector("[data-testid=preview]").dataset.time) >= end, { timeout: 20_000 }, planned_time_s - 0.001);
  await page.waitForFunction(() => document.querySelector("[data-testid=preview-play]").getAttribute("aria-pressed") === "false");
  assert.ok((await line()) > 40);
  assert.deepEqual((await ask("status")).position_mm, before, "nothing has moved");
  assert.deepEqual((await page.evaluate(() => window.sent.map(({ method }) => method))).filter((method) => /start|mdi|jog|home/.test(method)), []);
  await click(page, "preview-end");
  await gone(page, "preview-tag");
  assert.equal(await page.$(".program-text .previewed"), null);
  // Another program, and another page, end it.
  await click(page, "preview-play");
  await page.waitForSelector(id("preview-tag"));
  await ask("program.load", { name: "other.ngc", text: "G21 G90 F600\nG0 X0\nG1 X10\nM2\n" });
  await gone(page, "preview-tag");
  await page.waitForFunction(() => document.querySelector("[data-testid=path-note]")?.textContent === "X 10 × Y 0 × Z 0 mm", { timeout: 60_000 });
  await click(page, "preview-1");
  await click(page, "preview-play");
  await page.waitForSelector(id("preview-tag"));
  await page.evaluate(() => (location.hash = "#/operate"));
  await gone(page, "preview");
  assert.equal(await page.$(id("preview-tag")), null);
  assert.equal(await page.$(".program-text .previewed"), null);
  await page.close();
});

test("thousands of programs: the first 200 are shown, a search finds the others", { skip, timeout: 120_000 }, async () => {
  for (let i = 0; i < 4000; i++) writeFileSync(join(programs, `job ${i}.ngc`), "M2\n");
  const page = await open({ width: 390, height: 844 });
  await page.waitForFunction(() => Number(document.querySelector("[data-testid=files]")?.dataset.count) > 4000, { timeout: 60_000 });
  assert.equal((await names(page)).length, 200);
  assert.match(await text(page, "files-more"), /^380\d more/);
  await fill(page, "file-search", "JOB 3999");
  await listed(page, ["job 3999.ngc"]);
  const took = await page.evaluate(async () => {
    const input = document.querySelector("[data-testid=file-search]");
    const begun = performance.now();
    input.value = "job";
    input.dispatchEvent(new Event("input", { bubbles: true }));
    await new Promise((drawn) => requestAnimationFrame(() => setTimeout(drawn)));
    return performance.now() - begun;
  });
  console.log(`a search in 4000 programs: ${took.toFixed(0)} ms`);
  assert.ok(took < 1500, `${took} ms`);
  await picture(page, "files-phone");
  for (let i = 0; i < 4000; i++) rmSync(join(programs, `job ${i}.ngc`));
  await page.close();
});

/** What axe finds, and buttons that no finger hits. */
async function wrong(page, name) {
  await picture(page, name);
  await page.evaluate(readFileSync(join(modules, "axe-core/axe.min.js"), "utf8"));
  const serious = await page.evaluate(() => axe.run(document, { runOnly: ["wcag2a", "wcag2aa"] }).then(({ violations }) => violations.filter(({ impact }) => ["serious", "critical"].includes(impact)).map(({ id, nodes }) => `${id}: ${nodes.map(({ html }) => html.slice(0, 160)).join(" | ")}`)));
  const small = await page.evaluate(() =>
    [...document.querySelectorAll("button, a.button")]
      .filter((one) => one.offsetParent)
      .map((one) => ({ html: one.outerHTML.slice(0, 120), ...one.getBoundingClientRect().toJSON() }))
      .filter(({ width, height, left, right }) => width < 43.5 || height < 43.5 || left < -1 || right > innerWidth + 1)
      .map(({ html }) => html),
  );
  return [...serious, ...small].map((one) => `${name}: ${one}`);
}

test("the list and its dialogues at three sizes, in two languages: axe finds nothing serious, fingers hit", { skip, timeout: 180_000 }, async () => {
  const all = [];
  for (const [width, height, language] of [[1280, 800, "en"], [768, 1024, "de"], [390, 844, "en"], [390, 844, "de"]]) {
    const page = await open({ width, height, language });
    const end = `${width}-${language}`;
    await page.waitForSelector(id("files"));
    all.push(...(await wrong(page, `programs-${end}`)));
    await page.waitForSelector(id("preview-slider"));
    await page.$eval(id("preview-slider"), (slider) => {
      slider.value = slider.max / 3;
      slider.dispatchEvent(new Event("input", { bubbles: true }));
    });
    await page.waitForSelector(id("preview-tag"));
    await page.$eval(id("preview"), (bar) => bar.scrollIntoView({ block: "end" }));
    all.push(...(await wrong(page, `preview-${end}`)));
    await click(page, "file-menu-part 1.ngc");
    await page.waitForSelector(id("file-dialogue"));
    all.push(...(await wrong(page, `file-dialogue-${end}`)));
    await click(page, "file-delete");
    await page.waitForSelector(id("file-delete-dialogue"));
    all.push(...(await wrong(page, `file-delete-${end}`)));
    await page.$eval("dialog header button", (button) => button.click());
    await upload(page, "part 1.ngc");
    await page.waitForSelector(id("replace-dialogue"));
    all.push(...(await wrong(page, `replace-${end}`)));
    await click(page, "replace-no");
    await page.close();
  }
  assert.deepEqual(all, []);
});

test("nothing went wrong in any page", { skip }, () => {
  assert.deepEqual(troubles, []);
});
