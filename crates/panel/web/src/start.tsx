/** The start of the program: which, how, and from where; all of it is shown at its button. */
import { useState } from "preact/hooks";
import { parseNumber, t } from "./i18n";
import type { Params, Refused } from "./rpc";
import { type Store, ask, getStore, isBlind, order, say, setStore, tellRefused, useStore } from "./store";
import { Button, Dialog } from "./ui";

/** What is to be done otherwise than once from the beginning, a word each; `wrong`: what was typed cannot be read. */
function asked(store: Store): { words: string[]; wrong: string | null; params: Params<"program.start"> } {
  const { repeat, dry } = store.startWith;
  const line = pickedLine(store);
  const [times, feed] = [parseNumber(repeat), parseNumber(dry)];
  const words: string[] = [];
  const params: Params<"program.start"> = {};
  let wrong: string | null = null;
  if (line !== null) {
    words.push(t("from-line-short", { line }));
    params.from_line = line;
  }
  if (dry.trim()) {
    words.push(`${t("dry-run")} ${dry.trim()}`);
    params.dry_run_feed_mm_min = feed;
    if (!(feed > 0)) wrong = t("start-wrong", { what: t("dry-run-feed"), text: dry.trim() });
  }
  if (times !== 1) {
    words.push(`${repeat.trim() || "?"} ×`);
    params.repeat = times;
    if (!Number.isInteger(times) || times < 1) wrong = t("start-wrong", { what: t("repeat"), text: repeat.trim() });
    else if (line !== null) wrong = t("start-line-once", { line });
  }
  return { words, wrong, params };
}

/** The line that was picked in the program that is shown; null: none. */
export function pickedLine({ status, startWith: { line } }: Store): number | null {
  return line && status?.program && line.revision === status.program.revision ? line.line : null;
}

export function pickLine(line: number | null): void {
  const { startWith, status } = getStore();
  setStore({ startWith: { ...startWith, line: line === null ? null : { line, revision: status?.program?.revision } } });
}

/** The button, with all that is not as usual at the start that it would give. */
export function StartButton() {
  const { words, wrong } = useStore((s) => (s.status?.program ? asked(s) : { words: [], wrong: null }));
  const [means, setMeans] = useState<string[] | null>(null);
  return (
    <>
      <Button id="start" icon="start" kind={words.length ? "tall go with" : "tall go"} orders="program start" dim={wrong !== null} onClick={() => void startProgram(setMeans)}>
        <span class="label">{t("start")}</span>
        {words.length > 0 && (
          <small class="label" data-testid="start-with">
            {words.join(" · ")}
          </small>
        )}
      </Button>
      {means && <FromLine means={means} onClose={() => setMeans(null)} />}
    </>
  );
}

/** What a start in mid program means, and its start. */
function FromLine({ means, onClose }: { means: string[]; onClose: () => void }) {
  const line = useStore(pickedLine);
  // Another program has been loaded meanwhile.
  if (line === null) return null;
  return (
    <Dialog id="from-line-dialogue" title={t("from-line", { line })} onClose={onClose}>
      <ul class="means">
        {means.map((one, i) => (
          <li key={i}>{one}</li>
        ))}
      </ul>
      <footer>
        <Button id="from-line-yes" kind="go tall" icon="start" label={t("start")} orders="program start" onClick={() => void begin(true).then(onClose)} />
      </footer>
    </Dialog>
  );
}

/** Starts the program that is shown, and no other. `question` is told what a start at a line means. */
export async function startProgram(question: (means: string[]) => void): Promise<void> {
  const store = getStore();
  const { wrong } = asked(store);
  if (wrong !== null) return say("refused", wrong);
  const line = pickedLine(store);
  if (line === null || isBlind()) return begin(false);
  try {
    await ask("program.start", { from_line: line, ...revision(store) });
  } catch (error) {
    // What it means is asked; whatever else is in the way is a refusal.
    const { code, params } = (error as Refused).said;
    if (code === "refused.start_at_line") question(String(params?.means).split("\n"));
    else tellRefused(error);
  }
}

async function begin(yes: boolean): Promise<void> {
  const store = getStore();
  const { params } = asked(store);
  const begun = await order("program.start", { ...params, ...revision(store), ...(yes ? { yes } : {}) });
  // The next start is from the beginning again.
  if (begun !== undefined) pickLine(null);
}

/** Of the program that is shown: where another one has been loaded meanwhile, the control refuses. */
function revision({ status }: Store): { revision?: number } {
  const revision = status?.program?.revision;
  return revision ? { revision } : {};
}
