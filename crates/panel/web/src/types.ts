/** What goes over the control socket: made by tests/references of the types in crates/protocol, not edited. */

/** Who has acknowledged an alarm. */
export interface Acknowledged {
  /** The order that did it. */
  by: string;
  /** When, seconds since 1970, UTC. */
  unix_s: number;
}

/** What is going on. */
export type Activity = "idle" | "checking" | "homing" | "jogging" | "running" | "held" | "away" | "returning" | "stopping";

/** What an alarm or a warning is about. */
export interface AlarmRecord {
  /** When someone has acknowledged it, and how. */
  acknowledged: Acknowledged | null;
  /** Stays the same from version to version, like `J-203`. */
  code: string;
  /** Number of the entry of the first cause; its own if it is that. */
  first_cause: number;
  /** Number of the joint. */
  joint: number | null;
  /** Its line. */
  line: number | null;
  /** Name of the node. */
  node: string | null;
  /** The program that was under way. */
  program: string | null;
  /** What the machine does about it. */
  reaction: Reaction;
  /** How grave it is. */
  severity: Severity;
  /** State of the machine before it. */
  state: State;
}

/** A channel of an oscilloscope. */
export interface Channel {
  /** Name of the pin or net. */
  name: string;
  /** Type of its value. */
  type: PinType;
  /** Unit of its value; empty: none. */
  unit: string;
}

/** Who has control. */
export interface Control {
  /** Number of its connection. */
  client: number;
  /** What it is called. */
  name: string;
  /** Its process; 0: not known. */
  process: number;
  /** Taken by `control.take`, and kept until it is released. */
  taken: boolean;
}

/** What the pumps are told. */
export interface Coolant {
  /** M8. */
  flood: boolean;
  /** M7. */
  mist: boolean;
}

/** What of a machine does not change. */
export interface Described {
  /** Its axes. */
  axes: DescribedAxis[];
  /** Buttons of the user. */
  buttons: DescribedButton[];
  /** Length of a cycle, us. */
  cycle_us: number;
  /** Its joints. */
  joints: DescribedJoint[];
  /** Its name. */
  machine: string;
  /** Pages of the user, by their names below `/own/` of the panel. */
  pages: string[];
  /** There is a folder of programs. */
  programs: boolean;
  /** Greatest speed of a spindle, rpm. */
  spindle_rpm_max: number;
  /** How many spindles it has. */
  spindles: number;
  /** Its unit of length: `mm` or `inch`. */
  unit: string;
  /** Pins that the user wants to see. */
  values: DescribedValue[];
}

/** An axis. */
export interface DescribedAxis {
  /** Greatest acceleration, per second squared. */
  acceleration_per_s2: number | null;
  /** Its letter. */
  axis: string;
  /** The joint that is this axis alone. */
  joint: number | null;
  /** Its joints. */
  joints: number[];
  /** Lower and upper end. */
  travel: number[] | null;
  /** `mm` or `degrees`. */
  unit: string;
  /** Greatest speed, per second. */
  velocity_per_s: number | null;
}

/** A button of the user. */
export interface DescribedButton {
  /** What is to be asked before it is pressed. */
  ask: string | null;
  /** What stands on it. */
  label: string;
  /** The pin that lights it. */
  lamp: string | null;
  /** Lines that it runs; an answer takes the place of `{name}`. */
  mdi: string[];
  /** By which it is pressed. */
  name: string;
  /** The program that it loads. */
  program: string | null;
  /** Numbers that it asks for. */
  questions: DescribedQuestion[];
  /** Who may press it. */
  role: Role;
}

/** A joint. */
export interface DescribedJoint {
  /** Following error at which the machine stops. */
  following_error: number;
  /** Its number. */
  joint: number;
  /** Lower and upper end. */
  travel: number[];
  /** Greatest speed, per second. */
  velocity_per_s: number;
}

/** A number that a button asks for. */
export interface DescribedQuestion {
  /** What it is if it is not given. */
  default: number;
  /** What stands before its field. */
  label: string;
  /** Max. */
  max: number | null;
  /** Min. */
  min: number | null;
  /** Its name. */
  name: string;
}

/** A pin that the user wants to see. */
export interface DescribedValue {
  /** Digits behind the point. */
  decimals: number;
  /** What stands before it. */
  label: string;
  /** The pin. */
  pin: string;
  /** What stands behind it. */
  unit: string | null;
}

/** Distance from the programmed path, mm. */
export interface Deviation {
  /** Greatest one of the actual path. */
  actual_max_mm: number;
  /** Greatest one of the commanded path. */
  command_max_mm: number;
  /** What the program allows. */
  tolerance_mm: number;
}

/** Which way along its path a program runs. */
export type Direction = "forward" | "reverse";

/** What stands in the way of real time, as `isocnc doctor --no-tests --json` prints it. */
export type Doctor = Record<string, unknown>;

