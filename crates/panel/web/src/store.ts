/** What the panel knows, and how its parts hear of a change. */
import { useEffect, useRef, useState } from "preact/hooks";
import { inWords } from "./control-words";
import { type Answer, Connection, type Given, type Method, type Params, Refused } from "./rpc";
import { t } from "./i18n";
import type { Notifications, Role, Status } from "./types";

export interface Toast {
  id: number;
  kind: "refused" | "note";
  text: string;
}

export interface Store {
  status: Status | null;
  connected: boolean;
  /** Why there is no connection, in the words of the other end. */
  reason: string;
  /** A token is asked for. */
  denied: boolean;
  /** Age of the data in ms, in steps. */
  age: 0 | 1000 | 2000;
  /** Cycles of the control stand still, although it answers. */
  stalled: boolean;
  methods: ReadonlySet<string>;
  client: number | null;
  role: Role;
  toasts: Toast[];
  /** Keys of the keyboard jog. */
  keysOn: boolean;
  startWith: StartWith;
  /** The line that somebody looks at in the preview of the program; null: there is none. */
  previewLine: number | null;
}

/** Settings of the next start, as they were typed or picked: the button for it shows them. */
export interface StartWith {
  repeat: string;
  /** Feed of a dry run, mm/min; nothing: none. */
  dry: string;
  /** Where it is to begin, in the program of this revision. */
  line: { line: number; revision: number | undefined } | null;
}

let store: Store = {
  status: null,
  connected: false,
  reason: "",
  denied: false,
  age: 0,
  stalled: false,
  methods: new Set(),
  client: null,
  role: "operate",
  toasts: [],
  keysOn: false,
  startWith: { repeat: "1", dry: "", line: null },
  previewLine: null,
};
const listeners = new Set<() => void>();

export function getStore(): Store {
  return store;
}

export function setStore(change: Partial<Store>): void {
  store = { ...store, ...change };
  for (const listener of [...listeners]) listener();
}

export function subscribe(listener: () => void): () => void {
  listeners.add(listener);
  return () => listeners.delete(listener);
}

const same = (a: unknown, b: unknown): boolean => a === b || JSON.stringify(a) === JSON.stringify(b);

/** Draws a component again when what it takes of the store has changed. */
export function useStore<T>(select: (store: Store) => T): T {
  const [, setDrawn] = useState(0);
  // What is taken may hang on what the component has drawn last.
  const chosen = useRef(select);
  chosen.current = select;
  const last = useRef<T>(null as T);
  const now = select(store);
  if (!same(last.current, now)) last.current = now;
  useEffect(() => {
    const update = () => {
      if (!same(last.current, chosen.current(store))) setDrawn((n) => n + 1);
    };
    update();
    return subscribe(update);
  }, []);
  return last.current;
}

/** Of the status; null before the first one. */
export function useStatus<T>(select: (status: Status) => T): T | null {
  return useStore((s) => (s.status ? select(s.status) : null));
}

// ------------------------------------------------------------------------------------------------ connection

