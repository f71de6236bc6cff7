/**
 * What a program or the logic says to a person, on every page: a stop that waits for them (M0, M1), and messages.
 *
 * It has room of its own between the page and the orders: nothing that stops the machine is covered, and nothing above moves while a
 * hand is on it.
 */
import { useEffect, useState } from "preact/hooks";
import { inWords } from "./control-words";
import { t, timeOfDay } from "./i18n";
import { isInProgram } from "./orders";
import { goTo } from "./route";
import { heldBy, resume } from "./shell";
import { fileName } from "./send";
import { ask, getStore, tellRefused, useStatus } from "./store";
import type { Entry, Status } from "./types";
import { Button, Icon } from "./ui";

/** Entries of the journal in which a page that has just come up looks for messages that no one has read. */
const LOOKS_BACK = 200;
const READ = "messages-read";

/** Messages that were not read here, the oldest first, and what takes them for read. */
function useMessages(): [Entry[], () => void] {
  const [unread, setUnread] = useState<Entry[]>([]);
  const [seen, setSeen] = useState<number | null>(null);
  const last = useStatus((s) => s.messages.at(-1)?.seq ?? 0) ?? 0;
  useEffect(() => {
    if (last === 0) return;
    const shown = getStore().status?.messages ?? [];
    const first = shown[0]?.seq ?? 0;
    // A page that has never been here begins with what is shown; numbers that go back are those of another journal.
    const kept = Number(localStorage.getItem(READ) ?? first - 1);
    const from = seen ?? Math.max(last - LOOKS_BACK, kept > last ? 0 : kept);
    setSeen(last);
    const add = (entries: Entry[]) => {
      const come = entries.filter((entry) => entry.code === "message" && entry.seq > from);
      if (come.length) setUnread((known) => [...known, ...come.filter(({ seq }) => !known.some((one) => one.seq === seq))].slice(-LOOKS_BACK));
    };
    if (first <= from + 1) add(shown);
    else ask("journal.since", { seq: from }).then(({ entries }) => add(entries), tellRefused);
  }, [last]);
  const read = () => {
    localStorage.setItem(READ, String(last));
    setUnread([]);
  };
  return [unread, read];
}

/** M0, M1 or M60 of a line, without its remarks. */
const STOP = /M\s*0*(0|1|60)(?![\d.])/i;

interface Stop {
  line: number;
  /** Of the text that has it; null: it was typed. */
  program: string | null;
  typed: string;
}

/** Where the program waits for somebody to go on; null: it does not. */
function stopOf(s: Status): Stop | null {
  // Away from the path, what it waits for is the way back.
  if (s.waiting?.for !== "operator" || s.activity === "away") return null;
  return isInProgram(s) ? { line: s.line, program: s.program!.name, typed: "" } : { line: s.line, program: null, typed: s.mdi[0] ?? "" };
}

export function Prompt() {
  const [unread, read] = useMessages();
  const stop = useStatus(stopOf);
  const text = useLine(stop);
  const stands = stop !== null;
  const [stood, setStood] = useState(false);
  useEffect(() => {
    // Whoever has gone on has read what stood there, at this panel or at another one.
    if (stood && !stands) read();
    setStood(stands);
  }, [stands]);
  const message = unread.at(-1);
  const shown = stands || message !== undefined;
  // A phone has no room for it at the top.
  const held = useStatus(heldBy);
  const code = STOP.exec(text.replace(/\(.*?\)|;.*/g, ""))?.[1];
  return (
    <section class={shown ? "prompt shown" : "prompt"} data-testid="prompt" role="status" aria-live="polite" aria-label={t("prompt")}>
      {held && <p class="held">{held}</p>}
      {shown && (
        <>
          <Icon name={stands ? "hold" : "message"} />
          <div>
            {stop && (
              <p>
                <b>{code === undefined ? t("prompt-stop") : t(code === "1" ? "prompt-m1" : code === "60" ? "prompt-m60" : "prompt-m0")}</b>{" "}
                <small>{stop.program === null ? "MDI" : t("alarm-at", { line: stop.line, program: fileName(stop.program) })}</small>
              </p>
            )}
            {message && (
              <p class="said" data-testid="prompt-message">
                {String(message.params?.text ?? inWords(message))} <small>{timeOfDay(message.unix_s)}</small>
              </p>
            )}
            {stop && code !== undefined && <code data-testid="prompt-line">{text.trim()}</code>}
          </div>
          {unread.length > 1 && <Button kind="small" id="prompt-more" label={t("prompt-more", { n: unread.length - 1 })} onClick={() => goTo("machine")} />}
          {stands ? (
            <Button id="prompt-resume" kind="go" icon="resume" label={t("resume")} orders="resume" onClick={() => void resume()} />
          ) : (
            <Button id="prompt-read" icon="check" label={t("prompt-read")} onClick={read} />
          )}
        </>
      )}
    </section>
  );
}

/** The line of the program at which it stands; "" until it is known. */
function useLine(stop: Stop | null): string {
  const [text, setText] = useState("");
  const typed = stop?.program === null;
  useEffect(() => {
    setText(typed ? stop!.typed : "");
    if (!stop || typed || !stop.line) return;
    let wanted = true;
    ask("program.text", { from_line: stop.line, lines: 1 }).then(({ lines }) => wanted && setText(lines[0] ?? ""), tellRefused);
    return () => void (wanted = false);
  }, [stop?.program, stop?.line, stop?.typed]);
  return text;
}