/** An entry of the journal. */
export interface Entry {
  /** Alarms that were acknowledged (numbers of their entries), and how. */
  acknowledges?: [number[], Acknowledged];
  /** More of an alarm or a warning. */
  alarm?: AlarmRecord;
  /** The client whose order it comes from. */
  by?: string;
  /** What: its code, as of a message. */
  code: string;
  /** What kind of thing happened. */
  kind: EntryKind;
  /** Values of the sentence, by name. */
  params?: Record<string, Param>;
  /** More of a program that begins or is over. */
  program?: ProgramRecord;
  /** Number, from 1 on; it goes on where the last control of this machine ended. */
  seq: number;
  /** The sentence, in English. */
  text: string;
  /** When, seconds since the first cycle. */
  time_s: number;
  /** When, seconds since 1970, UTC. */
  unix_s: number;
}

/** What kind of thing happened. */
export type EntryKind = "alarm" | "warning" | "note";

/** What is wrong with the text of a machine file. */
export interface Errors {
  /** Each with its place. */
  errors: FileError[];
}

/** A component of another process. */
export interface External {
  /** Its process writes its outputs. */
  alive: boolean;
  /** How often it has stayed away since the start. */
  losses: number;
  /** Its name. */
  name: string;
}

/** What is wrong with a machine file. */
export interface FileError {
  /** Column, from 1 on. */
  column: number | null;
  /** What may have been meant. */
  hint: string | null;
  /** The key that is wrong. */
  key: string;
  /** Line, from 1 on. */
  line: number | null;
  /** What it must be. */
  rule: string;
  /** Its value. */
  value: string | null;
}

/** A machine file that was replaced. */
export interface FileWritten {
  /** Path of the one before. */
  before: string;
  /** SHA-256 of the new text, hexadecimal. */
  sha256: string;
}

/** A variable that has the value that someone gave it. */
export interface Forced {
  /** Name of its program. */
  program: string;
  /** Its value. */
  value: string;
  /** Its name. */
  variable: string;
}

/** Counts of values. */
export interface Histogram {
  /** Values in each bucket; the last one has those beyond all edges. */
  counts: number[];
  /** Upper edges of the buckets but the last, us. */
  edges_us: number[];
}

/** Who a client is to the control. */
export interface Identified {
  /** Version of the methods. */
  api: string;
  /** Number of its connection. */
  client: number;
  /** Name of the machine. */
  machine: string;
  /** What it may do. */
  role: Role;
  /** Version of the control. */
  version: string;
}

/** The program of a job. */
export interface Job {
  /** A name for its file. */
  name: string;
  /** The program, at most 10,000 lines. */
  text: string;
}

/** A number of a job, or a word or a text. */
export interface JobField {
  /** The words that it can be; empty if it is no choice. */
  choices: string[];
  /** What it is if it is not given. */
  default: JobValue;
  /** What it means, in English. */
  doc: string;
  /** Max number of characters of a text; null otherwise. */
  length_max: number | null;
  /** Max; null for a word or a text. */
  max: number | null;
  /** Min; null for a word or a text. */
  min: number | null;
  /** Its name. */
  name: string;
  /** `mm`, `degrees`, `mm/min`, `1/min`, `s`, `%`; empty without one. */
  unit: string;
  /** It is a whole number. */
  whole: boolean;
}

/** A kind of job. */
export interface JobKind {
  /** What it makes, in English. */
  about: string;
  /** Its numbers, in the order of a form. */
  fields: JobField[];
  /** Its name. */
  kind: string;
}

/** The kinds of jobs. */
export type JobKinds = JobKind[];

/** A value of a job. */
export type JobValue = number | string;

/** What comes of a jog; empty if one goes on or ends. */
export interface Jog {
  /** Letter of the axis. */
  axis?: string;
  /** Where the motion ends if that is the soft limit; null: it ends before. */
  soft_limit_mm?: number | null;
  /** `mm` or `degrees`. */
  unit?: string;
  /** Greatest speed, mm/s or degrees/s. */
  velocity_mm_s?: number;
}

/** Entries of the journal. */
export interface Journal {
  /** The oldest first. */
  entries: Entry[];
  /** Number of the last one of all. */
  last: number;
  /** There are others after them. */
  more: boolean;
  /** Number of the last one that outlasts this control, or that a full disk does not take. */
  on_disk: number;
}

/** Nothing, or a warning that the disk has not taken it. */
export interface Kept {
  /** Why it will be forgotten. */
  warning?: string;
}

/** The program that was loaded or begun last. */
export interface LastProgram {
  /** Line that it had reached. */
  line: number;
  /** Its path, or the name that its client gave it. */
  name: string;
  /** What became of it; null: it is under way. */
  result: LastResult | null;
}

/** What became of the program that was loaded or begun last. */
export type LastResult = "loaded" | "completed" | "stopped" | "faulted" | "timed_out" | "interrupted";

