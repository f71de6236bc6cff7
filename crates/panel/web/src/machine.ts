/** What the machine is made of: asked for once a connection. */
import { useEffect, useState } from "preact/hooks";
import type { Params } from "./rpc";
import { ask, getStore, subscribe } from "./store";
import type { Described } from "./types";

/** Letters of `position_mm` and of what else has nine numbers. */
export const LETTERS = ["X", "Y", "Z", "A", "B", "C", "U", "V", "W"];
/** One of them. */
export type Letter = NonNullable<Params<"jog">["axis"]>;

let described: Described | null = null;
let asked = false;
const listeners = new Set<() => void>();

subscribe(() => {
  const { connected, methods } = getStore();
  if (!connected) asked = false;
  else if (!asked && methods.has("machine.describe")) {
    asked = true;
    ask("machine.describe").then(
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

/** What it is made of; null until it is known. */
export function useMachine(): Described | null {
  const [now, setNow] = useState(described);
  useEffect(() => {
    const changed = () => setNow(described);
    changed();
    return machine.subscribe(changed);
  }, []);
  return now;
}
