/** What the machine is made of: asked for once a connection. */
import { ask, getStore, subscribe } from "./store";

export interface Described {
  name: string;
  unit: string;
  axes: { axis: string; unit: string; lower: number; upper: number; velocity_max: number; joints: number[] }[];
  joints?: { joint?: number; name?: string; lower: number; upper: number; velocity_max: number; unit: string }[];
  spindles?: { rpm_min: number; rpm_max: number }[];
  cycle_us?: number;
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
    return () => listeners.delete(listener);
  },
};
