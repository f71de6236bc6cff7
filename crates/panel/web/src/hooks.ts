import { useEffect, useState } from "preact/hooks";

/** Draws a component again twice a second: for what grows by itself. */
export function useEveryHalfSecond(): void {
  const [, setTick] = useState(0);
  useEffect(() => {
    const timer = setInterval(() => setTick((tick) => tick + 1), 500);
    return () => clearInterval(timer);
  }, []);
}

/** A screen that has room for one thing beside the positions. Must fit style.css. */
const SMALL = matchMedia("(max-width: 1100px)");

export function useSmall(): boolean {
  const [small, setSmall] = useState(SMALL.matches);
  useEffect(() => {
    const changed = () => setSmall(SMALL.matches);
    SMALL.addEventListener("change", changed);
    return () => SMALL.removeEventListener("change", changed);
  }, []);
  return small;
}