/** Limit switches that are closed, by joint. */
export interface LimitSwitches {
  /** At the lower ends. */
  lower: number[];
  /** At the upper ends. */
  upper: number[];
}

/** Lines of MDI. */
export interface Lines {
  /** The latest last. */
  lines: string[];
}

/** A value that was forced. */
export interface LogicForced {
  /** Variable and value, in words. */
  forced: string;
}

/** What is forced no longer. */
export interface LogicReleased {
  /** How many variables. */
  released: number;
}

/** A program that has taken the place of another. */
export interface LogicReloaded {
  /** Variables that go on with their values. */
  carried: number;
}

/** What a variable is to pins. */
export type LogicRole = "input" | "output" | "internal";

/** A program in Structured Text. */
export interface LogicTask {
  /** Its file. */
  file: string;
  /** Variables that are forced. */
  forced: number;
  /** Its name. */
  name: string;
  /** Scans with a result that had no room. */
  overflows: number;
  /** Scans that were skipped as the one before was not over. */
  overruns: number;
  /** Time from scan to scan, ms. */
  period_ms: number;
  /** The longest scan, us. */
  scan_max_us: number;
  /** The last scan, us. */
  scan_us: number;
  /** Scans since the start. */
  scans: number;
  /** It stands, by a fault. */
  stands: boolean;
  /** Steps of its longest scan. */
  steps_max: number;
}

/** Programs in Structured Text. */
export interface LogicTasks {
  /** All of them. */
  programs: LogicTask[];
}

/** A variable. */
export interface LogicVariable {
  /** It is forced. */
  forced: boolean;
  /** Line of its declaration. */
  line: number;
  /** Its name. */
  name: string;
  /** Its pin. */
  pin: string | null;
  /** It keeps its value over a restart. */
  retain: boolean;
  /** What it is to pins. */
  role: LogicRole;
  /** Its type, in words of Structured Text. */
  type: string;
  /** Its value, as it is written in Structured Text. */
  value: string;
}

/** Variables of a program after one scan. */
export interface LogicVariables {
  /** There are others after them. */
  more: boolean;
  /** Name of the program. */
  program: string;
  /** When, ms since the first scan. */
  time_ms: number;
  /** Some of its variables. */
  variables: LogicVariable[];
}

/** The machine file. */
export interface MachineFile {
  /** What is wrong with it. */
  errors: FileError[];
  /** Its path. */
  file: string;
  /** SHA-256 of its text, hexadecimal. */
  sha256: string;
  /** Its text. */
  text: string;
}

/** What the control says. */
export interface Message {
  /** Stays the same from version to version, like `fault.node_lost`; `text`: there is nothing but the sentence. */
  code: string;
  /** Values of the sentence, by name. */
  params?: Record<string, Param>;
  /** The sentence, in English. */
  text: string;
}

/** A method. */
export interface MethodInfo {
  /** What it does. */
  does: string;
  /** Its name. */
  name: string;
  /** Names of its parameters. */
  params: string[];
}

/** The methods that there are. */
export type Methods = MethodInfo[];

/** Figures for Prometheus. */
export interface Metrics {
  /** In its exposition format. */
  text: string;
}

/** Whose orders the machine follows, or followed last. */
export type Mode = "manual" | "mdi" | "auto";

/** The network and its nodes, as `isocnc bus status --json` prints them. */
export type Network = Record<string, unknown>;

/** The next step of the operator. Its word is what to type, if a command does it. */
export type Next = "power_on" | "power_off" | "home" | "reset_estop" | "close_chain" | "acknowledge" | "jog_off_switch" | "load_program" | "start_program" | "start_again" | "hold_then_jog" | "resume" | "resume_or_stop" | "return" | "return_or_stop" | "wait_or_stop" | "wait_or_hold" | "wait" | "wait_for_rest" | "let_rest" | "bus_state" | "status" | "nothing" | "run_control" | "run_without_program";

/** Carried out. */
export type Nothing = Record<string, never>;

/** The value of an object. */
export interface Octets {
  /** Its octets. */
  value: string;
}

/** Origins and rotations of work systems, in machine coordinates. */
export interface Offsets {
  /** Where G28 goes, by letter, in machine coordinates. */
  g28: Record<string, number>;
  /** Where G30 goes, by letter, in machine coordinates. */
  g30: Record<string, number>;
  /** G92, by letter. */
  g92: Record<string, number>;
  /** G92 is active. */
  g92_active: boolean;
  /** G54 to G59.3. */
  systems: WorkSystem[];
  /** `mm` or `inch`; rotary axes are in degrees. */
  unit: string;
}

/** An OpenRPC document. */
export type OpenRpc = Record<string, unknown>;

/** Orders that the cycle has taken. */
export interface OrdersTaken {
  /** When the last one, seconds since 1970, UTC. */
  last_unix_s: number | null;
  /** How many. */
  taken: number;
}

/** How a program, or an order that takes time, ended. */
export type Outcome = "completed" | "stopped" | "faulted" | "timed_out";

