/** The keyboard: off but for stop, until it is switched on, and in text fields what it always is. */
import { isHeld, press, release } from "./jog";
import { jogSettings } from "./jog-settings";
import { getStore, order, setStore } from "./store";

const AXES: Record<string, [string, 1 | -1]> = {
  ArrowLeft: ["X", -1],
  ArrowRight: ["X", 1],
  ArrowDown: ["Y", -1],
  ArrowUp: ["Y", 1],
  PageDown: ["Z", -1],
  PageUp: ["Z", 1],
};

let key: string | null = null;

export const keys = {
  set(on: boolean): void {
    release();
    key = null;
    document.documentElement.dataset.keys = on ? "on" : "off";
    setStore({ keysOn: on });
  },
};

const isText = (target: EventTarget | null) =>
  target instanceof HTMLElement && (target.isContentEditable || /^(INPUT|TEXTAREA|SELECT)$/.test(target.tagName));

export function listenToKeys(): void {
  document.documentElement.dataset.keys = "off";
  window.addEventListener("keydown", (event) => {
    if (event.key === "Escape" && !event.repeat) {
      release();
      void order("stop");
      event.preventDefault();
      return;
    }
    if (!getStore().keysOn || isText(event.target) || event.ctrlKey || event.altKey || event.metaKey) return;
    if (event.key === " ") {
      event.preventDefault();
      if (!event.repeat) void order("hold");
      return;
    }
    const move = AXES[event.key];
    if (!move) return;
    event.preventDefault();
    if (event.repeat || isHeld()) return;
    const [axis, sign] = move;
    if (!getStore().status?.axes.some((one) => one.axis === axis)) return;
    key = event.key;
    press([{ what: jogSettings.what(axis), velocity_mm_s: sign * jogSettings.speed(axis, event.shiftKey) }]);
  });
  window.addEventListener("keyup", (event) => {
    // Shift let go changes the speed only from the next key on.
    if (event.key === key) {
      key = null;
      release();
    }
  });
}
