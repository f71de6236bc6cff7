/** Step and speed of jogging, as they were chosen last. */
import type { What } from "./jog";
import { type Letter, machine } from "./machine";
import { getStore } from "./store";

/** 0: for as long as it is held. */
export const STEPS_MM = [0, 10, 1, 0.1, 0.01];
/** Speeds that need not be typed, mm/min or degrees/min. */
export const SPEEDS_MM_MIN = [30, 150, 750, 3000];

/** Where the machine does not say how fast it may be, mm/s. */
const SPEED_UNKNOWN_MM_S = 50;
/** By hand no axis is faster, mm/s. */
const SPEED_MAX_MM_S = 50;

export const jogSettings = {
  step_mm: 0,
  /** mm/min or degrees/min. */
  mm_min: 750,
  /** The most that an axis is moved with by hand, mm/s or degrees/s. */
  most(axis: string): number {
    const described = machine.get()?.axes.find((one) => one.axis === axis);
    return Math.min(SPEED_MAX_MM_S, described?.velocity_per_s ?? SPEED_UNKNOWN_MM_S);
  },
  /** mm/s or degrees/s. */
  speed(axis: string, fast: boolean): number {
    return fast ? this.most(axis) : Math.min(this.most(axis), this.mm_min / 60);
  },
  /** Axes need their joints homed; before that a joint is moved by its number. */
  what(axis: string): What {
    const status = getStore().status;
    const joints = status?.axes.find((one) => one.axis === axis)?.joints ?? [];
    const homed = joints.every((joint) => status?.homed.includes(joint));
    return homed || joints.length !== 1 ? { axis: axis as Letter } : { joint: joints[0]! };
  },
};
