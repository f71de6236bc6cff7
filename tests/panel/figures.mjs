// Figures of the panel, with the load of the PC beside them: node tests/panel/figures.mjs [click] [rate] [cycle] [first] [million]
// Nothing is asserted: run it on a PC that does nothing else, with ISOCNC=target/release/isocnc.
import { execFileSync } from "node:child_process";
import { readFileSync, readdirSync, rmSync, writeFileSync } from "node:fs";
import { createConnection } from "node:net";
import { availableParallelism, loadavg } from "node:os";
import { join } from "node:path";
import { launch, missing, start, until } from "./start.mjs";

if (missing) throw new Error(`there is no ${missing}`);
const port = 20_000 + (process.pid % 20_000);
const url = `http://127.0.0.1:${port}/`;
const wanted = process.argv.slice(2);
const wants = (name) => wanted.length === 0 || wanted.includes(name);
const sleep = (ms) => new Promise((wake) => setTimeout(wake, ms));
/** Time of all processors, and what of it others took of this virtual machine, ticks. */
const ticks = () => {
  const all = readFileSync("/proc/stat", "utf8").split("\n")[0].split(/\s+/).slice(1, 9).map(Number);
  return { all: all.reduce((a, b) => a + b), steal: all[7] };
};
let before = ticks();
const told = (what, figure) => {
  const now = ticks();
  const steal = (100 * (now.steal - before.steal)) / Math.max(1, now.all - before.all);
  before = now;
  console.log(`${what.padEnd(64)} ${figure}   (load ${loadavg()[0].toFixed(1)}, steal ${steal.toFixed(1)} %)`);
};
const quantile = (all, q) => all.toSorted((a, b) => a - b)[Math.min(all.length - 1, Math.floor(q * all.length))];

