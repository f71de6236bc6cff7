// Builds ../dist from src: the panel, the page of `isocnc init`, a style sheet, modules. The same sources give the same octets.
import { build } from "esbuild";
import { cpSync, mkdirSync, readFileSync, readdirSync, rmSync, writeFileSync } from "node:fs";

/** Rows of a table of the docs: its cells. */
const docs = (name) => readFileSync(new URL(`../../../docs/${name}.md`, import.meta.url), "utf8");
const rows = (text) => text.split("\n").filter((line) => line.startsWith("| ")).map((line) => line.slice(2, -2).split(" | "));
// What docs/faults.md says of each code of docs/alarms.md.
const explained = new Map(rows(docs("faults").split("\n## Faults\n")[1]).map(([fault, what, , remedy]) => [fault, { what, remedy }]));
const plain = (text) => text.replace(/\[([^\]]*)\]\([^)]*\)/g, "$1");
const faults = Object.fromEntries(
  rows(docs("alarms"))
    .filter(([, , , fault]) => explained.has(fault))
    .map(([code, , , fault]) => [code, { what: plain(explained.get(fault).what), remedy: plain(explained.get(fault).remedy) }]),
);

const out = process.argv[2] ?? "../dist";
rmSync(out, { recursive: true, force: true });
mkdirSync(out, { recursive: true });
await build({
  entryPoints: { app: "src/main.tsx", init: "src/init/main.tsx", style: "src/style.css" },
  outdir: out,
  bundle: true,
  splitting: true,
  format: "esm",
  target: ["es2022", "chrome100", "firefox100", "safari15.4"],
  jsx: "automatic",
  jsxImportSource: "preact",
  minify: true,
  legalComments: "none",
  chunkNames: "[name]-[hash]",
  define: { FAULTS: JSON.stringify(faults) },
  external: ["*.svg"],
});
for (const name of ["index.html", "init.html", "icon.svg"]) cpSync(`src/${name}`, `${out}/${name}`);
const pictures = new URL("../../../docs/pictures/", import.meta.url);
for (const name of readdirSync(pictures)) if (/^probe-.*\.svg$/.test(name)) cpSync(new URL(name, pictures), `${out}/${name}`);

// The licences of what is in there, as their packages have them.
const lock = JSON.parse(readFileSync("package-lock.json", "utf8"));
const parts = Object.keys(JSON.parse(readFileSync("package.json", "utf8")).dependencies).map((name) => {
  const { version, license } = lock.packages[`node_modules/${name}`];
  const text = readFileSync(`node_modules/${name}/LICENSE`, "utf8").replaceAll("\r\n", "\n").trim();
  return `${name} ${version} (${license})\n\n${text}\n`;
});
writeFileSync(`${out}/licences.txt`, `The panel contains:\n\n${parts.join("\n----------------\n\n")}`);