/** The token of the address (`#token=...`): kept for this tab, and taken out of the address. */
function takeToken(): string | null {
  const found = /(?:^#|&)token=([^&]+)/.exec(location.hash);
  if (found) {
    sessionStorage.setItem("token", decodeURIComponent(found[1]!));
    history.replaceState(null, "", location.pathname + location.search);
  }
  return sessionStorage.getItem("token");
}

export const token = takeToken();

/** From now on this tab shows another token. */
export function logIn(token: string): void {
  sessionStorage.setItem("token", token);
  location.reload();
}

export function authorised(headers: Record<string, string> = {}): Record<string, string> {
  return token ? { ...headers, Authorization: `Bearer ${token}` } : headers;
}

export let connection: Connection;

export function connect(): void {
  connection = new Connection(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/rpc`);
  connection.onPhase = (phase, reason, denied) => {
    if (phase === "open") void greet();
    else if (phase === "lost") setStore({ connected: false, reason, denied });
  };
  connection.onNotification = (method, params) => {
    if (method === "state") takeChange((params as Notifications["state"]).changed as Partial<Status>);
    else for (const listener of notified.get(method) ?? []) listener(params);
  };
  setInterval(judgeAge, 100);
}

const notified = new Map<string, Set<(params: unknown) => void>>();

/** Hears a notification; the answer ends that. */
export function onNotification<T>(method: string, listener: (params: T) => void): () => void {
  const heard = notified.get(method) ?? new Set();
  notified.set(method, heard);
  heard.add(listener as (params: unknown) => void);
  return () => heard.delete(listener as (params: unknown) => void);
}

/** Says who this is, and asks for the whole state: after each connection anew. */
async function greet(): Promise<void> {
  try {
    // Whoever comes from elsewhere has to say first who he is.
    const who = await connection.call("client.identify", {
      name: clientName(),
      kind: "panel",
      ...(token ? { token } : {}),
    });
    const methods = await connection.call("methods");
    // What is said ten times a second is said again anyway.
    takesRequestId = new Set(methods.filter((m) => m.params.includes("request_id") && m.name !== "jog.keep").map((m) => m.name));
    setStore({ client: who.client, role: who.role, methods: new Set(methods.map((m) => m.name)) });
    const answer = await connection.call("subscribe", { rate_hz: 20 });
    cyclesAt = performance.now();
    setStore({ status: answer.state, connected: true, reason: "" });
  } catch (error) {
    setStore({ reason: (error as Error).message });
  }
}

export function clientName(): string {
  return localStorage.getItem("name") ?? t("panel");
}

let cyclesAt = performance.now();

function takeChange(changed: Partial<Status>): void {
  if (!store.status) return;
  if (changed.cycles !== undefined) cyclesAt = performance.now();
  setStore({ status: { ...store.status, ...changed } });
}

/** Cycles are told once a second. */
const STALLED_MS = 2500;

function judgeAge(): void {
  const now = performance.now();
  const stoodStill = now - judged > 500;
  judged = now;
  // A page that was not let run has not read yet what came meanwhile: no word about it before the next time.
  if (stoodStill) {
    cyclesAt = now;
    return;
  }
  const ms = connection.age();
  const age = ms >= 2000 ? 2000 : ms >= 1000 ? 1000 : 0;
  const stalled = store.connected && age === 0 && now - cyclesAt > STALLED_MS;
  if (age !== store.age || stalled !== store.stalled) setStore({ age, stalled });
}

let judged = performance.now();

// ------------------------------------------------------------------------------------------------ orders

let takesRequestId = new Set<string>();

/** A number of 128 random bits in the form of a UUID: crypto.randomUUID is for secure contexts only. */
function uuid(): string {
  const bytes = crypto.getRandomValues(new Uint8Array(16));
  bytes[6] = (bytes[6]! & 0x0f) | 0x40;
  bytes[8] = (bytes[8]! & 0x3f) | 0x80;
  const hex = [...bytes].map((b) => b.toString(16).padStart(2, "0")).join("");
  return [hex.slice(0, 8), hex.slice(8, 12), hex.slice(12, 16), hex.slice(16, 20), hex.slice(20)].join("-");
}

/** Asks; what is refused is thrown. */
export function ask<M extends Method>(method: M, ...[params]: Given<M>): Promise<Answer<M>> {
  const id = takesRequestId.has(method) ? { request_id: uuid() } : {};
  return connection.call(method, ...([{ ...params, ...id } as Params<M>] as Given<M>));
}

/**
 * Nothing has come for a second: what is shown may be old, and an order may be carried out much later than it is given. So it may where
 * the page stood still for a second after the press.
 */
export const isBlind = (): boolean => store.age > 0 || !store.connected || performance.now() - (window.event?.timeStamp ?? Infinity) >= 1000;

/** What is given also to a machine that nobody sees, as long as there is a connection. */
export const ALWAYS: ReadonlySet<string> = new Set(["stop", "hold", "estop", "off"]);

/** Orders; what is refused is told. The answer, or undefined. */
export async function order<M extends Method>(method: M, ...given: Given<M>): Promise<Answer<M> | undefined> {
  if (isBlind() && !ALWAYS.has(method)) {
    say("refused", t("not-sent"));
    return undefined;
  }
  try {
    return await ask(method, ...given);
  } catch (error) {
    tellRefused(error);
    return undefined;
  }
}

export function tellRefused(error: unknown): void {
  const { code, message, said } = error as Refused;
  if (code === 0) say("refused", t("not-sent"));
  else say("refused", said ? inWords(said) : message);
}

let toastId = 0;

/** A line at the foot of the screen, for some seconds. */
export function say(kind: Toast["kind"], text: string): void {
  const id = ++toastId;
  setStore({ toasts: [...store.toasts.filter((toast) => toast.text !== text).slice(-2), { id, kind, text }] });
  setTimeout(() => dismiss(id), 8000);
}

export function dismiss(id: number): void {
  setStore({ toasts: store.toasts.filter((toast) => toast.id !== id) });
}

/** Whether this client's orders are the ones that count, as far as is known. */
export function controlOf(s: Store): "mine" | "other" | "free" {
  const control = s.status?.control;
  if (!control?.taken) return "free";
  return control.client === s.client ? "mine" : "other";
}
