// The cycle of a control with the link to a supervisor and without it, in turns: node tests/panel/cell-figures.mjs [ROUNDS]
// Nothing is asserted: run it on a PC that does nothing else, with ISOCNC and ISOCNC_CELL the programs, the first built with --features cell.
import { execFileSync, spawn } from "node:child_process";
import { createConnection } from "node:net";
import { existsSync, mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { loadavg, tmpdir } from "node:os";
import { join } from "node:path";
import { machineFile, program, root } from "./start.mjs";

const supervisor = process.env.ISOCNC_CELL ?? join(root, "target/debug/isocnc-cell");
const rounds = Number(process.argv[2] ?? 6);
const port = 20_000 + (process.pid % 20_000);
const folder = mkdtempSync(join(tmpdir(), "cell-figures-"));
const cell = (...args) => execFileSync(supervisor, args, { cwd: folder, encoding: "utf8" });
const sleep = (ms) => new Promise((wake) => setTimeout(wake, ms));
const until = async (what, holds) => {
  for (const end = Date.now() + 60_000; Date.now() < end; await sleep(50)) {
    const last = await Promise.resolve().then(holds).catch(() => false);
    if (last) return last;
  }
  throw new Error(`did not come: ${what}`);
};
const median = (all) => all.toSorted((a, b) => a - b)[Math.floor(all.length / 2)];

cell("ca", "init", "--dir", "ca");
cell("ca", "issue", "mill", "--dir", "ca");
const keeps = spawn(supervisor, ["run", "--dir", "state", "--ca", "ca", "--listen", `127.0.0.1:${port}`], { cwd: folder, stdio: ["ignore", "ignore", "inherit"] });
const link = `\n[cell]\nsupervisor = "127.0.0.1:${port}"\ncertificate = "ca/mill.crt"\nkey = "ca/mill.key"\nca = "ca/ca.crt"\nremote = "run"\n`;
const moves = Array.from({ length: 1500 }, (_, i) => `G1 X${i % 2 ? 60 : 0} Y${i % 50} F3000`);
const text = ["G21 G90 G54", ...moves, "M2", ""].join("\n");

/** Mean of what a cycle took and how late it began, us, while a program runs. */
async function measure(kind) {
  const name = `cell-${process.pid}-${kind}`;
  const file = machineFile(name).replace("\ncycle_us", `\nstate_directory = "${kind}"\ncycle_us`) + (kind === "with" ? link : "");
  writeFileSync(join(folder, `${kind}.toml`), file);
  const control = spawn(program, ["run", `${kind}.toml`], { cwd: folder, stdio: ["ignore", "ignore", "inherit"] });
  const folders = ["/run/isocnc", `${process.env.XDG_RUNTIME_DIR ?? "/none"}/isocnc`, `/dev/shm/isocnc-${process.getuid()}`];
  const path = () => folders.map((one) => `${one}/isocnc-control.${name}`).find(existsSync);
  const ask = (method, params = {}) =>
    new Promise((resolve, reject) => {
      const socket = createConnection(path());
      let told = "";
      socket.on("connect", () => socket.write(`${JSON.stringify({ jsonrpc: "2.0", id: 1, method, params })}\n`));
      socket.on("error", reject);
      socket.on("data", (data) => {
        told += data;
        if (!told.includes("\n")) return;
        socket.end();
        const { result, error } = JSON.parse(told);
        return error ? reject(new Error(error.message)) : resolve(result);
      });
    });
  try {
    await until("a control", () => path());
    await until("the network", async () => (await ask("status")).state === "disabled");
    await ask("program.run", { name: "moves.ngc", text });
    await until("motion", async () => (await ask("status")).line > 3);
    if (kind === "with") await until("the link", () => JSON.parse(cell("machines", "--dir", "state", "--json")).machines.some((one) => one.alive));
    const sums = async () => {
      const { text } = await ask("metrics");
      const of = (name) => Number(text.match(new RegExp(`^isocnc_${name} (.*)$`, "m"))[1]);
      return ["compute", "lateness"].map((what) => [of(`cycle_${what}_seconds_sum`), of(`cycle_${what}_seconds_count`)]);
    };
    const before = await sums();
    await sleep(6000);
    const after = await sums();
    return after.map(([sum, count], i) => (1e6 * (sum - before[i][0])) / (count - before[i][1]));
  } finally {
    control.kill("SIGTERM");
    await new Promise((ended) => (control.exitCode === null ? control.once("exit", ended) : ended()));
  }
}

try {
  const all = { with: [], without: [] };
  for (let round = 0; round < rounds; round++) {
    // Who comes first goes to and fro.
    for (const kind of round % 2 ? ["with", "without"] : ["without", "with"]) all[kind].push(await measure(kind));
  }
  ["compute", "lateness"].forEach((what, i) => {
    const [a, b] = ["with", "without"].map((kind) => all[kind].map((one) => one[i]));
    const list = (figures) => figures.map((one) => one.toFixed(1)).join(" ");
    console.log(
      `${what} of a cycle with the link and without, ${rounds} windows of 6 s of each in turn: ` +
        `${median(a).toFixed(1)} and ${median(b).toFixed(1)} us, ratio ${(median(a) / median(b)).toFixed(3)} (load ${loadavg()[0].toFixed(1)}; with ${list(a)}; without ${list(b)})`,
    );
  });
} finally {
  keeps.kill("SIGKILL");
  rmSync(folder, { recursive: true, force: true });
}
