/** What the control tells: docs/control-socket.openrpc.json. */

export interface Axis {
  axis: string;
  joints: number[];
  unit: string;
}

export interface Acknowledged {
  by: string;
  unix_s: number;
}

export interface Entry {
  seq: number;
  kind: "alarm" | "warning" | "note";
  text: string;
  time_s: number;
  unix_s: number;
  alarm?: {
    code: string;
    severity: string;
    reaction: string;
    state: string;
    joint: number | null;
    node: string | null;
    program: string | null;
    line: number | null;
    first_cause: number;
    acknowledged: Acknowledged | null;
  };
  program?: { name: string; report: number | null; result: string | null; took_s: number | null; begun_unix_s: number; deviation_max_mm: number | null };
}

export interface Control {
  client: number;
  name: string;
  process: number;
  taken: boolean;
}

/** A variable of a program in Structured Text that has the value that somebody gave it. */
export interface Forced {
  program: string;
  variable: string;
  value: string;
}

export interface Status {
  api: string;
  version: string;
  pid: number;
  machine: string;
  file: string;
  state: string;
  power: string;
  activity: string;
  mode: "manual" | "mdi" | "auto";
  next: string | null;
  obstruction: string | null;
  alarm: string | null;
  job: string | null;
  step: string;
  waiting: { for: string; text: string; release: string } | null;
  axes: Axis[];
  homed: number[];
  limit_switches: { lower: number[]; upper: number[] };
  position_mm: number[];
  work_offset_mm: number[];
  work_rotation_degrees: number;
  held_at_mm: number[] | null;
  to_go_mm?: number[] | null;
  feed_mm_min?: number | null;
  velocity_mm_s: number;
  line: number;
  direction: "forward" | "reverse";
  elapsed_s: number;
  remaining_s: number | null;
  remaining_note: string | null;
  done_percent: number | null;
  program: { name: string; lines: number; planned_time_s: number; dry_run: boolean; result: string | null; revision?: number } | null;
  last_program: { name: string; line: number; result: string | null } | null;
  runs_left: number;
  parts: { count: number; target: number | null };
  codes: string[];
  tool: number;
  spindle: { on: boolean; speed_rpm: number } | null;
  coolant: { flood: boolean; mist: boolean };
  override: {
    feed_percent: number;
    rapid_percent: number;
    spindle_percent: number;
    feed_acts: boolean;
    spindle_acts: boolean;
  };
  single_block: boolean;
  optional_stop: boolean;
  block_delete: boolean;
  mdi: string[];
  messages: Entry[];
  control: Control | null;
  forced?: Forced[];
  cycles: number;
  cycles_skipped: number;
  late_max_us: number;
  estop_chain_open: boolean;
  /** What the control would refuse, with why: null for what it would do. */
  orders?: Record<string, string | null>;
}

/** Letters of `position_mm` and of what else has nine numbers. */
export const LETTERS = ["X", "Y", "Z", "A", "B", "C", "U", "V", "W"];