/** What is known of a program before it runs. */
export interface Outlook {
  /** Its last line with something to do. */
  lines: number;
  /** Planned time, s. */
  planned_time_s: number;
  /** Its path, or the name that its client gave it. */
  program: string;
  /** How much quicker than motion it was planned. */
  real_time_factor: RealTimeFactor;
  /** As `revision` of the status. */
  revision: number;
  /** What whoever starts it should know, a line each. */
  warning: string | null;
}

/** Where the overrides stand, and whether the program lets them act at the moment. */
export interface Overrides {
  /** Adaptive feed acts (M52). */
  adaptive_feed_acts: boolean;
  /** The one of the feed acts (M48, M50). */
  feed_acts: boolean;
  /** The pin that holds the feed acts (M53). */
  feed_hold_acts: boolean;
  /** Of the programmed feed, percent. */
  feed_percent: number;
  /** Of rapid moves, percent. */
  rapid_percent: number;
  /** The one of the spindle acts (M48, M51). */
  spindle_acts: boolean;
  /** Of the programmed speed of the spindle, percent. */
  spindle_percent: number;
}

/** A value of a sentence. */
export type Param = number | string | Message;

/** The counter of parts. */
export interface Parts {
  /** Parts made. */
  count: number;
  /** Parts wanted, if someone has said so. */
  target: number | null;
}

/** A way that is being drawn. */
export interface PathBegun {
  /** Letters of the axes of a record. */
  axes: string[];
  /** Its number. */
  path: number;
  /** Name of the program. */
  program: string;
  /** Octets of a record. */
  record_octets: number;
}

/** Some of a way. */
export interface PathPart {
  /** Records. */
  base64: string;
  /** There is no more. */
  end: boolean;
  /** What is wrong with the program where the way ends. */
  error: string | null;
}

/** A pin or net. */
export interface Pin {
  /** The pin of which it is another name. */
  alias_of: string | null;
  /** What it is. */
  direction: PinDirection;
  /** Its name. */
  name: string;
  /** The net that reaches it. */
  net: string | null;
  /** The pin that drives a net. */
  source: string | null;
  /** Type of its value. */
  type: PinType;
  /** Unit of its value. */
  unit: string | null;
  /** Its value; null: not a number. */
  value: boolean | number | null;
}

/** What a pin is. */
export type PinDirection = "in" | "out" | "net";

/** Type of the value of a pin. */
export type PinType = "bit" | "s32" | "u32" | "s64" | "u64" | "float";

/** Pins and nets. */
export interface Pins {
  /** There are others after them. */
  more: boolean;
  /** Some of them. */
  pins: Pin[];
}

/** Whether the machine can move. */
export type Power = "starting" | "estop_open" | "estop" | "alarm" | "off" | "switching" | "on" | "ending";

/** What a button has done: one with lines has begun them, one with a program has loaded it. */
export interface Pressed {
  /** Its planned time, s. */
  planned_time_s?: number;
  /** The program that is loaded. */
  program?: string;
  /** What whoever starts it should know, a line each. */
  warning: string | null;
}

/** A program that begins, or is over. */
export interface ProgramRecord {
  /** When it began, seconds since 1970, UTC. */
  begun_unix_s: number;
  /** Greatest distance of the actual path from the programmed one, mm. */
  deviation_max_mm: number | null;
  /** Line that it had reached. */
  line: number | null;
  /** Its path, or the name that its client gave it. */
  name: string;
  /** Number of its report. */
  report: number | null;
  /** How it ended; null: it begins here. */
  result: Outcome | null;
  /** From begin to end, s. */
  took_s: number | null;
}

/** What the machine does about a fault, the mildest first. */
export type Reaction = "count" | "warn" | "controlled_stop" | "quick_stop" | "emergency_stop" | "silence";

/** How much quicker than motion a program is planned. */
export interface RealTimeFactor {
  /** The stretch where it is least; null: the program is shorter than a stretch. */
  least: SlowStretch | null;
  /** Seconds of motion per second of planning; null: there is no motion. */
  whole: number | null;
}

/** What a program did. */
export interface Report {
  /** Why, if it did not complete. */
  alarms: ReportAlarm[];
  /** When it began, seconds since 1970, UTC. */
  begun_unix_s: number;
  /** Cycles that were skipped meanwhile. */
  cycles_skipped: number;
  /** Distance from the programmed path; null: no path was recorded. */
  deviation: Deviation | null;
  /** Line where that was. */
  following_error_max_line: number;
  /** Greatest distance between commanded and actual position of any joint, mm. */
  following_error_max_mm: number;
  /** Last line that was run. */
  line_reached: number;
  /** Last line with something to do. */
  lines: number;
  /** Name of the machine. */
  machine: string;
  /** Time that it took, holds and waits included, s. */
  motion_time_s: number;
  /** Counts the programs of this machine. */
  number: number;
  /** Parts after it. */
  parts: Parts;
  /** Planned time, s; of probing moves, and what follows them, as far as they really went. */
  planned_time_s: number;
  /** Its path, or the name that its client gave it. */
  program: string;
  /** How much quicker than motion it was planned when it was checked. */
  real_time_factor: RealTimeFactor;
  /** How it ended. */
  result: Outcome;
  /** Cycles of this in which the machine stood because its plan came late. */
  starved_cycles: number;
  /** The step that took too long, if one did. */
  timed_out_step: Step | null;
  /** From begin to end, s. */
  took_s: number;
  /** What was wrong without stopping it. */
  warnings: ReportWarning[];
}

