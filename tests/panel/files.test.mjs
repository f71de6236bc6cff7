// What can be told of the panel without a browser: node --test tests/panel/files.test.mjs
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { existsSync, mkdtempSync, readFileSync, readdirSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { test } from "node:test";
import { gzipSync } from "node:zlib";

const panel = new URL("../../panel/", import.meta.url).pathname;
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

test("what is committed is what the sources give", (context) => {
  if (!existsSync(join(panel, "web/node_modules"))) return context.skip("npm ci has not been run in panel/web");
  const out = mkdtempSync(join(tmpdir(), "panel-"));
  try {
    execFileSync("node", ["build.mjs", out], { cwd: join(panel, "web"), stdio: "inherit" });
    assert.deepEqual(readdirSync(out), readdirSync(dist));
    for (const name of readdirSync(out)) assert.ok(readFileSync(join(out, name)).equals(readFileSync(join(dist, name))), name);
  } finally {
    rmSync(out, { recursive: true });
  }
});
