/** What `isocnc init --panel` is asked, as docs/panel-api.md describes it. */
import { HttpRefused, request } from "../http";
import { t } from "../i18n";

export interface Interface {
  name: string;
  up: boolean;
  wireless: boolean;
}

/** What the page begins with. */
export interface Offer {
  file: string;
  exists: boolean;
  name: string;
  real_time: boolean;
  interfaces: Interface[];
  cycle_us: number;
}

export interface Found {
  bus: string;
  nodes: { id: number; name: string | null; is_drive: boolean }[];
}

export interface Answers {
  name: string;
  interface: string;
  /** The nodes are those of the last scan. */
  scan: boolean;
  axes: string;
  drives: number[];
  io: number[];
  scales: string[];
  travels: string[];
  speeds: string[];
  to_try: boolean;
  cycle_us: number;
}

/** There is a file already. */
export const EXISTS = 409;
/** It asks for a token. */
export const LOG_IN = 401;
/** A control runs here, which makes no machine file. */
export const NONE = 404;

export const begin = async (): Promise<Offer> => (await request("init", { cache: "no-store" })).json() as Promise<Offer>;

const post = async <T>(what: string, body: unknown): Promise<T> =>
  (await request(`init/${what}`, { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) })).json() as Promise<T>;

export const scan = (name: string): Promise<Found> => post("scan", { interface: name });
export const check = (answers: Answers): Promise<{ text: string }> => post("check", answers);
export const write = (answers: Answers, replace: boolean): Promise<{ written: string }> => post("write", { ...answers, replace });
export const start = (): Promise<unknown> => post("start", {});

/** Why it was refused, in words. */
export function why(error: unknown): string {
  if (!(error instanceof HttpRefused)) return String(error);
  return error.status === 0 ? t("init-no-answer") : error.message;
}

export const statusOf = (error: unknown): number | undefined => (error instanceof HttpRefused ? error.status : undefined);
