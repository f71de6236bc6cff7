// Builds ../dist from src with the tools, the style and the modules of the panel: npm ci in crates/panel/web, then
// node crates/cell/web/build.mjs [FOLDER]. The same sources give the same octets.
import { cpSync, mkdirSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { fileURLToPath } from "node:url";

const panel = new URL("../../panel/web/", import.meta.url);
const here = (path) => fileURLToPath(new URL(path, import.meta.url));
const { build } = createRequire(new URL("package.json", panel))("esbuild");
const out = process.argv[2] ?? here("../dist");
rmSync(out, { recursive: true, force: true });
mkdirSync(out, { recursive: true });
await build({
  absWorkingDir: here("."),
  entryPoints: { cell: "src/main.tsx", style: "src/cell.css" },
  outdir: out,
  bundle: true,
  format: "esm",
  target: ["es2022", "chrome100", "firefox100", "safari15.4"],
  jsx: "automatic",
  jsxImportSource: "preact",
  nodePaths: [fileURLToPath(new URL("node_modules", panel))],
  minify: true,
  legalComments: "none",
  external: ["*.svg"],
});
cpSync(here("src/index.html"), `${out}/index.html`);
cpSync(fileURLToPath(new URL("src/icon.svg", panel)), `${out}/icon.svg`);
const lock = JSON.parse(readFileSync(new URL("package-lock.json", panel), "utf8"));
const { version, license } = lock.packages["node_modules/preact"];
const text = readFileSync(new URL("node_modules/preact/LICENSE", panel), "utf8").replaceAll("\r\n", "\n").trim();
writeFileSync(`${out}/licences.txt`, `The page contains:\n\npreact ${version} (${license})\n\n${text}\n`);