/** Why a program did not complete. */
export interface ReportAlarm {
  /** Why, in words. */
  cause: string;
  /** When, seconds since the first cycle. */
  time_s: number;
}

/** What was wrong without stopping a program. */
export interface ReportWarning {
  /** What, in words. */
  cause: string;
  /** When for the first time, seconds since the first cycle. */
  time_s: number;
  /** How often. */
  times: number;
}

/** What a resume does first. */
export interface Resumed {
  /** The way back to the path, one leg each, if the machine is not where the program is held. */
  returns?: Message[];
}

/** What a client may do. Each role includes those before it. */
export type Role = "watch" | "operate" | "set-up";

/** An oscilloscope that samples from now on. */
export interface ScopeBegun {
  /** What it samples. */
  channels: Channel[];
  /** Time between two samples, us. */
  period_us: number;
  /** Its number. */
  scope: number;
}

/** Rows of an oscilloscope: the answer of `scope.next`, and the notification `scope`. */
export interface ScopePart {
  /** The rows. */
  base64: string;
  /** Why it has ended. */
  error: string | null;
  /** Cycles that were lost as no one fetched them in time. */
  lost: number;
  /** There are others already. */
  more: boolean;
  /** Number of the record that they are of. */
  record: number;
  /** The record ends with them. */
  record_ends: boolean;
  /** How many rows. */
  rows: number;
  /** Its number. */
  scope: number;
  /** How far the oscilloscope is. */
  state: ScopeState;
}

/** How far an oscilloscope is. */
export type ScopeState = "waiting" | "recording" | "done";

/** How grave a fault is, by what the machine does about it. */
export type Severity = "info" | "warning" | "stop" | "quick_stop" | "emergency_stop" | "silenced";

/** The block that is skipped. */
export interface Skipped {
  /** What it waited for. */
  skips: Message;
}

/** A stretch of a program. */
export interface SlowStretch {
  /** Seconds of motion per second of planning. */
  factor: number;
  /** Its first line. */
  from_line: number;
  /** Where it begins, s of motion. */
  from_s: number;
  /** Its last line. */
  to_line: number;
  /** Where it ends, s of motion. */
  to_s: number;
}

/** What a spindle is told. */
export interface Spindle {
  /** It turns. */
  on: boolean;
  /** Speed, rpm; below 0: counter-clockwise. */
  speed_rpm: number;
}

/** What the machine is doing. A pin shows the numbers: a new state comes behind the others. */
export type State = "booting" | "disabled" | "enabling" | "ready" | "homing" | "running" | "held" | "stopping" | "disabling" | "faulted" | "shutting_down" | "down" | "jogging" | "silenced" | "estop" | "away" | "returning";

