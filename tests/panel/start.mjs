// A simulated machine with a panel, for whoever drives it in a browser.
import { execFileSync, spawn } from "node:child_process";
import { createConnection } from "node:net";
import { copyFileSync, existsSync, mkdirSync, mkdtempSync, readFileSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join } from "node:path";

export const root = new URL("../../", import.meta.url).pathname;
export const program = process.env.ISOCNC ?? join(root, "target/debug/isocnc");
export const chromium = process.env.CHROMIUM ?? ["/usr/bin/chromium-headless-shell", "/usr/bin/chromium"].find(existsSync);
export const modules = join(root, "crates/panel/web/node_modules");
const serves = () => execFileSync(program, ["run", "--help"], { encoding: "utf8" }).includes("--panel");

/** What is not there; "" where all is. */
export const missing = !existsSync(program) ? program : !serves() ? "option --panel of it" : !chromium ? "Chromium" : !existsSync(modules) ? "npm ci in crates/panel/web" : "";

/** A machine file of a mill in memory. */
export function machineFile(name) {
  return (
    readFileSync(join(root, "configs/mill3-demo.toml"), "utf8")
      .replace('name = "mill3-demo"', `name = "${name}"`)
      .replace('kind = "powerlink"', 'kind = "memory"')
      .replace('interface = "plk0"\n', "")
      // A busy PC leaves cycles out: time stands still then, and the machine bears it, as in tests/common.
      .replace("\nlock_memory = true", "\noverruns_stop = 0\nlock_memory = true")
      .replace("pres_lost_max = 20", "pres_lost_max = 1000")
      .replace("following_error_mm = 2.0", "following_error_mm = 100.0")
      // Somebody changes tools here: the panel's dialogue.
      .replace(/\[\[hal\.net\]\]\nname = "tool-change-loop".*?\n\n/s, "")
  );
}

const MANY = `PROGRAM many
VAR_OUTPUT hold : BOOL; END_VAR
VAR last_of_all : INT; level : ARRAY [0..1199] OF INT; END_VAR
hold := FALSE; level[0] := level[0] + 1; last_of_all := level[0];
END_PROGRAM
`;

/** What holds the feed where the logic says so. */
const HOLD = '\n[[hal.net]]\nname = "guard-hold"\nsource = "logic.many.hold"\ntargets = ["motion.feed-hold"]\n';

/** Starts a control, with `more(folder)` at the end of its machine file; gives its process, its folder and a way to ask it beside the browser. */
export async function start(port, more = () => "") {
  const folder = mkdtempSync(join(tmpdir(), "panel-"));
  const name = `panel-${process.pid}`;
  // Programs in Structured Text, slow ones for a busy PC, one of them with more variables than an answer has, and measurements of an earlier day.
  const logic = [["door", readFileSync(join(root, "configs/logic/door.st"), "utf8")], ["many", MANY]];
  const sections = logic.map(([program, text]) => {
    writeFileSync(join(folder, `${program}.st`), text);
    return `\n[[logic]]\nname = "${program}"\nfile = "${program}.st"\nperiod_ms = 200\n`;
  });
  mkdirSync(join(folder, "state/measurements"), { recursive: true });
  for (const measured of ["step-0", "jitter"]) copyFileSync(join(root, `tests/panel/measured-${measured}.svg`), join(folder, `state/measurements/${measured}.svg`));
  writeFileSync(join(folder, "machine.toml"), machineFile(name).replace("\ncycle_us", '\nstate_directory = "state"\ncycle_us') + HOLD + sections.join("") + more(folder));
  const control = spawn(program, ["run", "machine.toml", "--panel", `127.0.0.1:${port}`], { cwd: folder, stdio: ["ignore", "ignore", "inherit"] });
  const folders = ["/run/isocnc", process.env.XDG_RUNTIME_DIR && `${process.env.XDG_RUNTIME_DIR}/isocnc`, `/dev/shm/isocnc-${process.getuid()}`];
  const path = await new Promise((resolve, reject) => {
    control.on("exit", (code) => reject(new Error(`the control has ended: ${code}`)));
    const look = setInterval(() => {
      const found = folders.filter(Boolean).map((one) => `${one}/isocnc-control.${name}`).find(existsSync);
      if (!found) return;
      clearInterval(look);
      resolve(found);
    }, 100);
  });
  const ask = (method, params = {}) =>
    new Promise((resolve, reject) => {
      const socket = createConnection(path);
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
  return { folder, control, ask };
}

/** Waits until something holds; what it was last is in the message. */
export async function until(ask, what, holds, limit_ms = 60_000) {
  const end = Date.now() + limit_ms;
  while (Date.now() < end) {
    const last = await holds();
    if (last) return last;
    await new Promise((wake) => setTimeout(wake, 50));
  }
  throw new Error(`did not come: ${what}; status ${JSON.stringify(await ask("status")).slice(0, 1500)}`);
}

/** A browser without a screen, as root without a sandbox, a graphics card by software. */
export function launch() {
  const puppeteer = createRequire(join(root, "crates/panel/web/package.json"))("puppeteer-core");
  return puppeteer.launch({
    executablePath: chromium,
    args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-accelerated-2d-canvas"],
  });
}
