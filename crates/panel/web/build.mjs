// Builds ../dist from src: a page, a style sheet, modules. The same sources give the same octets.
import { build } from "esbuild";
import { cpSync, mkdirSync, readFileSync, readdirSync, rmSync, writeFileSync } from "node:fs";

const out = process.argv[2] ?? "../dist";
rmSync(out, { recursive: true, force: true });
mkdirSync(out, { recursive: true });
await build({
  entryPoints: { app: "src/main.tsx", style: "src/style.css" },
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
  external: ["*.svg"],
});
cpSync("src/index.html", `${out}/index.html`);
cpSync("src/icon.svg", `${out}/icon.svg`);
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
