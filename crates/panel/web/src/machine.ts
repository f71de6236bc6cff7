/** What the machine is made of: asked for once a connection. */
import { ask, getStore, subscribe } from "./store";

export interface Described {
  machine: string;
  cycle_us: number;
  /** Units of the axis; a second. */
  axes: { axis: string; unit: string; travel: [number, number] | null; velocity_per_s: number | null; joints: number[] }[];
  /** The panel has a folder for programs. */
  programs: boolean;
}

let described: Described | null = null;
let asked = false;
const listeners = new Set<() => void>();

subscribe(() => {
  const { connected, methods } = getStore();
  if (!connected) asked = false;
  else if (!asked && methods.has("machine.describe")) {
    asked = true;
    ask<Described>("machine.describe").then(
      (answer) => {
        described = answer;
        for (const listener of listeners) listener();
      },
      () => {},
    );
  }
});

export const machine = {
  get: () => described,
  subscribe: (listener: () => void) => {
    listeners.add(listener);
    return () => void listeners.delete(listener);
  },
};
