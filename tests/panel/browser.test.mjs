// The panel in a real browser against a simulated machine: node --test tests/panel/browser.test.mjs
//
// ISOCNC names the program (target/debug/isocnc), CHROMIUM the browser. Where one of them, or the modules of panel/web, is missing,
// the tests say so and pass. SCREENS=write makes the pictures in screens/ anew: look at each of them before it is committed.
import assert from "node:assert/strict";
import { execFileSync, spawn } from "node:child_process";
import { createConnection } from "node:net";
import { existsSync, mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";

const root = new URL("../../", import.meta.url).pathname;
const program = process.env.ISOCNC ?? join(root, "target/debug/isocnc");
const chromium = process.env.CHROMIUM ?? ["/usr/bin/chromium-headless-shell", "/usr/bin/chromium"].find(existsSync);
const modules = join(root, "panel/web/node_modules");
const serves = () => execFileSync(program, ["run", "--help"], { encoding: "utf8" }).includes("--panel");
const missing = !existsSync(program) ? program : !serves() ? "option --panel of it" : !chromium ? "Chromium" : !existsSync(modules) ? "npm ci in panel/web" : "";
const skip = missing ? `there is no ${missing}` : false;
/** Pictures are written here, to be looked at. */
const pictures = process.env.PICTURES;

const port = 20_000 + (process.pid % 20_000);
const url = `http://127.0.0.1:${port}/`;
let folder, control, browser, socketPath;
const troubles = [];

/** One request on the control socket, beside the browser. */
function ask(method, params = {}) {
  return new Promise((resolve, reject) => {
    const socket = createConnection(socketPath);
    let text = "";
    socket.on("connect", () => socket.write(`${JSON.stringify({ jsonrpc: "2.0", id: 1, method, params })}\n`));
    socket.on("data", (data) => {
      text += data;
      if (!text.includes("\n")) return;
      socket.end();
      const { result, error } = JSON.parse(text);
      if (error) reject(new Error(error.message));
      else resolve(result);
    });
    socket.on("error", reject);
  });
}

/** Waits until something holds; what it was last is in the message. */
async function until(what, holds, limit_ms = 60_000) {
  const end = Date.now() + limit_ms;
  let last;
  while (Date.now() < end) {
    last = await holds();
    if (last) return last;
    await new Promise((wake) => setTimeout(wake, 50));
  }
  throw new Error(`did not come: ${what}; status ${JSON.stringify(await ask("status")).slice(0, 1500)}`);
}

const state = async () => (await ask("status")).state;

/** A page that collects what goes wrong in it. */
async function open({ width = 1280, height = 800, hash = "", context = browser } = {}) {
  const page = await context.newPage();
  await page.setViewport({ width, height });
  await page.emulateMediaFeatures([{ name: "prefers-color-scheme", value: "dark" }]);
  page.on("console", (message) => {
    // Reconnecting is what some of these tests ask for.
    if (message.type() === "error" && !/WebSocket|ERR_INTERNET_DISCONNECTED|ERR_CONNECTION/.test(message.text())) troubles.push(message.text());
  });
  page.on("pageerror", (error) => troubles.push(error.stack));
  page.on("request", (request) => {
    if (!request.url().startsWith(url) && !request.url().startsWith("data:")) troubles.push(`fetches ${request.url()}`);
  });
  await page.evaluateOnNewDocument(() => {
    document.addEventListener("securitypolicyviolation", (event) => console.error(`policy: ${event.violatedDirective} ${event.blockedURI}`));
  });
  await page.goto(url + hash);
  await page.waitForFunction(() => document.querySelector("[data-testid=state]")?.dataset.state);
  return page;
}

const id = (name) => `[data-testid="${name}"]`;
const text = (page, name) => page.$eval(id(name), (element) => element.textContent);
const click = async (page, name) => {
  await page.waitForSelector(id(name));
  await page.$eval(id(name), (element) => element.click());
};
const go = async (page, where) => {
  await page.evaluate((where) => (location.hash = `#/${where}`), where);
  await page.waitForSelector(`${id(`page-${where}`)}[aria-current=page]`);
};
const shown = (page, wanted) => page.waitForFunction((wanted) => wanted.includes(document.querySelector("[data-testid=state]").dataset.state), { timeout: 60_000 }, wanted);
const picture = async (page, name) => {
  if (pictures) await page.screenshot({ path: join(pictures, `${name}.png`) });
};

before(async () => {
  if (skip) return;
  if (pictures) mkdirSync(pictures, { recursive: true });
  folder = mkdtempSync(join(tmpdir(), "panel-"));
  const name = `panel-${process.pid}`;
  const machine = readFileSync(join(root, "configs/mill3-demo.toml"), "utf8")
    .replace('name = "mill3-demo"', `name = "${name}"`)
    .replace('kind = "powerlink"', 'kind = "memory"')
    .replace('interface = "plk0"\n', "")
    // A busy PC leaves cycles out: time stands still then, and the machine bears it, as in tests/common.
    .replace("\nlock_memory = true", "\noverruns_stop = 0\nlock_memory = true")
    .replace("pres_lost_max = 20", "pres_lost_max = 1000")
    .replace("following_error_mm = 2.0", "following_error_mm = 100.0")
    // Somebody changes tools here: the panel's dialogue.
    .replace(/\[\[hal\.net\]\]\nname = "tool-change-loop".*?\n\n/s, "");
  writeFileSync(join(folder, "machine.toml"), machine);
  control = spawn(program, ["run", "machine.toml", "--panel", `127.0.0.1:${port}`], { cwd: folder, stdio: ["ignore", "ignore", "inherit"] });
  const folders = ["/run/isocnc", process.env.XDG_RUNTIME_DIR && `${process.env.XDG_RUNTIME_DIR}/isocnc`, `/dev/shm/isocnc-${process.getuid()}`];
  socketPath = await new Promise((resolve, reject) => {
    control.on("exit", (code) => reject(new Error(`the control has ended: ${code}`)));
    const look = setInterval(() => {
      const found = folders.filter(Boolean).map((one) => `${one}/isocnc-control.${name}`).find(existsSync);
      if (!found) return;
      clearInterval(look);
      resolve(found);
    }, 100);
  });
  // The socket is there before somebody listens.
  await until("the network", () => state().then((now) => now === "disabled", () => false));
  const puppeteer = createRequire(join(root, "panel/web/package.json"))("puppeteer-core");
  browser = await puppeteer.launch({
    executablePath: chromium,
    // As root without a sandbox; a graphics card by software.
    args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
  });
});

after(async () => {
  await browser?.close();
  control?.removeAllListeners("exit");
  control?.kill("SIGINT");
  if (folder) rmSync(folder, { recursive: true });
});

/** A part of lines and one tool change, some seconds long. */
const PART = `G21 G90 G54
T1 M6
S2000 M3
G0 X0 Y0 Z5
G1 Z0 F1200
${Array.from({ length: 20 }, (_, i) => `G1 X${i % 2 ? 0 : 40} Y${2 * i} F1800`).join("\n")}
G0 Z5
M5
M2
`;

test("a day at the machine", { skip, timeout: 300_000 }, async (day) => {
  const page = await open();

  await day.test("drives on, home", async () => {
    await click(page, "power");
    await shown(page, ["ready"]);
    await go(page, "setup");
    await click(page, "home-all");
    await until("all joints homed", async () => (await ask("status")).homed.length === 3);
    await shown(page, ["ready"]);
    await picture(page, "setup");
  });

  await day.test("a line of MDI, touch off", async () => {
    await page.type(id("mdi"), "G53 G0 X30 Y20 Z-40");
    await click(page, "mdi-send");
    await until("where it was sent", async () => {
      const { position_mm, state } = await ask("status");
      return state === "ready" && Math.hypot(position_mm[0] - 30, position_mm[1] - 20, position_mm[2] + 40) < 0.01;
    });
    await click(page, "part-touch-off");
    for (const axis of ["x", "y", "z"]) {
      await click(page, `touch-off-${axis}`);
      await page.waitForFunction((axis) => Number(document.querySelector(`[data-testid=dro-${axis}]`).textContent) === 0, {}, axis);
    }
    const { work_offset_mm } = await ask("status");
    assert.deepEqual(work_offset_mm.slice(0, 3).map((value) => Math.round(value)), [30, 20, -40]);
    await picture(page, "touch-off");
  });

  await day.test("send a program, see its path", async () => {
    await go(page, "programs");
    writeFileSync(join(folder, "part.ngc"), PART);
    const input = await page.waitForSelector(id("upload"));
    await input.uploadFile(join(folder, "part.ngc"));
    await until("the program", async () => (await ask("status")).program?.name?.includes("part.ngc"));
    await go(page, "operate");
    await page.waitForFunction(() => document.querySelector("[data-testid=path]")?.dataset.whole === "true", { timeout: 60_000 });
    assert.equal(await page.$eval(id("path"), (canvas) => canvas.dataset.renderer), "webgl2");
    await page.waitForFunction(() => /^\d+ segments$/.test(document.querySelector("[data-testid=path-note]").textContent), { timeout: 60_000 });
    // More than 20 moves, all of them drawn.
    assert.ok((await page.$eval(id("path"), (canvas) => Number(canvas.dataset.segments))) >= 20);
    const before = await colours(page);
    assert.ok(before.light > 200, JSON.stringify(before));
    assert.equal(before.done, 0, "nothing is done yet");
    await picture(page, "loaded");
  });

  await day.test("start, the dialogue of the tool, run", async () => {
    await click(page, "start");
    await page.waitForSelector(id("tool-dialogue"), { timeout: 60_000 });
    assert.match(await text(page, "tool-dialogue"), /T1/);
    await picture(page, "tool");
    // Keys that move the machine do not close it.
    await page.keyboard.press("Space");
    assert.ok(await page.$(id("tool-dialogue")));
    await click(page, "tool-changed");
    await page.waitForFunction(() => !document.querySelector("[data-testid=tool-dialogue]"), { timeout: 60_000 });
    await until("it runs", async () => (await ask("status")).line > 8);
    const line = await page.$eval(id("current-line"), (element) => Number(element.dataset.line));
    assert.ok(line > 4, `line ${line}`);
  });

  await day.test("hold, override, resume, the done part in the picture", async () => {
    await click(page, "hold");
    await shown(page, ["held"]);
    await page.$eval(id("feed-override"), (slider) => {
      slider.value = "60";
      slider.dispatchEvent(new Event("input", { bubbles: true }));
    });
    await until("60 %", async () => (await ask("status")).override.feed_percent === 60);
    await until("more than 30 pixels of the done part", async () => (await colours(page)).done > 30);
    await picture(page, "held");
    await click(page, "resume");
    await shown(page, ["running"]);
  });

  await day.test("loaded again in mid program: it goes on, and is shown", async () => {
    await page.reload();
    await page.waitForFunction(() => document.querySelector("[data-testid=state]")?.dataset.state === "running");
    assert.equal(await state(), "running");
    await page.waitForFunction(() => Number(document.querySelector("[data-testid=current-line]")?.dataset.line) > 4, { timeout: 60_000 });
  });

  await day.test("a second client: watches, and stops", async () => {
    const context = await browser.createBrowserContext();
    const other = await open({ context, width: 390, height: 844 });
    await shown(other, ["running"]);
    await picture(other, "phone");
    await click(other, "stop");
    await shown(page, ["ready"]);
    assert.equal(await state(), "ready");
    await context.close();
  });

  await day.test("an emergency stop, an alarm: said, and over only by a person", async () => {
    await ask("estop");
    await shown(page, ["estop"]);
    assert.ok((await text(page, "alarm")).length > 5);
    await picture(page, "estop");
    await click(page, "reset");
    await shown(page, ["disabled"]);
    assert.equal((await text(page, "alarm")).length, 0);
  });

  await day.test("what is refused is said in the words of the control", async () => {
    await click(page, "start");
    await page.waitForSelector(id("toast"));
    assert.match(await text(page, "toast"), /drives are off/);
  });
  await page.close();
});

/** Pixels of the picture that are light, and that have a colour of the done part. */
function colours(page) {
  return page.evaluate(async () => {
    const canvas = document.querySelector("[data-testid=path]");
    // What WebGL has drawn is there until the browser has shown it: read it in the same frame.
    const drawn = canvas.dataset.drawn;
    dispatchEvent(new Event("resize"));
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
    let [light, done] = [0, 0];
    for (let i = 0; i < data.length; i += 4) {
      const [r, g, b] = [data[i], data[i + 1], data[i + 2]];
      const [most, least] = [Math.max(r, g, b), Math.min(r, g, b)];
      if (most > 90) light++;
      // The tool is orange; box, grid and what is to come are nearly grey.
      if (most > 120 && most - least > 90 && !(r > 150 && b < 80)) done++;
    }
    return { light, done: Math.max(0, done - 250) };
  });
}

test("a jog stops when the connection is lost, and when the page is hidden", { skip, timeout: 120_000 }, async () => {
  const page = await open({ hash: "#/setup" });
  if ((await state()) === "disabled") await ask("on");
  await until("on", async () => (await state()) === "ready");
  await ask("home").catch(() => {});
  await until("homed", async () => (await ask("status")).homed.length === 3 && (await state()) === "ready");
  const ways = [
    ["released", () => page.mouse.up()],
    ["offline", () => page.setOfflineMode(true)],
    ["blur", () => page.evaluate(() => window.dispatchEvent(new Event("blur")))],
    ["closed", () => page.close({ runBeforeUnload: false })],
  ];
  for (const [way, lose] of ways) {
    const button = await page.waitForSelector(id("jog-x-plus"));
    const box = await button.boundingBox();
    await page.mouse.move(box.x + 10, box.y + 10);
    await page.mouse.down();
    await until(`${way}: it moves`, async () => (await state()) === "jogging");
    // Longer than the control moves without a word from here: it is renewed.
    await new Promise((wake) => setTimeout(wake, 700));
    assert.equal(await state(), "jogging", way);
    const { cycles } = await ask("status");
    await lose();
    const rest = await until(`${way}: rest`, async () => {
      const status = await ask("status");
      return status.state === "ready" && status;
    }, 5000);
    // Cycles of the machine, 1 ms each, from before the loss until somebody has looked and seen it rest.
    const took = rest.cycles - cycles;
    console.log(`${way}: at rest after ${took} cycles`);
    assert.ok(took <= 300, `${way}: ${took} cycles`);
    if (way === "offline") await page.setOfflineMode(false);
    if (way !== "closed") {
      if (way !== "released") await page.mouse.up();
      await page.waitForFunction(() => document.querySelector("[data-testid=age]")?.classList.contains("fresh"), { timeout: 20_000 });
    }
  }
});

test("the connection is lost: said after a second, crossed out after two, and nothing is sent again", { skip, timeout: 120_000 }, async () => {
  const page = await open();
  // The control stands still for a while, as far as the page can tell.
  control.kill("SIGSTOP");
  await page.waitForFunction(() => document.querySelector("[data-testid=connection]"), { timeout: 10_000 });
  await page.waitForFunction(() => document.querySelector(".dro.stale"), { timeout: 10_000 });
  await picture(page, "lost");
  control.kill("SIGCONT");
  await page.waitForFunction(() => !document.querySelector("[data-testid=connection]"), { timeout: 30_000 });
  assert.ok(!(await page.$(".dro.stale")));
  await page.close();
});

/** Share of the pixels that differ between a picture and the committed one; 0 where it has just been written. */
async function differs(page, name) {
  const { width, height } = page.viewport();
  // What is another at each run: times, messages, numbers of processes, answers of nodes.
  await page.$$eval(".messages, .facts dd, .node small", (all) => all.forEach((element) => (element.style.visibility = "hidden")));
  const shot = await page.screenshot({ type: "webp", quality: 70, clip: { x: 0, y: 0, width, height, scale: 0.5 } });
  const file = join(root, "tests/panel/screens", `${name}.webp`);
  if (process.env.SCREENS === "write") {
    mkdirSync(join(root, "tests/panel/screens"), { recursive: true });
    writeFileSync(file, shot);
    return 0;
  }
  const pictures = [readFileSync(file), shot].map((octets) => `data:image/webp;base64,${Buffer.from(octets).toString("base64")}`);
  return page.evaluate(async (pictures) => {
    const [a, b] = await Promise.all(
      pictures.map(async (source) => {
        const image = new Image();
        image.src = source;
        await image.decode();
        const canvas = document.createElement("canvas");
        [canvas.width, canvas.height] = [image.width, image.height];
        const context = canvas.getContext("2d");
        context.drawImage(image, 0, 0);
        return context.getImageData(0, 0, image.width, image.height);
      }),
    );
    if (a.width !== b.width || a.height !== b.height) return 1;
    let different = 0;
    for (let i = 0; i < a.data.length; i += 4) if ([0, 1, 2].some((k) => Math.abs(a.data[i + k] - b.data[i + k]) > 60)) different++;
    return (4 * different) / a.data.length;
  }, pictures);
}

/** What times, counters and other fonts may come to. */
const DIFFERENT_MAX = 0.04;

test("pages look as they did, have no serious finding of axe, are no wider than the screen, and their buttons are 44 px", { skip, timeout: 300_000 }, async () => {
  const axe = readFileSync(join(modules, "axe-core/axe.min.js"), "utf8");
  if ((await state()) === "disabled") await ask("on");
  await until("on", async () => (await state()) === "ready");
  if ((await ask("status")).homed.length < 3) await ask("home");
  await until("homed", async () => (await ask("status")).homed.length === 3 && (await state()) === "ready");
  await ask("mdi", { line: "G53 G0 X30 Y20 Z-40" });
  await until("there", async () => {
    const { position_mm, activity } = await ask("status");
    return activity === "idle" && Math.abs(position_mm[0] - 30) < 0.01;
  });
  await ask("program.load", { name: "part.ngc", text: PART });
  const all = [];
  for (const [width, height] of [[1280, 800], [800, 480], [390, 844]]) {
    const page = await open({ width, height });
    for (const where of ["operate", "setup", "programs", "bus", "machine"]) {
      await page.evaluate(() => (document.documentElement.dataset.theme = "dark"));
      await go(page, where);
      await new Promise((wake) => setTimeout(wake, 1200));
      await picture(page, `${where}-${width}`);
      const different = await differs(page, `${where}-${width}`);
      if (different > DIFFERENT_MAX) all.push(`${where} at ${width}: ${(100 * different).toFixed(1)} % of its pixels differ from tests/panel/screens`);
      const wide = await page.evaluate(() => [...document.querySelectorAll("button, a, input")].filter((element) => element.offsetParent && element.getBoundingClientRect().width > 1 && !element.closest(".scroll")).filter((element) => {
        const { right, left } = element.getBoundingClientRect();
        return right > innerWidth + 1 || left < -1;
      }).map((element) => element.outerHTML.slice(0, 120)));
      all.push(...wide.map((one) => `${where} at ${width}: beyond the screen: ${one}`));
      const small = await page.evaluate(() => [...document.querySelectorAll("button, nav a")].filter((element) => element.offsetParent).filter((element) => {
        const { width, height } = element.getBoundingClientRect();
        return width < 43.5 || height < 43.5;
      }).map((element) => element.outerHTML.slice(0, 160)));
      all.push(...small.map((one) => `${where} at ${width}: too small for a finger: ${one}`));
      for (const theme of ["dark", "light"]) {
        await page.evaluate((theme) => (document.documentElement.dataset.theme = theme), theme);
        await page.evaluate(axe);
        const found = await page.evaluate(() => axe.run(document, { runOnly: ["wcag2a", "wcag2aa"] }).then(({ violations }) => violations.filter(({ impact }) => ["serious", "critical"].includes(impact)).map(({ id, nodes }) => `${id}: ${nodes.map(({ html, any }) => `${html.slice(0, 120)} ${any[0]?.message ?? ""}`).join(" | ")}`)));
        all.push(...found.map((one) => `${where} at ${width}, ${theme}: ${one}`));
      }
    }
    await page.close();
  }
  assert.deepEqual(all, []);
});

test("nothing went wrong in any page: no error, no breach of the policy, nothing fetched from elsewhere", { skip }, () => {
  assert.deepEqual(troubles, []);
});
