/** Scales of an oscilloscope: so many divisions of 1, 2 or 5 times a power of ten each. */

export interface Scale {
  /** Value at the lower edge. */
  from: number;
  /** Of a division. */
  step: number;
  divisions: number;
}

/** Divisions of each lane of so many; of one scale for all: of one lane. */
export const divisionsOf = (lanes: number): number => (lanes <= 1 ? 8 : lanes <= 4 ? 4 : 2);

/** The least number of the series that is not below this one. */
function above(least: number): number {
  const power = 10 ** Math.floor(Math.log10(least));
  // 2 * 0.1 is not 0.2 to the last bit.
  const factor = [1, 2, 5, 10].find((one) => one * power >= least * (1 - 1e-9))!;
  return Number((factor * power).toPrecision(1));
}

/** Below this share of a value its digits end; what is above the other is no measurement. */
const LEAST_SPAN = 1e-12;
const GREATEST_SPAN = 1e200;

/** Share of the height that stays free at each edge. */
const MARGIN = 0.02;

/** The finest scale on which all lies between its edges. `even`: its divisions are whole steps from 0, as an axis with numbers has them. */
export function scaleFor(least: number, greatest: number, divisions: number, even: boolean): Scale {
  if (!Number.isFinite(least) || !Number.isFinite(greatest)) return { from: 0, step: 1, divisions };
  const middle = least / 2 + greatest / 2;
  const span = greatest > least ? Math.max(greatest - least, LEAST_SPAN * Math.max(1, Math.abs(middle))) : Math.max(1, Math.abs(least));
  if (!(span < GREATEST_SPAN)) return { from: 0, step: 1, divisions };
  for (let step = above(span / divisions); ; step = above(step * 1.5)) {
    const from = (even ? Math.round(middle / step - divisions / 2) : middle / step - divisions / 2) * step;
    const margin = MARGIN * divisions * step;
    if (from + margin <= least && from + divisions * step - margin >= greatest) return { from, step, divisions };
  }
}

/** A bit, in the middle of its lane. */
export const bitScale = (divisions: number): Scale => ({ from: -0.5, step: 2 / divisions, divisions });

/** The whole height, where this scale is that of one lane of some, the first of them at the top. */
export function heightOf({ from, step, divisions }: Scale, at: number, lanes: number): [number, number] {
  const height = step * divisions;
  return [from - height * (lanes - at - 1), from + height * (at + 1)];
}

/** With as many digits as a division has. */
export const digitsOf = (step: number): number => Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
