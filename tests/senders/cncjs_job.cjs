// A whole job by cncjs: opens the port, homes, loads a program, starts it, waits until the sender and the machine have ended.
//
// In:  folder with node_modules/cncjs, serial port, file of G-code. Out: exit code 0 and a line with what was seen, or what was missing.
"use strict";
const { spawn } = require("node:child_process");
const { createRequire } = require("node:module");
const fs = require("node:fs");
const os = require("node:os");
const path = require("node:path");

const [folder, serial, job] = process.argv.slice(2);
const from = createRequire(path.join(path.resolve(folder), "node_modules", "cncjs", "package.json"));
const connect = from("socket.io-client");
const tokens = from("jsonwebtoken");

const HTTP_PORT = 20000 + (process.pid % 20000);
const WAIT_MS = 180_000;
const SECRET = "a secret of this test";
const home = fs.mkdtempSync(path.join(os.tmpdir(), "cncjs-"));
const config = path.join(home, "cncrc");
fs.writeFileSync(config, JSON.stringify({ secret: SECRET }));
const args = [from.resolve("cncjs/bin/cncjs"), "--port", HTTP_PORT, "--host", "127.0.0.1", "--config", config];
const server = spawn(process.execPath, args, { stdio: ["ignore", "pipe", "inherit"] });

function end(code, what) {
  console.log(what);
  server.kill();
  fs.rmSync(home, { recursive: true, force: true });
  process.exit(code);
}
const states = [];
setTimeout(() => end(1, `not done in time: ${states.slice(-5)}`), WAIT_MS);

server.stdout.on("data", (text) => {
  if (String(text).includes("Starting the server")) setTimeout(begin, 1000);
});

function begin() {
  const token = tokens.sign({ id: "", name: "" }, SECRET, { expiresIn: "1h" });
  const socket = connect(`http://127.0.0.1:${HTTP_PORT}`, { query: `token=${token}` });
  let step = "open";
  const command = (...what) => socket.emit("command", serial, ...what);
  socket.on("startup", () => socket.emit("open", serial, { controllerType: "Grbl", baudrate: 115200 }, (error) => error && end(1, `open: ${error}`)));
  socket.on("error", (error) => end(1, `error: ${error}`));
  socket.on("controller:state", (_type, state) => {
    const now = state?.status?.activeState;
    if (!now) return;
    if (states[states.length - 1] !== now) states.push(now);
    if (step === "open" && now === "Alarm") {
      step = "home";
      command("homing");
    } else if ((step === "home" || step === "open") && now === "Idle") {
      step = "load";
      command("gcode:load", "job.nc", fs.readFileSync(job, "utf8"), {}, (error) => {
        if (error) end(1, `load: ${error}`);
        step = "run";
        command("gcode:start");
      });
    } else if (step === "sent" && now === "Idle") {
      const ran = states.includes("Run");
      end(ran ? 0 : 1, `done: ${states.join(" ")}`);
    }
  });
  socket.on("serialport:read", (line) => {
    if (/^(error|ALARM)/.test(line) && step === "run") end(1, `${line}: ${states.slice(-5)}`);
  });
  socket.on("sender:status", (status) => {
    // It has an answer to each line, and to the dwell behind the last one.
    if (step === "run" && status.total > 0 && status.received >= status.total && status.finishTime > 0) step = "sent";
  });
}
