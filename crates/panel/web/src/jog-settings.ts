/** Step and speed of jogging, as they were chosen last. */
import type { What } from "./jog";
import { type Letter, machine } from "./machine";
import { getStore } from "./store";

/** 0: for as long as it is held. */
export const STEPS_MM = [0, 10, 1, 0.1, 0.01];
/** Share of the speed of an axis. */
export const SPEEDS_PERCENT = [1, 5, 25, 100];

/** Where the machine does not say how fast it may be, mm/s. */
const SPEED_UNKNOWN_MM_S = 50;
/** By hand no axis is faster, mm/s. */
const SPEED_MAX_MM_S = 50;

export const jogSettings = {
  step_mm: 0,
  percent: 25,
  /** mm/s or degrees/s. */
  speed(axis: string, fast: boolean): number {
    const described = machine.get()?.axes.find((one) => one.axis === axis);
    const most = Math.min(SPEED_MAX_MM_S, described?.velocity_per_s ?? SPEED_UNKNOWN_MM_S);
    return (most * (fast ? 100 : this.percent)) / 100;
  },
  /** Axes need their joints homed; before that a joint is moved by its number. */
  what(axis: string): What {
    const status = getStore().status;
    const joints = status?.axes.find((one) => one.axis === axis)?.joints ?? [];
    const homed = joints.every((joint) => status?.homed.includes(joint));
    return homed || joints.length !== 1 ? { axis: axis as Letter } : { joint: joints[0]! };
  },
};