/** How everything is. */
export interface Status {
  /** What is under way. */
  activity: Activity;
  /** Why the machine stopped by itself; stands until it is acknowledged or another program begins. */
  alarm: Message | null;
  /** Entries of alarms that no one has acknowledged, the first cause first, up to eight. */
  alarms: Entry[];
  /** Version of the methods. */
  api: string;
  /** Axes of the machine. */
  axes: StatusAxis[];
  /** Lines that begin with / are skipped. */
  block_delete: boolean;
  /** Active G and M codes, with S, F and T. */
  codes: string[];
  /** Who has control; null: no one. */
  control: Control | null;
  /** What the pumps are told. */
  coolant: Coolant;
  /** Cycles since the start. */
  cycles: number;
  /** Cycles whose date had passed before they began. */
  cycles_skipped: number;
  /** Which way along its path the program runs. */
  direction: Direction;
  /** Share of it that is done, percent; null: not known. */
  done_percent: number | null;
  /** Time since the program began, s. */
  elapsed_s: number;
  /** The chain of the emergency stop is open. */
  estop_chain_open: boolean;
  /** Components of other processes. */
  external: External[];
  /** Its machine file; empty: there is none. */
  file: string;
  /** Variables that are forced. */
  forced: Forced[];
  /** Where the program is held from which a hand has moved the machine away, mm and degrees. */
  held_at_mm: number[] | null;
  /** What holds a program or its feed: who has held it, a pin and its net, an override. */
  held_by: Message[];
  /** Joints that know where they are. */
  homed: number[];
  /** How the last order that takes time ended; null: it has not. */
  job: Outcome | null;
  /** The program that was loaded or begun last, by an earlier control as well. */
  last_program: LastProgram | null;
  /** Greatest lateness of a cycle, us. */
  late_max_us: number;
  /** Limit switches that are closed. */
  limit_switches: LimitSwitches;
  /** Line of the block that is executed. */
  line: number;
  /** Name of the machine. */
  machine: string;
  /** The line of MDI under way, and those that wait after it. */
  mdi: string[];
  /** The last entries of the journal, the newest last. */
  messages: Entry[];
  /** Whose orders the machine follows, or followed last. */
  mode: Mode;
  /** What to do next for a program to run; null: it could be started. */
  next: Next | null;
  /** What ended the last jog, if something was in its way. */
  obstruction: Message | null;
  /** M1 stops. */
  optional_stop: boolean;
  /** Where the overrides stand. */
  override: Overrides;
  /** Parts made, and wanted. */
  parts: Parts;
  /** Process of the control. */
  pid: number;
  /** Where the machine is, in machine coordinates, mm and degrees. */
  position_mm: number[];
  /** Whether the machine can move. */
  power: Power;
  /** The program that runs or is about to; otherwise the one that was loaded last. */
  program: StatusProgram | null;
  /** Why the time is not known, or on what it rests. */
  remaining_note: string | null;
  /** Time that it still needs, s; null: not known. */
  remaining_s: number | null;
  /** How often the program under way begins again after this time. */
  runs_left: number;
  /** The program rests at the end of each block. */
  single_block: boolean;
  /** The first spindle; null: the machine has none. */
  spindle: Spindle | null;
  /** State of the cycle. */
  state: State;
  /** Step of the sequence. */
  step: Step;
  /** What is left to the end of the piece of path under way, mm and degrees. */
  to_go_mm: number[] | null;
  /** Tool in the spindle; 0: none. */
  tool: number;
  /** Speed along the path, mm/s. */
  velocity_mm_s: number;
  /** Version of the control. */
  version: string;
  /** What a machine that waits waits for. */
  waiting: Waiting | null;
  /** What is to be subtracted from `position_mm` for work coordinates, mm and degrees. */
  work_offset_mm: number[];
  /** By how much X and Y are then to be turned back, degrees. */
  work_rotation_degrees: number;
}

/** An axis, in the status. */
export interface StatusAxis {
  /** Its letter. */
  axis: string;
  /** Its joints. */
  joints: number[];
  /** `mm` or `degrees`. */
  unit: string;
}

/** A program, in the status. */
export interface StatusProgram {
  /** It runs dry, or has. */
  dry_run: boolean;
  /** Its last line with something to do. */
  lines: number;
  /** Its path, or the name that its client gave it. */
  name: string;
  /** Planned time, s. */
  planned_time_s: number;
  /** How it ended; null: it has not. */
  result: Outcome | null;
  /** Another one for each text that is loaded; 0: there is no text. */
  revision: number;
  /** Tools that it changes to, each once, in the order of their first use. */
  tools: number[];
}

/** Step of the sequence from power-on to power-off. */
export type Step = "start" | "network_boot" | "standing_by" | "switching_on" | "homing" | "program" | "stop" | "switching_off" | "network_shut_down" | "shut_down" | "done";

/** The whole state, for a new subscriber. */
export interface Subscribed {
  /** When, CLOCK_MONOTONIC, s. */
  monotonic_s: number;
  /** How everything is. */
  state: Status;
  /** When, seconds since 1970, UTC. */
  unix_s: number;
}

/** Lines of a program. */
export interface Text {
  /** Number of the first of the lines. */
  first_line: number;
  /** Each cut at 256 octets. */
  lines: string[];
  /** There are others after them. */
  more: boolean;
  /** Its path, or the name that its client gave it. */
  name: string;
  /** As `revision` of the status. */
  revision: number;
}

/** How cycles have kept their time since the start. */
export interface Times {
  /** How long the rest of the cycle took. */
  compute: Histogram;
  /** Length of a cycle, us. */
  cycle_us: number;
  /** How long the exchange took. */
  exchange: Histogram;
  /** How late the SoC was. */
  lateness: Histogram;
  /** Orders that the cycle has taken. */
  orders: OrdersTaken;
  /** What the distance of two SoCs differs from the cycle. */
  period: Histogram;
}

/** A tool. */
export interface Tool {
  /** Diameter, in the unit of the machine. */
  diameter: number;
  /** The same of the diameter. */
  diameter_wear: number;
  /** Length, in the unit of the machine. */
  length: number;
  /** To be added to the length since it was measured, in the unit of the machine. */
  length_wear: number;
  /** How long it may be used. */
  life: ToolLife;
  /** Its place in the magazine. */
  pocket: number;
  /** What is written next to it in the table. */
  remark: string;
  /** Its number. */
  tool: number;
  /** Its life is over. */
  worn_out: boolean;
}

