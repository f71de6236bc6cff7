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

test("the page has nothing inline, and fetches nothing from elsewhere", () => {
  const page = read("index.html");
  assert.match(page, /<script type="module" src="app\.js"><\/script>/);
  assert.doesNotMatch(page, /<script(?![^>]* src=)/);
  assert.doesNotMatch(page, /<style|\sstyle=|\son\w+=/);
  assert.doesNotMatch(page, /https?:|\/\//);
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

/** Rows of a table of a page. */
function rows(page) {
  const lines = readFileSync(join(root, "docs", page), "utf8").split("\n");
  return lines.filter((line) => line.startsWith("| ")).map((line) => line.slice(1, -1).split(" | ").map((cell) => cell.trim()));
}

/** Texts of a source: string literals of the function behind this line, with numbers as their values. */
function literals(file, from) {
  const text = readFileSync(join(root, file), "utf8");
  const begin = text.indexOf(from);
  assert.ok(begin >= 0, `${file}: ${from}`);
  const body = text.slice(begin, text.indexOf("\n    }\n", begin));
  return [...body.matchAll(/"([^"]+)"/g)].map(([, said]) => said.replace("{input}", "digital input 3").replace(/\{\w+\}/g, "7"));
}

test("what the control says of alarms, of waits and of orders that it refuses has its German", async (context) => {
  if (!existsSync(join(panel, "web/node_modules"))) return context.skip("npm ci has not been run in crates/panel/web");
  const { build } = createRequire(join(panel, "web/package.json"))("esbuild");
  const built = await build({ entryPoints: [join(panel, "web/src/control-words.ts")], bundle: true, format: "esm", write: false });
  const { inGerman } = await import(`data:text/javascript;base64,${Buffer.from(built.outputFiles[0].contents).toString("base64")}`);

  const alarms = rows("alarms.md").filter(([code]) => /^[A-Z]-\d/.test(code)).map(([, text]) => text);
  const states = rows("states.md").flatMap(([order, ...cells]) => [...cells, ...(order.startsWith("`") ? [`order: ${order.slice(1, -1)}`] : [])]);
  const orders = states.filter((cell) => cell.includes(": "));
  const waits = ["text(self) -> String", "release(self) -> &"].flatMap((from) => literals("crates/rt/src/waiting.rs", `pub fn ${from}`));
  const codes = [...readFileSync(join(root, "cia402/src/error_codes.rs"), "utf8").matchAll(/\(0x[\dA-F]{4}, "([^"]+)"\)/g)].map(([, text]) => `x-drive: drive fault 8611h: ${text}`);
  const said = [...alarms, ...orders, ...waits, ...codes];
  assert.ok(alarms.length > 50 && orders.length > 100 && waits.length > 20 && codes.length > 80, `${[alarms, orders, waits, codes].map((all) => all.length)}`);

  // Names of a machine, and commands, which become names of buttons.
  const names = /^(x-drive|cell\.st:12:7|cell\.st|lubrication|no pressure|spindle\.0\.at-speed|isocnc (on|home|resume|estop reset|alarm acknowledge|program load FILE|bus state))$/;
  for (const whole of new Set(said)) {
    // The panel shows how the machine is: words.ts.
    const text = whole.replace(": isocnc status tells how the machine is", "");
    const unknown = [];
    const german = inGerman(text, (part) => unknown.push(part));
    assert.deepEqual(unknown.filter((part) => !names.test(part)), [], text);
    assert.ok(german !== text || unknown.length > 0, text);
    assert.doesNotMatch(german, /\{(?!max_iterations)|undefined/, text);
    // No value of a sentence has taken the rest of another one.
    assert.doesNotMatch(german.replace(/\w+(\.[\w-]+)+/g, "pin"), /\b(the|is|its|it|and|of|to|not|beyond|by|than)\b/, text);
    // Its numbers are told.
    const numbers = (words) => (words.match(/\d+/g) ?? []).sort();
    assert.deepEqual(numbers(german), numbers(text), text);
  }
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
