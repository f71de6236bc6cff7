/** Values of pins for what shows them: one question for all of them, none while nobody sees the page. */
import { useEffect, useState } from "preact/hooks";
import type { Refused } from "./rpc";
import { connection, useStore } from "./store";
import type { Pin } from "./types";

/** Pins of a question. */
const ASKED_MAX = 64;
/** Pins that are unknown are looked for again after so long: a component may have come. */
const UNKNOWN_MS = 10_000;

export interface PinValues {
  values: Map<string, Pin>;
  /** Those that this machine does not have. */
  unknown: ReadonlySet<string>;
}

const NOTHING: PinValues = { values: new Map(), unknown: new Set() };

/** Of these names those that are no pins: one of them refuses a whole question. */
async function strangers(names: string[]): Promise<Set<string>> {
  const found = await Promise.all(names.map((pattern) => connection.call("hal.list", { pattern })));
  return new Set(names.filter((name, at) => !found[at]!.pins.some((pin) => pin.name === name)));
}

/** Asks for these pins, again and again. */
export function usePinValues(names: string[], every_ms: number): PinValues {
  const [now, setNow] = useState(NOTHING);
  const connected = useStore((s) => s.connected);
  useEffect(() => {
    if (names.length === 0 || !connected) return;
    let [wanted, asked] = [true, false];
    let unknown: ReadonlySet<string> = new Set();
    let looked = performance.now();
    const look = async () => {
      // A slow answer is waited for.
      if (asked || document.visibilityState === "hidden") return;
      asked = true;
      if (unknown.size > 0 && performance.now() - looked > UNKNOWN_MS) unknown = new Set();
      const known = names.filter((name) => !unknown.has(name));
      const parts = Array.from({ length: Math.ceil(known.length / ASKED_MAX) }, (_, at) => known.slice(at * ASKED_MAX, (at + 1) * ASKED_MAX));
      try {
        const answers = await Promise.all(parts.map((pins) => connection.call("hal.values", { pins })));
        if (wanted) setNow({ values: new Map(answers.flatMap(({ pins }) => pins).map((pin) => [pin.name, pin])), unknown });
      } catch (error) {
        // Without a connection it is asked again; a refusal is about a pin that is not there.
        if ((error as Refused).code !== 0) {
          looked = performance.now();
          unknown = await strangers(names).catch(() => unknown);
          if (wanted) setNow((before) => ({ ...before, unknown }));
        }
      } finally {
        asked = false;
      }
    };
    void look();
    const timer = setInterval(() => void look(), every_ms);
    return () => {
      wanted = false;
      clearInterval(timer);
    };
  }, [names.join(" "), every_ms, connected]);
  return now;
}