/** How long a tool may be used, and how long it has been. */
export interface ToolLife {
  /** Minutes that it may be used; null: nobody has said. */
  minutes: number | null;
  /** Parts that it may be used for; null: nobody has said. */
  parts: number | null;
  /** The tool that is called in its place when its life is over. */
  sister: number | null;
  /** Minutes that programs have moved with it in the spindle and the spindle on. */
  used_minutes: number;
  /** Parts of programs that have used it. */
  used_parts: number;
}

/** The tool table. */
export interface Tools {
  /** Tool in the spindle; 0: none. */
  in_spindle: number;
  /** Its tools. */
  tools: Tool[];
  /** `mm` or `inch`. */
  unit: string;
}

/** Room for a program. */
export interface UploadBegun {
  /** Octets of its longest part. */
  part_octets: number;
  /** Number of the upload. */
  upload: number;
}

/** How much of a program has come. */
export interface UploadGrown {
  /** Octets. */
  received: number;
}

/** What a machine that waits waits for. */
export interface Waiting {
  /** What. */
  for: WaitingFor;
  /** What releases it. */
  release: Message;
  /** The same in words. */
  what: Message;
}

/** What a machine that waits waits for. */
export type WaitingFor = "operator" | "tool_change" | "spindle_speed" | "input" | "spindle_orient" | "user_command" | "probe" | "dwell" | "feed" | "queue";

/** A work system. */
export interface WorkSystem {
  /** It is active. */
  active: boolean;
  /** Its origin, by letter. */
  origin: Record<string, number>;
  /** About Z of its origin, counter-clockwise from above, degrees. */
  rotation_degrees: number;
  /** G54 to G59.3. */
  system: string;
}

