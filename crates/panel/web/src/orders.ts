/** Orders as buttons give them, and which of them the control would take at the moment. */
import { ALWAYS, type Store, order } from "./store";
import type { Next, Power, Role, Status } from "./types";

/** What a panel that may only watch orders all the same. Overrides: slower ones. */
const OPEN: ReadonlySet<string> = new Set(["stop", "hold", "estop", "override"]);

/** Whether this panel may never order it, by its role. */
export function isBarred({ role }: Store, what: string, needs: Role = "operate"): boolean {
  return (role === "watch" && !OPEN.has(what)) || (needs === "set-up" && role !== "set-up");
}

/** Whether it would not be sent, or refused by the control: the button is dim then. The control itself decides, and says why. */
export function refuses(store: Store, what: string): boolean {
  const { status, connected, age } = store;
  if (!status || !connected || isBarred(store, what)) return true;
  if (age > 0 && !ALWAYS.has(what)) return true;
  // It always does something: of an idle machine, it ends what a line of MDI has switched on.
  if (what === "stop") return false;
  // Taken, and without effect.
  if (what === "hold" && ["held", "away"].includes(status.activity)) return true;
  const { power, activity, program, waiting } = status;
  const on = power === "on";
  switch (what) {
    case "program start":
      return !on || activity !== "idle" || !program;
    case "hold":
      return !["running", "jogging", "returning"].includes(activity);
    case "estop":
      return isEstop(power);
    case "reverse":
      return activity !== "held";
    case "resume":
      return !["held", "away"].includes(activity) && waiting?.for !== "operator" && !status.single_block;
    case "skip":
      return !["operator", "dwell", "input"].includes(waiting?.for ?? "");
    case "reset":
    case "alarm.acknowledge":
      // An alarm that has stopped no drive is acknowledged at rest.
      return !isEstop(power) && power !== "alarm" && !(status.alarm && ["on", "off"].includes(power) && activity === "idle");
    case "jog":
      return !on || !["idle", "jogging", "held", "away"].includes(activity);
    case "spindle":
    case "coolant":
      return !on || (!["idle", "jogging", "held", "away"].includes(activity) && waiting?.for !== "operator");
    case "home":
      return (!on && power !== "off") || activity !== "idle";
    case "mdi":
      return !on || activity !== "idle" && activity !== "running" || status.homed.length < jointCount(status);
    default:
      return false;
  }
}

/** Whether the machine is at a line of the program that is shown: also while a hand has moved it away from where that is held. */
export function isInProgram({ program, mode, activity, mdi }: Status): boolean {
  return program !== null && activity !== "idle" && (mode === "auto" || (activity === "away" && mdi.length === 0));
}

export function jointCount(status: Status): number {
  return new Set(status.axes.flatMap((axis) => axis.joints)).size;
}

export function isEstop(power: Power | null): boolean {
  return power === "estop" || power === "estop_open";
}

/** After an emergency stop or an alarm. */
export function reset(status: Status): Promise<unknown> {
  return order(isEstop(status.power) ? "estop.reset" : "alarm.acknowledge");
}

interface Step {
  method: "on" | "estop.reset" | "alarm.acknowledge" | "home";
  word: "power-on" | "reset" | "acknowledge" | "home-all";
}

/** Next steps that a button does. */
const STEPS: Partial<Record<Next, Step>> = {
  power_on: { method: "on", word: "power-on" },
  reset_estop: { method: "estop.reset", word: "reset" },
  acknowledge: { method: "alarm.acknowledge", word: "acknowledge" },
  home: { method: "home", word: "home-all" },
};

/** What the control says is the next step, as an order of the panel. */
export function nextStep({ next }: Status): Step | null {
  return next === null ? null : (STEPS[next] ?? null);
}
