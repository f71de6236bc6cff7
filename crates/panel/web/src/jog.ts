/**
 * Moving by hand: as long as a button or a key is held, and never longer.
 *
 * The control stops by itself 0.2 s after the last word of the hand. Each way in which a hand can leave sends a stop as well, and a
 * page that draws no more (hidden, frozen, busy) says nothing any more.
 */
import type { Letter } from "./machine";
import { ask, connection, getStore, isBlind, subscribe, tellRefused } from "./store";

/** An axis by its letter, or a joint by its number. */
export type What = { axis: Letter } | { joint: number };

const KEEP_MS = 60;
/** A page that has not drawn for so long is not in front of anybody. */
const FRAME_MS = 200;

let held: What[] = [];
let frame = 0;
let timer = 0;

function drawn(): void {
  frame = performance.now();
  if (held.length) requestAnimationFrame(drawn);
}

/** Moves until `release`; velocities in mm/s or degrees/s, signed. */
export function press(moves: { what: What; velocity_mm_s: number }[]): void {
  release();
  if (isBlind()) return tellRefused({ code: 0, message: "" });
  held = moves.map(({ what }) => what);
  drawn();
  for (const { what, velocity_mm_s } of moves) {
    ask("jog", { ...what, velocity_mm_s }).catch((error) => {
      // What is refused is not held.
      if (held.includes(what)) release();
      tellRefused(error);
    });
  }
  timer = window.setInterval(keep, KEEP_MS);
}

function keep(): void {
  if (performance.now() - frame > FRAME_MS || document.visibilityState !== "visible") return release();
  // Refused once it has come to its soft limit: it stands there until the hand leaves.
  for (const what of held) connection.call("jog.keep", { ...what }).catch(() => {});
}

/** The hand has left. */
export function release(): void {
  clearInterval(timer);
  const before = held;
  held = [];
  for (const what of before) connection.call("jog.stop", { ...what }).catch(() => {});
}

/** One step. */
export function step(what: What, distance_mm: number, velocity_mm_s: number): void {
  if (isBlind()) return tellRefused({ code: 0, message: "" });
  ask("jog", { ...what, velocity_mm_s, distance_mm }).catch(tellRefused);
  // A step is short, or is renewed for as long as it takes: until it is done, or a button is released elsewhere.
  const until = performance.now() + (1000 * Math.abs(distance_mm)) / Math.max(0.01, velocity_mm_s) + 1500;
  // What is told of the machine may be of before it began.
  let begun = false;
  const renew = window.setInterval(() => {
    const activity = getStore().status?.activity;
    begun ||= activity === "jogging";
    if (performance.now() > until || (begun && activity === "idle") || document.visibilityState !== "visible") clearInterval(renew);
    else connection.call("jog.keep", { ...what }).catch(() => clearInterval(renew));
  }, KEEP_MS);
}

export const isHeld = (): boolean => held.length > 0;

for (const [target, name] of [
  [window, "blur"],
  [window, "pagehide"],
  [window, "pointerup"],
  [window, "pointercancel"],
  [document, "visibilitychange"],
  [document, "freeze"],
] as const) {
  target.addEventListener(name, () => held.length && release());
}
subscribe(() => {
  if (held.length && !getStore().connected) release();
});
