/** What an oscilloscope of the control has told: rows as they come, the last of them in a window of time. */
import { connection, onNotification } from "./store";
import type { Channel, ScopePart } from "./types";

export interface Wanted {
  pins: string[];
  /** What is shown at once, s. */
  seconds: number;
  /** A condition; "" rolls on. */
  trigger: string;
  /** Stops behind the first record. */
  single: boolean;
}

/** Rows in a window: a screen has no more pixels. */
const ROWS_MAX = 2000;
/** Times a second that the control tells of new rows. */
const RATE_HZ = 20;

/** Rows of one record: time, and the least and the greatest value of each channel. */
export class Rows {
  readonly time: number[] = [];
  readonly least: number[][];
  readonly greatest: number[][];

  constructor(channels: number) {
    this.least = Array.from({ length: channels }, () => []);
    this.greatest = Array.from({ length: channels }, () => []);
  }

  /** A block as it is sent: time and pairs of values, f64, little end first. */
  add(octets: Uint8Array): void {
    const view = new DataView(octets.buffer, octets.byteOffset, octets.byteLength);
    const row = 8 * (1 + 2 * this.least.length);
    for (let at = 0; at + row <= octets.byteLength; at += row) {
      this.time.push(view.getFloat64(at, true));
      for (let channel = 0; channel < this.least.length; channel++) {
        this.least[channel]!.push(view.getFloat64(at + 8 + 16 * channel, true));
        this.greatest[channel]!.push(view.getFloat64(at + 16 + 16 * channel, true));
      }
    }
  }

  /** Forgets what lies more than so long before the last row. */
  keep(seconds: number): void {
    const from = (this.time.at(-1) ?? 0) - seconds;
    const first = this.time.findIndex((time) => time >= from);
    if (first <= 0) return;
    for (const values of [this.time, ...this.least, ...this.greatest]) values.splice(0, first);
  }

  /** As a table, one row a line. */
  csv(channels: Channel[]): string {
    const quoted = (text: string) => (/[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
    const head = ["time_s", ...channels.flatMap(({ name }) => [`${name} least`, `${name} greatest`])].map(quoted);
    const line = (_: number, at: number) => [this.time[at], ...this.least.flatMap((least, channel) => [least[at], this.greatest[channel]![at]])].join(",");
    return [head.join(","), ...this.time.map(line), ""].join("\n");
  }
}

function decoded(base64: string): Uint8Array {
  return Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
}

/** An oscilloscope that runs until it is stopped. */
export class Scope {
  channels: Channel[] = [];
  rows = new Rows(0);
  state: ScopePart["state"] = "waiting";
  lost = 0;
  error = "";
  private number: number | null = null;
  private ended = false;
  private record = -1;
  private next = new Rows(0);
  private deaf: () => void;

  constructor(
    readonly wanted: Wanted,
    private readonly changed: () => void,
  ) {
    this.deaf = onNotification<ScopePart>("scope", (part) => part.scope === this.number && this.take(part));
    void this.begin();
  }

  /** Nobody wants more of it. */
  stop(): void {
    this.ended = true;
    this.deaf();
    if (this.number !== null) connection.call("scope.end", { scope: this.number }).catch(() => {});
    this.number = null;
  }

  private async begin(): Promise<void> {
    const { pins, seconds, trigger, single } = this.wanted;
    try {
      const { cycle_us } = await connection.call("machine.describe");
      const cycles_per_row = Math.max(1, Math.ceil((seconds * 1e6) / cycle_us / ROWS_MAX));
      const record = trigger ? { trigger, seconds, before_percent: 20, mode: single ? "single" : "normal" } : { mode: "roll" };
      if (this.ended) return;
      const begun = await connection.call("scope.begin", { pins, cycles_per_row, rate_hz: RATE_HZ, ...record });
      this.number = begun.scope;
      this.channels = begun.channels;
      this.rows = new Rows(begun.channels.length);
    } catch (error) {
      this.error = (error as Error).message;
      this.state = "done";
    }
    if (this.ended) return this.stop();
    this.changed();
  }

  private take(part: ScopePart): void {
    [this.state, this.lost, this.error] = [part.state, part.lost, part.error ?? ""];
    if (part.state === "done") this.number = null;
    if (part.record !== this.record) {
      this.record = part.record;
      this.next = new Rows(this.channels.length);
    }
    if (part.rows > 0) {
      this.next.add(decoded(part.base64));
      if (!this.wanted.trigger) this.next.keep(this.wanted.seconds);
      // A record that is begun takes the place of the one before once there is something to see.
      this.rows = this.next;
    }
    this.changed();
  }
}
