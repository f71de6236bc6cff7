// What can be told of the panel without a browser: node --test tests/panel/files.test.mjs
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { existsSync, mkdtempSync, readFileSync, readdirSync, rmSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { test } from "node:test";
import { gzipSync } from "node:zlib";

const root = new URL("../../", import.meta.url).pathname;
const panel = new URL("../../crates/panel/", import.meta.url).pathname;
const dist = join(panel, "dist");
const read = (name) => readFileSync(join(dist, name), "utf8");

test("all that a browser fetches is 300 kB at most", () => {
  const sizes = readdirSync(dist).map((name) => [name, gzipSync(readFileSync(join(dist, name)), { level: 9 }).length]);
  const total = sizes.reduce((sum, [, size]) => sum + size, 0);
  console.log(`${(total / 1000).toFixed(1)} kB gzip: ${sizes.map(([name, size]) => `${name} ${(size / 1000).toFixed(1)}`).join(", ")}`);
  assert.ok(total > 30_000, "hardly anything is there");
  assert.ok(total <= 300_000, `${total} octets`);
});

test("a page has nothing inline, and fetches nothing from elsewhere", () => {
  for (const [name, script] of [["index.html", "app.js"], ["init.html", "init.js"]]) {
    const page = read(name);
    assert.ok(page.includes(`<script type="module" src="${script}"></script>`), name);
    assert.doesNotMatch(page, /<script(?![^>]* src=)/);
    assert.doesNotMatch(page, /<style|\sstyle=|\son\w+=/);
    assert.doesNotMatch(page, /https?:|\/\//);
  }
  assert.doesNotMatch(read("style.css"), /url\((?!"?(?:icon\.svg|data:))|@import/);
});

/** Words that the sources ask for: t("key"), and groups that are put together. */
function sources() {
  const below = (folder) =>
    readdirSync(folder, { withFileTypes: true }).flatMap((entry) =>
      entry.isDirectory() ? below(join(folder, entry.name)) : /\.tsx?$/.test(entry.name) ? [readFileSync(join(folder, entry.name), "utf8")] : [],
    );
  return below(join(panel, "web/src")).join("\n");
}

test("English and German have the same words, all of which are used", () => {
  const [en, de] = ["en", "de"].map((name) => JSON.parse(readFileSync(join(panel, `web/src/messages/${name}.json`), "utf8")));
  assert.deepEqual(Object.keys(de), Object.keys(en));
  const places = (text) => [...text.matchAll(/\{\w+\}/g)].map(([place]) => place).sort();
  for (const key of Object.keys(en)) {
    assert.ok(en[key] && de[key], key);
    assert.deepEqual(places(de[key]), places(en[key]), key);
  }
  const text = sources();
  const groups = [...text.matchAll(/t\(\s*`([\w-]+-)\$\{|word\(\s*"(\w+)"/g)].map(([, a, b]) => a ?? `${b}-`);
  const unused = Object.keys(en).filter((key) => !text.includes(`"${key}"`) && !groups.some((group) => key.startsWith(group)));
  assert.deepEqual(unused, []);
  assert.ok(Object.keys(en).length > 100);
});

/** What the control says, by code: the page is made of its sources. */
function sentences() {
  const lines = readFileSync(join(root, "docs/messages.md"), "utf8").split("\n");
  const rows = lines.filter((line) => line.startsWith("| `")).map((line) => line.slice(2, -2).split(" | "));
  return new Map(rows.map(([code, sentence]) => [code.slice(1, -1), sentence]));
}

const places = (text) => [...text.matchAll(/\{([\w-]+)(?::\.\d+)?\}/g)].map(([, name]) => name);

test("each code of the control has its German, with no other values than the code has", () => {
  const said = sentences();
  const [de, en, buttons] = ["control-de", "control-en", "en"].map((name) => JSON.parse(readFileSync(join(panel, `web/src/messages/${name}.json`), "utf8")));
  assert.ok(said.size > 380, `${said.size}`);
  assert.deepEqual([...said.keys()].filter((code) => !de[code]), []);
  for (const [language, table] of Object.entries({ de, en })) {
    for (const [code, own] of Object.entries(table)) {
      assert.ok(said.has(code), `${language}: the control never says ${code}`);
      assert.deepEqual(places(own).filter((name) => !places(said.get(code)).includes(name)), [], `${language}: ${code}`);
      for (const [, button] of own.matchAll(/\{@([\w-]+)\}/g)) assert.ok(buttons[button], `${language}: ${code}: no button ${button}`);
      assert.doesNotMatch(own, /isocnc (on|off|home|stop|hold|resume|skip|estop|alarm)\b/, `${language}: ${code}: the panel has buttons`);
    }
  }
  // Digits behind the decimal sign are those of the control, where it says how many.
  for (const [code, own] of Object.entries(de)) {
    for (const [place, name] of own.matchAll(/\{(\w+):\.\d+\}/g)) assert.ok(said.get(code).includes(place) || !said.get(code).includes(`{${name}:`), `${code}: ${place}`);
  }
});

test("a message is said in German with all that it contains, and in English where there is no German", async (context) => {
  if (!existsSync(join(panel, "web/node_modules"))) return context.skip("npm ci has not been run in crates/panel/web");
  const { build } = createRequire(join(panel, "web/package.json"))("esbuild");
  const built = await build({ entryPoints: [join(panel, "web/src/control-words.ts")], bundle: true, format: "esm", write: false });
  globalThis.localStorage = { getItem: () => "de" };
  const { inWords } = await import(`data:text/javascript;base64,${Buffer.from(built.outputFiles[0].contents).toString("base64")}`);
  const error = { code: "fault.following_error", params: { error: 2.1, limit: 2 }, text: "following error 2.100 mm above 2.000 mm" };
  const place = { code: "joint.of_axis", params: { axis: "X", joint: 0 }, text: "axis X (joint 0)" };
  const at = { code: "fault.at", params: { place, what: error }, text: `${place.text}: ${error.text}` };
  assert.equal(inWords({ code: "alarm", params: { cause: at }, text: `alarm: ${at.text}` }), "Alarm: Achse X (Gelenk 0): Schleppfehler 2,100 mm, erlaubt sind 2,000 mm");
  const next = { code: "next.power_on", text: "isocnc on" };
  assert.equal(inWords({ code: "refused.drives_off", params: { next }, text: "drives are off: isocnc on" }), "die Antriebe sind aus: „Antriebe ein“");
  assert.equal(inWords({ code: "logic.iterations", text: "" }), "die Schleife hat mehr Durchläufe als erlaubt und endet: mehr erlaubt {max_iterations := n}");
  assert.equal(inWords({ code: "text", params: {}, text: "MDI: G0 X1" }), "MDI: G0 X1");
  assert.equal(inWords({ code: "of.a-newer-control", params: { next }, text: "do: isocnc on; now" }), "do: „Antriebe ein“; now");
});

test("a preview is where the plan is: rapid moves at the speed of their slowest axis, the rest along the other moves", async (context) => {
  if (!existsSync(join(panel, "web/node_modules"))) return context.skip("npm ci has not been run in crates/panel/web");
  const { build } = createRequire(join(panel, "web/package.json"))("esbuild");
  const source = `export { PathData, CHUNK } from "./data"; export { PathTimes } from "./times";`;
  const built = await build({ stdin: { contents: source, resolveDir: join(panel, "web/src/path"), loader: "ts" }, bundle: true, format: "esm", write: false });
  const { PathData, PathTimes, CHUNK } = await import(`data:text/javascript;base64,${Buffer.from(built.outputFiles[0].contents).toString("base64")}`);
  const rapid = (x, y, z) => Math.max(Math.abs(x) / 100, Math.abs(y) / 50, Math.abs(z) / 10);
  const way = new PathData();
  // 1 s of rapid moves, then 30 mm at feed in the other 3 s, in more vertices than a chunk has.
  way.append(0, 0, 0, 0, 10);
  way.append(2, 1, 10, 10, 0);
  for (let i = 1; i <= 2 * CHUNK; i++) way.append(2 + i, 2, 10 + (30 * i) / (2 * CHUNK), 10, 0);
  way.finish();
  const times = new PathTimes(way, 4, rapid);
  assert.equal(times.total, 4);
  const close = ({ place, line }, wanted, at) => {
    for (const [k, value] of wanted.entries()) assert.ok(Math.abs(place[k] - value) < 0.02, `${place} is not ${wanted}`);
    assert.ok(Math.abs(line - at) <= 2, `line ${line} is not ${at}`);
  };
  close(times.at(0), [0, 0, 10], 2);
  close(times.at(0.5), [5, 5, 5], 2);
  close(times.at(1), [10, 10, 0], 2);
  close(times.at(2.5), [25, 10, 0], 2 + CHUNK);
  close(times.at(4), [40, 10, 0], 2 + 2 * CHUNK);
  close(times.at(99), [40, 10, 0], 2 + 2 * CHUNK);
  // The box of what is cut, as the work system is turned.
  const turned = new PathData(90);
  for (const [kind, x, y] of [[0, 500, 0], [1, 0, 0], [2, 0, 40], [1, 0, 900]]) turned.append(1, kind, x, y, 0);
  const size = [0, 1, 2].map((k) => Math.round(turned.feedMax[k] - turned.feedMin[k]));
  assert.deepEqual(size, [40, 0, 0]);
  // Rapid moves alone, or slower than the plan: the sum is the plan's.
  const alone = new PathData();
  for (const [kind, x] of [[0, 0], [1, 100], [1, 300]]) alone.append(1, kind, x, 0, 0);
  close(new PathTimes(alone, 6, rapid).at(3), [150, 0, 0], 1);
  assert.equal(new PathTimes(new PathData(), 6, rapid).total, 0);
});

test("a scale of the oscilloscope has divisions of 1, 2 or 5, holds all and wastes little", async (context) => {
  if (!existsSync(join(panel, "web/node_modules"))) return context.skip("npm ci has not been run in crates/panel/web");
  const { build } = createRequire(join(panel, "web/package.json"))("esbuild");
  const built = await build({ entryPoints: [join(panel, "web/src/divisions.ts")], bundle: true, format: "esm", write: false });
  const { scaleFor, heightOf, digitsOf } = await import(`data:text/javascript;base64,${Buffer.from(built.outputFiles[0].contents).toString("base64")}`);
  assert.deepEqual(scaleFor(30, 60, 8, true), { from: 25, step: 5, divisions: 8 });
  assert.deepEqual(scaleFor(7, 7, 8, true), { from: 3, step: 1, divisions: 8 });
  assert.deepEqual(heightOf(scaleFor(30, 60, 8, true), 0, 1), [25, 65]);
  let seed = 1;
  const random = () => (seed = (seed * 48271) % 2147483647) / 2147483647;
  for (let i = 0; i < 20_000; i++) {
    const middle = (random() - 0.5) * 10 ** (12 * random() - 6);
    const span = 10 ** (14 * random() - 7);
    const [least, greatest, divisions] = [middle - span / 2, middle + span / 2, [2, 4, 8][i % 3]];
    const { from, step } = scaleFor(least, greatest, divisions, i % 2 === 0);
    assert.match(step.toExponential(), /^[125]e/, `${step}`);
    assert.ok(from <= least && from + divisions * step >= greatest, `${least} ${greatest} ${from} ${step}`);
    if (span > 1e-9 * Math.abs(middle)) assert.ok(divisions * step <= 6 * span * (divisions === 2 ? 2 : 1), `${span} on ${divisions * step}`);
    // Each lane has its part of the height, without a gap.
    const [low, high] = heightOf({ from, step, divisions }, 1, 3);
    const share = (value) => (value - low) / (high - low);
    if (span > 1e-6 * Math.abs(middle)) assert.ok(Math.abs(share(from) - 1 / 3) < 1e-6 && Math.abs(share(from + divisions * step) - 2 / 3) < 1e-6);
  }
  for (const strange of [[NaN, 1], [-Infinity, Infinity], [null, null], [-1e308, 1e308], [0, 5e-324], [1e300, 1e300]]) {
    const { step } = scaleFor(...strange, 8, true);
    assert.ok(step > 0 && Number.isFinite(step), `${strange}`);
  }
  assert.deepEqual([digitsOf(5), digitsOf(0.2), digitsOf(0.001), digitsOf(1000)], [0, 1, 3, 0]);
});

test("objects are named as people write them, and their values are octets and back", async (context) => {
  if (!existsSync(join(panel, "web/node_modules"))) return context.skip("npm ci has not been run in crates/panel/web");
  const { build } = createRequire(join(panel, "web/package.json"))("esbuild");
  const built = await build({ entryPoints: [join(panel, "web/src/objects.ts")], bundle: true, format: "esm", write: false });
  const { addressOf, encoded, meaningOf, written, OBJECT_NAMES } = await import(`data:text/javascript;base64,${Buffer.from(built.outputFiles[0].contents).toString("base64")}`);
  for (const [text, wanted] of [["statusword", "0x6041:0"], [" Position Actual-Value ", "0x6064:0"], ["0x6041:0", "0x6041:0"], ["6041.0", "0x6041:0"], ["60FE/1", "0x60FE:1"], ["6041h", "0x6041:0"], ["1018:0x0A", "0x1018:10"], ["2000", "0x2000:0"]]) {
    assert.equal(written(addressOf(text)), wanted, text);
  }
  for (const text of ["", "6041:", "604", "0x60411", "6041:256", "0000", "status", "6041:-1", "6041 0"]) assert.equal(addressOf(text), null, text);
  for (const name of OBJECT_NAMES) assert.ok(addressOf(name), name);
  for (const [text, type, wanted] of [
    ["592", "u16", "5002"],
    ["0x250", "u16", "5002"],
    ["-1", "i32", "ffffffff"],
    ["0xFFFFFFFF", "i32", "ffffffff"],
    ["-0x80", "i8", "80"],
    ["18446744073709551615", "u64", "ffffffffffffffff"],
    ["-9223372036854775808", "i64", "0000000000000080"],
    ["x-drive", "string", "782d6472697665"],
    ["50 02", "bytes", "5002"],
    ["256", "u8", null],
    ["-1", "u8", null],
    ["128", "i8", null],
    ["0x1FF", "i8", null],
    ["1.5", "u8", null],
    ["", "u8", null],
    ["1e3", "u32", null],
    ["5", "bytes", null],
  ]) {
    assert.equal(encoded(text, type), wanted, `${text} ${type}`);
  }
  assert.deepEqual(meaningOf("5002", "u16"), { decimal: "592", hex: "0x0250", text: "", octets: "50 02" });
  assert.deepEqual(meaningOf("ffffffff", "i32"), { decimal: "-1", hex: "0xFFFFFFFF", text: "", octets: "FF FF FF FF" });
  // Without a type, both.
  assert.equal(meaningOf("ff", null).decimal, "255 (-1)");
  assert.equal(meaningOf("05", null).decimal, "5");
  assert.equal(meaningOf("782d647269766500", "string").text, "x-drive");
  assert.equal(meaningOf("5a00", "u16").text, "Z");
  assert.deepEqual(meaningOf("", null), { decimal: "", hex: "", text: "", octets: "" });
  assert.equal(meaningOf("00".repeat(9), null).decimal, "");
});

test("what is committed is what the sources give", (context) => {
  if (!existsSync(join(panel, "web/node_modules"))) return context.skip("npm ci has not been run in crates/panel/web");
  const out = mkdtempSync(join(tmpdir(), "panel-"));
  try {
    execFileSync("node", ["build.mjs", out], { cwd: join(panel, "web"), stdio: "inherit" });
    assert.deepEqual(readdirSync(out), readdirSync(dist));
    for (const name of readdirSync(out)) assert.ok(readFileSync(join(out, name)).equals(readFileSync(join(dist, name))), name);
  } finally {
    rmSync(out, { recursive: true });
  }
});
