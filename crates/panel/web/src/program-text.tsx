/** The text of the program around the line that runs. Of long programs only what is shown is fetched. */
import { useEffect, useRef, useState } from "preact/hooks";
import { t } from "./i18n";
import { isInProgram } from "./orders";
import { ask, getStore, useStatus, useStore } from "./store";
import { Button } from "./ui";

const ROW_PX = 28;
/** Lines that are asked for at a time. */
const PAGE = 200;

interface Text {
  key: string;
  lines: Map<number, string>;
  asked: Set<number>;
}

let text: Text = { key: "", lines: new Map(), asked: new Set() };

/** Asks for the lines around a line; tells when they are there. */
function fetchLines(key: string, line: number, told: () => void): void {
  if (text.key !== key) text = { key, lines: new Map(), asked: new Set() };
  const mine = text;
  if (text.lines.size > 20 * PAGE) {
    text.lines.clear();
    text.asked.clear();
  }
  for (const page of [Math.floor(line / PAGE), Math.floor((line + 60) / PAGE)]) {
    if (mine.asked.has(page) || page < 0) continue;
    mine.asked.add(page);
    ask("program.text", { from_line: Math.max(1, page * PAGE), lines: PAGE }).then(
      ({ first_line, lines }) => {
        lines.forEach((one, i) => mine.lines.set(first_line + i, one));
        told();
      },
      () => mine.asked.delete(page),
    );
  }
}

export function ProgramText({ follow, onPick, picked }: { follow?: boolean; onPick?: (line: number) => void; picked?: number }) {
  const element = useRef<HTMLOListElement>(null);
  const [rows, setRows] = useState(8);
  const [first, setFirst] = useState<number | null>(null);
  const [, setTold] = useState(0);
  const asks = useStore((s) => s.methods.has("program.text"));
  const key = useStatus((s) => (s.program ? JSON.stringify([s.program.name, s.program.lines, s.program.revision]) : "")) ?? "";
  const total = useStatus((s) => s.program?.lines ?? 0) ?? 0;
  const current = useStatus((s) => (isInProgram(s) ? s.line : 0)) ?? 0;
  useEffect(() => {
    const observer = new ResizeObserver(([entry]) => setRows(Math.max(3, Math.floor(entry!.contentRect.height / ROW_PX))));
    observer.observe(element.current!);
    return () => observer.disconnect();
  }, []);
  useEffect(() => setFirst(null), [key]);
  const previewed = useStore((s) => s.previewLine);
  const limit = (line: number) => Math.max(1, Math.min(total - rows + 2, line));
  const top = first ?? limit(follow ? current - Math.floor(rows / 3) : 1);
  useEffect(() => {
    if (asks && key) fetchLines(key, top, () => setTold((n) => n + 1));
  }, [asks, key, top, rows]);
  useEffect(() => {
    if (previewed !== null && (previewed < top || previewed > top + rows - 2)) setFirst(limit(previewed - Math.floor(rows / 3)));
  }, [previewed]);
  const scroll = (lines: number) => setFirst(limit(top + lines));
  const drag = useRef<number | null>(null);
  const shown = key && asks && getStore().status ? Array.from({ length: Math.min(rows, total - top + 1) }, (_, i) => top + i) : [];
  return (
    <div class="program-text">
      <ol
        ref={element}
        tabIndex={0}
        aria-label={t("program")}
        onWheel={(event) => {
          event.preventDefault();
          scroll(Math.sign(event.deltaY) * Math.max(1, Math.round(Math.abs(event.deltaY) / ROW_PX)));
        }}
        onPointerDown={(event) => (drag.current = event.clientY)}
        onPointerMove={(event) => {
          if (drag.current === null || !event.buttons) return;
          const lines = Math.trunc((drag.current - event.clientY) / ROW_PX);
          if (lines) {
            drag.current -= lines * ROW_PX;
            scroll(lines);
          }
        }}
        onPointerUp={() => (drag.current = null)}
        onKeyDown={(event) => {
          const by = { ArrowDown: 1, ArrowUp: -1, PageDown: rows - 1, PageUp: 1 - rows, Home: -total, End: total }[event.key];
          if (by === undefined || getStore().keysOn) return;
          event.preventDefault();
          scroll(by);
        }}
      >
        {shown.map((line) => (
          <li
            key={line}
            class={line === current ? "current" : line === previewed ? "previewed" : line === picked ? "picked" : line < current ? "past" : ""}
            data-testid={line === current ? "current-line" : undefined}
            data-line={line}
            aria-current={line === current ? "step" : undefined}
            onClick={onPick && (() => onPick(line))}
          >
            <span>{line}</span>
            <code>{text.key === key ? text.lines.get(line) : ""}</code>
          </li>
        ))}
      </ol>
      {first !== null && follow && <Button kind="small follow" label={t("follow")} onClick={() => setFirst(null)} />}
    </div>
  );
}