/** The methods: what each takes and answers. */
export interface Calls {
  "methods": { params: Record<string, never>; answer: Methods };
  "rpc.discover": { params: Record<string, never>; answer: OpenRpc };
  "client.identify": { params: { name?: string; version?: string; kind?: string; token?: string }; answer: Identified };
  "status": { params: Record<string, never>; answer: Status };
  "subscribe": { params: { rate_hz?: number }; answer: Subscribed };
  "unsubscribe": { params: Record<string, never>; answer: Nothing };
  "control.take": { params: { name?: string; force?: boolean; request_id?: string }; answer: Control | null };
  "control.release": { params: Record<string, never>; answer: Nothing };
  "ping": { params: Record<string, never>; answer: Nothing };
  "machine.describe": { params: Record<string, never>; answer: Described };
  "metrics": { params: Record<string, never>; answer: Metrics };
  "bus.network": { params: Record<string, never>; answer: Network };
  "bus.sdo_read": { params: { node: number; index: number; sub: number; request_id?: string }; answer: Octets };
  "bus.sdo_write": { params: { node: number; index: number; sub: number; value: string; request_id?: string }; answer: Nothing };
  "sim.fault": { params: { node: number; kind: "overcurrent" | "following-error" | "limit-switch" | "index-missing" | "slow-enable" | "power-off" | "sto" | "none"; axis?: number; for_s?: number; request_id?: string }; answer: Nothing };
  "on": { params: { request_id?: string }; answer: Nothing };
  "off": { params: { request_id?: string }; answer: Nothing };
  "estop": { params: { request_id?: string }; answer: Nothing };
  "estop.reset": { params: { request_id?: string }; answer: Nothing };
  "home": { params: { joints?: number[]; request_id?: string }; answer: Nothing };
  "program.upload.begin": { params: { name: string; octets: number; request_id?: string }; answer: UploadBegun };
  "program.upload.append": { params: { upload: number; at: number; value: string; request_id?: string }; answer: UploadGrown };
  "program.upload.commit": { params: { upload: number; sha256: string; request_id?: string }; answer: Nothing };
  "program.load": { params: { file?: string; path?: string; upload?: number; name?: string; text?: string; request_id?: string }; answer: Outlook };
  "program.start": { params: { from_line?: number; yes?: boolean; repeat?: number; dry_run_feed_mm_min?: number; revision?: number; request_id?: string }; answer: Outlook };
  "program.check": { params: { file?: string; path?: string; upload?: number; name?: string; text?: string; request_id?: string }; answer: Outlook };
  "program.run": { params: { file?: string; path?: string; upload?: number; name?: string; text?: string; request_id?: string }; answer: Outlook };
  "program.report": { params: { number?: number }; answer: Report };
  "program.text": { params: { from_line?: number; lines?: number }; answer: Text };
  "program.path.begin": { params: { tolerance_mm?: number }; answer: PathBegun };
  "program.path.next": { params: { path: number }; answer: PathPart };
  "program.path.end": { params: Record<string, never>; answer: Nothing };
  "hal.list": { params: { pattern?: string; from?: number }; answer: Pins };
  "scope.begin": { params: { pins: string[]; trigger?: string; mode?: string; seconds?: number; before_percent?: number; cycles_per_row?: number; rate_hz?: number }; answer: ScopeBegun };
  "scope.next": { params: { scope: number }; answer: ScopePart };
  "scope.end": { params: { scope: number }; answer: Nothing };
  "mdi": { params: { line: string; request_id?: string }; answer: Outlook };
  "mdi.stream": { params: { text: string; wait?: boolean; request_id?: string }; answer: Nothing };
  "mdi.history": { params: Record<string, never>; answer: Lines };
  "touch_off": { params: { axis: "X" | "Y" | "Z" | "A" | "B" | "C" | "U" | "V" | "W"; value: number; system?: "G54" | "G55" | "G56" | "G57" | "G58" | "G59" | "G59.1" | "G59.2" | "G59.3"; tool?: number; request_id?: string }; answer: Kept };
  "offset.list": { params: Record<string, never>; answer: Offsets };
  "offset.set": { params: { system?: "G54" | "G55" | "G56" | "G57" | "G58" | "G59" | "G59.1" | "G59.2" | "G59.3"; axis?: "X" | "Y" | "Z" | "A" | "B" | "C" | "U" | "V" | "W"; value?: number; rotation_degrees?: number; request_id?: string }; answer: Kept };
  "tool.list": { params: Record<string, never>; answer: Tools };
  "tool.set": { params: { tool: number; length?: number; diameter?: number; pocket?: number; remark?: string; length_wear?: number; diameter_wear?: number; life_minutes?: number; life_parts?: number; used_minutes?: number; used_parts?: number; sister?: number; request_id?: string }; answer: Kept };
  "tool.delete": { params: { tool: number; request_id?: string }; answer: Kept };
  "tool.changed": { params: { request_id?: string }; answer: Nothing };
  "jog": { params: { axis?: "X" | "Y" | "Z" | "A" | "B" | "C" | "U" | "V" | "W"; joint?: number; velocity_mm_s: number; distance_mm?: number; request_id?: string }; answer: Jog };
  "jog.keep": { params: { axis?: "X" | "Y" | "Z" | "A" | "B" | "C" | "U" | "V" | "W"; joint?: number; request_id?: string }; answer: Jog };
  "jog.stop": { params: { axis?: "X" | "Y" | "Z" | "A" | "B" | "C" | "U" | "V" | "W"; joint?: number; request_id?: string }; answer: Jog };
  "spindle": { params: { speed_rpm: number; request_id?: string }; answer: Nothing };
  "coolant": { params: { flood?: boolean; mist?: boolean; request_id?: string }; answer: Nothing };
  "hold": { params: { request_id?: string }; answer: Nothing };
  "resume": { params: { request_id?: string }; answer: Resumed };
  "skip": { params: { request_id?: string }; answer: Skipped };
  "reverse": { params: { percent?: number; request_id?: string }; answer: Nothing };
  "single_block": { params: { on: boolean; request_id?: string }; answer: Nothing };
  "optional_stop": { params: { on: boolean; request_id?: string }; answer: Nothing };
  "block_delete": { params: { on: boolean; request_id?: string }; answer: Nothing };
  "stop": { params: { request_id?: string }; answer: Nothing };
  "override": { params: { feed?: number; rapid?: number; spindle?: number; request_id?: string }; answer: Overrides };
  "journal.since": { params: { seq?: number }; answer: Journal };
  "parts.set": { params: { count?: number; target?: number; request_id?: string }; answer: Kept };
  "alarm.acknowledge": { params: { request_id?: string }; answer: Nothing };
  "logic.list": { params: Record<string, never>; answer: LogicTasks };
  "logic.look": { params: { program?: string; variable?: string; search?: string; from?: number }; answer: LogicVariables };
  "logic.force": { params: { program?: string; variable: string; value: string; request_id?: string }; answer: LogicForced };
  "logic.release": { params: { program?: string; variable?: string; request_id?: string }; answer: LogicReleased };
  "logic.reload": { params: { program?: string; request_id?: string }; answer: LogicReloaded };
  "machine.file": { params: Record<string, never>; answer: MachineFile };
  "machine.check": { params: { text: string }; answer: Errors };
  "machine.write": { params: { text: string; sha256: string; request_id?: string }; answer: FileWritten };
  "machine.doctor": { params: Record<string, never>; answer: Doctor };
  "hal.values": { params: { pins: string[] }; answer: Pins };
  "hal.set": { params: { pin: string; value: string; request_id?: string }; answer: Nothing };
  "button.press": { params: { name: string; answers?: Record<string, number>; request_id?: string }; answer: Pressed };
  "job.kinds": { params: Record<string, never>; answer: JobKinds };
  "job.make": { params: { kind: string; numbers?: Record<string, number | string> }; answer: Job };
  "cycle.times": { params: Record<string, never>; answer: Times };
}

/** What comes without being asked for. */
export interface Notifications {
  "state": { changed: Record<string, unknown>; monotonic_s: number; unix_s: number };
}