const { folder, control, ask } = await start(port);
const browser = await launch();
try {
  await until(ask, "the network", () => ask("status").then(({ state }) => state === "disabled", () => false));
  const tab = async () => {
    const page = await browser.newPage();
    await page.setViewport({ width: 1280, height: 800 });
    return page;
  };
  const page = async (hash = "") => {
    const page = await tab();
    await page.goto(url + hash);
    await page.waitForFunction(() => document.querySelector("[data-testid=state]")?.dataset.state);
    return page;
  };

  if (wants("first")) {
    const times = [];
    for (let i = 0; i < 10; i++) {
      const context = await browser.createBrowserContext();
      const fresh = await context.newPage();
      const begin = performance.now();
      await fresh.goto(url);
      await fresh.waitForFunction(() => document.querySelector("[data-testid=dro-x]") && document.querySelector("[data-testid=state]")?.dataset.state, { polling: "raf" });
      times.push(performance.now() - begin);
      await context.close();
    }
    told("first view with positions, nothing in the cache, of 10", `median ${quantile(times, 0.5).toFixed(0)} ms, worst ${Math.max(...times).toFixed(0)} ms`);
  }

  if (wants("click")) {
    // A switch that the cycle thread takes: from the click until it was taken, as the control says, and until the page shows it.
    const one = await page("#/operate");
    const [taken, answered, shown] = await one.evaluate(async () => {
      const button = document.querySelector("[data-testid=single-block]");
      const now = () => performance.timeOrigin + performance.now();
      const socket = new WebSocket(`ws://${location.host}/rpc`);
      await new Promise((resolve) => (socket.onopen = resolve));
      let id = 0;
      const orders = () =>
        new Promise((resolve) => {
          socket.onmessage = ({ data }) => resolve(JSON.parse(data).result.orders);
          socket.send(JSON.stringify({ jsonrpc: "2.0", id: ++id, method: "cycle.times" }));
        });
      const all = [[], [], []];
      // The two clocks of this PC are one; what they are apart is less than the way there and back.
      let { taken } = await orders();
      for (let i = 0; i < 500; i++) {
        const changed = new Promise((resolve) => {
          const watch = new MutationObserver(() => {
            watch.disconnect();
            resolve();
          });
          watch.observe(button, { attributes: true, attributeFilter: ["aria-pressed"] });
        });
        const begin = now();
        button.click();
        let answer;
        do answer = await orders();
        while (answer.taken === taken);
        all[1].push(now() - begin);
        taken = answer.taken;
        all[0].push(1000 * answer.last_unix_s - begin);
        await changed;
        all[2].push(now() - begin);
        await new Promise((wake) => setTimeout(wake, 80 + Math.random() * 20));
      }
      socket.close();
      return all;
    });
    await one.close();
    const figure = (times) => `median ${quantile(times, 0.5).toFixed(1)} ms, p99 ${quantile(times, 0.99).toFixed(1)} ms, worst ${Math.max(...times).toFixed(1)} ms`;
    told("click to the cycle thread, which takes the order, of 500", figure(taken));
    told("the same until another client has asked and knows it", figure(answered));
    told("the same until the page shows it, told 20 times a second", figure(shown));
  }

  /** Clients at 20 Hz; how many messages they hear is counted. */
  const clients = (one, count) =>
    one.evaluate(
      (count) =>
        new Promise((resolve) => {
          window.heard = 0;
          window.all = Array.from({ length: count }, () => {
            const socket = new WebSocket(`ws://${location.host}/rpc`);
            socket.onopen = () => socket.send(JSON.stringify({ jsonrpc: "2.0", id: 1, method: "subscribe", params: { rate_hz: 20 } }));
            socket.onmessage = () => window.heard++;
            return socket;
          });
          setTimeout(resolve, 1000);
        }),
      count,
    );
  const gone = (one) => one.evaluate(() => window.all.forEach((socket) => socket.close()));
  /** Time of processors of the threads of these names, s. */
  const used = (names) => {
    let ticks = 0;
    for (const task of readdirSync(`/proc/${control.pid}/task`)) {
      const stat = readFileSync(`/proc/${control.pid}/task/${task}/stat`, "utf8");
      const name = stat.slice(stat.indexOf("(") + 1, stat.lastIndexOf(")"));
      const fields = stat.slice(stat.lastIndexOf(")") + 2).split(" ");
      if (names.includes(name)) ticks += Number(fields[11]) + Number(fields[12]);
    }
    return ticks / 100;
  };
  const blank = async () => {
    const one = await browser.newPage();
    await one.goto(`${url}licences.txt`);
    return one;
  };
  /** Something that moves for minutes. */
  const moving = async () => {
    const lines = Array.from({ length: 1500 }, (_, i) => `G1 X${i % 2 ? 60 : 0} Y${i % 50} F3000`);
    await ask("program.run", { name: "moves.ngc", text: ["G21 G90 G54", ...lines, "M2", ""].join("\n") });
    await until(ask, "it runs", async () => (await ask("status")).line > 3);
  };

  if (wants("rate")) {
    await moving();
    const one = await blank();
    const measure = async (count, s) => {
      await clients(one, count);
      const [before, heard] = [used(["panel", "service"]), await one.evaluate(() => window.heard)];
      await sleep(1000 * s);
      const [took, more] = [used(["panel", "service"]) - before, (await one.evaluate(() => window.heard)) - heard];
      await gone(one);
      await sleep(500);
      return [took / s, count ? more / s / count : 0];
    };
    const [idle] = await measure(0, 10);
    const [ten, rate] = await measure(10, 20);
    told("20 Hz to 10 clients while a program runs", `${(100 * (ten - idle)).toFixed(2)} % of a core (${rate.toFixed(1)} messages/s each; without clients ${(100 * idle).toFixed(2)} %)`);
    await one.close();
    await ask("stop");
  }

  /** Clients at 20 Hz without a browser, which would take the processor from the cycle itself; ends them. */
  const bare = async (count) => {
    const send = (socket, text) => socket.write(Buffer.concat([Buffer.from([0x81, 0x80 | text.length, 0, 0, 0, 0]), Buffer.from(text)]));
    const all = await Promise.all(
      Array.from({ length: count }, async () => {
        const socket = createConnection(port, "127.0.0.1");
        socket.on("error", () => {});
        const upgrade = ["GET /rpc HTTP/1.1", `Host: 127.0.0.1:${port}`, "Upgrade: websocket", "Connection: Upgrade", "Sec-WebSocket-Version: 13", "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ=="];
        socket.write(`${upgrade.join("\r\n")}\r\n\r\n`);
        await new Promise((resolve) => socket.once("data", resolve));
        send(socket, '{"jsonrpc":"2.0","id":1,"method":"subscribe","params":{"rate_hz":20}}');
        socket.heard = 0;
        // Read and counted, no more: a window is over before a sign of life is missed.
        socket.on("data", (data) => (socket.heard += data.length));
        return socket;
      }),
    );
    await sleep(1000);
    return () => {
      const silent = all.filter((socket) => socket.heard < 5_000).length;
      if (silent > 0) throw new Error(`${silent} of ${count} clients were told nothing`);
      all.forEach((socket) => socket.destroy());
    };
  };

  if (wants("cycle")) {
    // Clients have PCs of their own: here they keep off the last core, the one of the cycle.
    const others = `0-${Math.max(0, availableParallelism() - 2)}`;
    for (const pid of [process.pid, browser.process().pid]) execFileSync("taskset", ["-apc", others, `${pid}`]);
    await until(ask, "rest", async () => (await ask("status")).activity === "idle");
    await moving();
    const kinds = [0, 10, 50];
    const windows = 24;
    const sums = Object.fromEntries(kinds.map((count) => [count, []]));
    const mean = async () => {
      const { text } = await ask("metrics");
      const of = (name) => Number(text.match(new RegExp(`^isocnc_${name} (.*)$`, "m"))[1]);
      return ["compute", "lateness"].map((what) => [of(`cycle_${what}_seconds_sum`), of(`cycle_${what}_seconds_count`)]);
    };
    for (let round = 0; round < windows * kinds.length; round++) {
      // Each is in turn the first of its round: what the rest of the PC does is not that of one of them.
      const turn = Math.floor(round / kinds.length);
      const count = kinds[(round + turn) % kinds.length];
      const end = await bare(count);
      const before = await mean();
      await sleep(1500);
      const after = await mean();
      end();
      await sleep(300);
      sums[count].push(after.map(([sum, count], i) => (1e6 * (sum - before[i][0])) / (count - before[i][1])));
    }
    ["compute", "lateness"].forEach((what, i) => {
      const [none, ...others] = kinds.map((count) => sums[count].map((all) => all[i]));
      const words = others.map((all, at) => {
        // To the window without clients of the same round.
        const ratios = all.map((us, round) => us / none[round]);
        const [low, middle, high] = [0.25, 0.5, 0.75].map((q) => quantile(ratios, q).toFixed(3));
        return `${kinds[at + 1]} clients at 20 Hz ${quantile(all, 0.5).toFixed(2)} us, ratio ${middle} (${low} to ${high})`;
      });
      told(`${what} of a cycle, medians of ${windows} rounds (half of them)`, `without clients ${quantile(none, 0.5).toFixed(2)} us; ${words.join("; ")}`);
    });
    await ask("stop");
  }

  if (wants("million")) {
    await until(ask, "rest", async () => (await ask("status")).activity === "idle", 60_000);
    const lines = Array.from({ length: 1_000_000 }, (_, i) => {
      const [angle, radius] = [i * 0.02, 30 + 20 * Math.sin(i * 1e-5)];
      return `G1 X${(60 + radius * Math.cos(angle)).toFixed(3)} Y${(60 + radius * Math.sin(angle)).toFixed(3)} Z${(-i * 1e-5).toFixed(4)} F3000`;
    });
    const path = join(folder, "million.ngc");
    writeFileSync(path, ["G21 G90 G54", "G0 X60 Y60", ...lines, "M2", ""].join("\n"));
    const checked = performance.now();
    await ask("program.load", { path });
    told("1,000,000 segments: checked and loaded", `${((performance.now() - checked) / 1000).toFixed(1)} s`);
    // A new tab may have to wait for the browser, which the panel cannot help.
    const one = await tab();
    const begin = performance.now();
    await one.goto(`${url}#/operate`);
    await one.waitForFunction(() => Number(document.querySelector("[data-testid=path]")?.dataset.segments) > 1000 && Number(document.querySelector("[data-testid=path]").dataset.drawn) > 0, { timeout: 120_000, polling: 20 });
    told("1,000,000 segments: first picture", `${((performance.now() - begin) / 1000).toFixed(2)} s`);
    await one.waitForFunction(() => document.querySelector("[data-testid=path]").dataset.whole === "true", { timeout: 600_000 });
    const { segments, renderer } = await one.$eval("[data-testid=path]", ({ dataset }) => ({ ...dataset }));
    told(`1,000,000 segments: all of ${segments} drawn (${renderer}, SwiftShader)`, `${((performance.now() - begin) / 1000).toFixed(1)} s`);
    const frames = await one.evaluate(async () => {
      const canvas = document.querySelector("[data-testid=path]");
      const drawn = () => Number(canvas.dataset.drawn);
      const [first, begin] = [drawn(), performance.now()];
      const { left, top, width, height } = canvas.getBoundingClientRect();
      const send = (kind, x) => canvas.dispatchEvent(new PointerEvent(kind, { pointerId: 1, bubbles: true, button: 0, buttons: 1, clientX: left + width / 2 + x, clientY: top + height / 2 }));
      send("pointerdown", 0);
      let x = 0;
      while (performance.now() - begin < 5000) {
        send("pointermove", (x += 2) % 200);
        await new Promise((resolve) => requestAnimationFrame(resolve));
      }
      send("pointerup", x % 200);
      return ((drawn() - first) * 1000) / (performance.now() - begin);
    });
    told("1,000,000 segments: turned for 5 s (SwiftShader)", `${frames.toFixed(1)} frames/s`);
    await one.close();
  }
} finally {
  await browser.close();
  control.removeAllListeners("exit");
  control.kill("SIGINT");
  rmSync(folder, { recursive: true });
}
