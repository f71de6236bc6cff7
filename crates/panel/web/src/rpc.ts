/**
 * The connection to the control: JSON-RPC 2.0, one message a text frame, and how old what is shown is.
 *
 * After a loss the connection is made anew by itself; nothing that was sent before is sent again.
 */

import type { Calls, Message } from "./types";

/** A method of the control. */
export type Method = keyof Calls;
export type Params<M extends Method> = Calls[M]["params"];
export type Answer<M extends Method> = Calls[M]["answer"];
/** Its parameters, which may be left out where none has to be there. */
export type Given<M extends Method> = Record<never, never> extends Params<M> ? [params?: Params<M>] : [params: Params<M>];

/** A refusal or an error of the control, in its words. */
export class Refused extends Error {
  /** The same by its code and its values. */
  readonly said: Message;
  /** Which of the parameters is wrong, where the control says so. */
  readonly field: string | undefined;

  constructor(
    readonly code: number,
    message: string,
    { code: what = "text", params = {}, field }: Partial<Message> & { field?: string } = {},
  ) {
    super(message);
    this.field = field;
    this.said = { code: what, params, text: message };
  }
}

export type Phase = "connecting" | "open" | "lost";

type Waiting = { resolve: (value: unknown) => void; reject: (error: Error) => void };

const BACK_OFF_FIRST_MS = 200;
const BACK_OFF_MAX_MS = 5000;
/** Without data for so long, the control is asked whether it is there: a machine at rest tells something once a second only. */
const QUIET_MS = 400;
const PING_EVERY_MS = 200;
/** Code of a connection that is closed as its token is missing, or does not count. */
const LOG_IN = 4401;
/** A connection that says nothing for so long is given up and made anew. */
const DEAD_MS = 6000;

export class Connection {
  /** Told at each change of the phase; "open" once messages can be sent. */
  onPhase: (phase: Phase, reason: string, denied: boolean) => void = () => {};
  onNotification: (method: string, params: unknown) => void = () => {};
  onBinary: (data: ArrayBuffer) => void = () => {};
  phase: Phase = "connecting";
  /** Of the last message of any kind; ms of performance.now(). */
  lastMessage = performance.now();

  private socket: WebSocket | null = null;
  private waiting = new Map<number, Waiting>();
  private id = 0;
  private backOff = BACK_OFF_FIRST_MS;
  private pinged = 0;

  constructor(private readonly url: string) {
    setInterval(() => this.watch(), PING_EVERY_MS);
    this.open();
  }

  /** Age of what is shown, ms. */
  age(): number {
    return performance.now() - this.lastMessage;
  }

  /** Sends an order or a question. Refused at once where there is no connection: nothing is kept for later. */
  call<M extends Method>(method: M, ...[params]: Given<M>): Promise<Answer<M>> {
    if (this.socket?.readyState !== WebSocket.OPEN) {
      return Promise.reject(new Refused(0, "no connection"));
    }
    const id = ++this.id;
    this.socket.send(JSON.stringify({ jsonrpc: "2.0", id, method, params: params ?? {} }));
    return new Promise<Answer<M>>((resolve, reject) => {
      this.waiting.set(id, { resolve: resolve as (value: unknown) => void, reject });
    });
  }

  private open(): void {
    this.tell("connecting", "");
    const socket = new WebSocket(this.url);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    socket.onopen = () => {
      this.lastMessage = performance.now();
      this.tell("open", "");
    };
    socket.onmessage = (event) => {
      if (this.socket !== socket) return;
      this.lastMessage = performance.now();
      this.backOff = BACK_OFF_FIRST_MS;
      if (typeof event.data === "string") this.receive(event.data);
      else this.onBinary(event.data as ArrayBuffer);
    };
    socket.onclose = (event) => this.lost(socket, event.reason, event.code === LOG_IN);
  }

  private lost(socket: WebSocket, reason: string, denied = false): void {
    if (this.socket !== socket) return;
    this.socket = null;
    socket.onmessage = socket.onclose = null;
    socket.close();
    for (const { reject } of this.waiting.values()) reject(new Refused(0, "connection lost"));
    this.waiting.clear();
    this.tell("lost", reason, denied);
    // The same token would be refused again.
    if (denied) return;
    setTimeout(() => this.open(), this.backOff);
    this.backOff = Math.min(BACK_OFF_MAX_MS, this.backOff * 2);
  }

  private receive(text: string): void {
    const message = JSON.parse(text) as {
      id?: number;
      method?: string;
      params?: unknown;
      result?: unknown;
      error?: { code: number; message: string; data?: Partial<Message> };
    };
    if (message.method !== undefined) {
      this.onNotification(message.method, message.params);
      return;
    }
    const waiting = this.waiting.get(message.id ?? -1);
    if (!waiting) return;
    this.waiting.delete(message.id!);
    if (message.error) waiting.reject(new Refused(message.error.code, message.error.message, message.error.data));
    else waiting.resolve(message.result);
  }

  private tell(phase: Phase, reason: string, denied = false): void {
    this.phase = phase;
    this.onPhase(phase, reason, denied);
  }

  private watch(): void {
    const now = performance.now();
    if (this.phase !== "open" || this.age() < QUIET_MS) return;
    if (this.age() > DEAD_MS) {
      this.lost(this.socket!, "silent");
    } else if (now - this.pinged > QUIET_MS) {
      this.pinged = now;
      // Whatever it answers, it is there.
      this.call("ping").catch(() => {});
    }
  }
}
