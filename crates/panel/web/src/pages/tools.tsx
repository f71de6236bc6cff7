/** The tool table: what a tool measures and is called, its wear and its life, tools added and deleted, and the one in the spindle. */
import { useEffect, useState } from "preact/hooks";
import { fixed, parseNumber, t } from "../i18n";
import type { Params } from "../rpc";
import { ask, order, tellRefused, useStatus } from "../store";
import type { Tool, Tools as Table } from "../types";
import { Button, Card, Choice, Dialog, Field, Form, Icon } from "../ui";
import { Edit, type Edited, RunLine, type Typed } from "./edit";

type Measure = "length" | "diameter";
const MEASURES: readonly Measure[] = ["length", "diameter"];
/** What its dialogue shows one at a time. */
const PARTS = ["tool", "tool-wear", "tool-life"] as const;
const wearOf = (tool: Tool, what: Measure) => tool[`${what}_wear`];
/** With its sign, to a thousandth, or to what is below one. */
const signed = (value: number) => (value < 0 ? "−" : value > 0 ? "+" : "") + fixed(Math.abs(value), Number.isInteger(Math.round(value * 1e4) / 10) ? 3 : 4);
const hasLife = ({ life }: Tool) => life.minutes !== null || life.parts !== null || life.sister !== null;
/** Rounded down: only a life that is over is shown as used up. */
const minutes = (value: number) => fixed(Math.floor(value * 10) / 10, Number.isInteger(value) ? 0 : 1);

export function Tools() {
  const [tools, setTools] = useState<Table | null>(null);
  const [number, setNumber] = useState("");
  const [edited, setEdited] = useState<Edited | null>(null);
  const [opened, setOpened] = useState<number | null>(null);
  const now = useStatus((s) => s.tool) ?? 0;
  // At rest, whatever changes the table is told in the journal.
  const last = useStatus((s) => s.activity === "idle" && s.messages.at(-1)?.seq);
  const fetch = () => void ask("tool.list").then(setTools, tellRefused);
  useEffect(fetch, [now, last]);
  const change = (params: Params<"tool.set">) => order("tool.set", params).then((answer) => (fetch(), answer));
  const wanted = number === "" ? null : parseNumber(number);
  const all = tools?.tools ?? [];
  const shown = all.filter((one) => (wanted === null ? one.tool === now || one.length !== 0 || one.diameter !== 0 || one.remark !== "" || hasLife(one) || all.length < 30 : one.tool === wanted));
  const isNew = tools !== null && wanted !== null && Number.isInteger(wanted) && wanted > 0 && !all.some((one) => one.tool === wanted);
  const tool = all.find((one) => one.tool === opened);
  const lives = all.some(hasLife);
  return (
    <Card title={`${t("tools")}, ${tools?.unit ?? ""}`}>
      <div class="row wide">
        <Field numeric id="tool-find" label={t("tool-find")} value={number} onInput={setNumber} />
        {isNew && <Button id="tool-add" kind="go" icon="plus" label={t("tool-add", { tool: wanted })} orders="tool.set" onClick={() => void change({ tool: wanted, length: 0 }).then((answer) => answer && setOpened(wanted))} />}
        <p class="muted">{t("in-spindle", { tool: now ? `T${now}` : t("tool-none") })}</p>
      </div>
      <div class="scroll" tabIndex={0} role="group" aria-label={t("tools")}>
        <table class="grid">
          <thead>
            <tr>
              <th scope="col">T</th>
              <th scope="col">{t("pocket")}</th>
              <th scope="col">{t("length")}</th>
              <th scope="col">{t("diameter")}</th>
              {lives && <th scope="col" class="text">{t("tool-life")}</th>}
              <th scope="col">{t("remark")}</th>
            </tr>
          </thead>
          <tbody>
            {shown.map((one) => (
              <tr key={one.tool} class={one.tool === now ? "active" : ""}>
                <th scope="row">
                  <button type="button" data-testid={`tool-${one.tool}`} title={t("tool-open")} onClick={() => setOpened(one.tool)}>
                    T{one.tool}
                    {one.worn_out && <Icon name="warning" />}
                  </button>
                </th>
                <td>{one.pocket}</td>
                {MEASURES.map((what) => (
                  <td key={what}>
                    <button
                      type="button"
                      onClick={() =>
                        setEdited({
                          title: `T${one.tool} ${t(what)}`,
                          value: fixed(one[what], 4),
                          note: wearOf(one, what) === 0 ? undefined : t("tool-wear-ends", { wear: signed(wearOf(one, what)) }),
                          set: (value) => change({ tool: one.tool, [what]: value }),
                        })
                      }
                    >
                      {fixed(one[what], 3)}
                      {wearOf(one, what) !== 0 && <small data-testid={`tool-${one.tool}-${what}-wear`}> {signed(wearOf(one, what))}</small>}
                    </button>
                  </td>
                ))}
                {lives && (
                  <td>
                    <Life tool={one} />
                  </td>
                )}
                <td>{one.remark}</td>
              </tr>
            ))}
          </tbody>
        </table>
      </div>
      <p class="muted">
        {t("tool-tap")} {t("tool-g43")}
      </p>
      {edited && <Edit edited={edited} onClose={() => setEdited(null)} />}
      {tool && <ToolDialog key={tool.tool} tool={tool} unit={tools!.unit} isIn={tool.tool === now} change={change} onDeleted={fetch} onClose={() => setOpened(null)} />}
    </Card>
  );
}

/** How much of its life a tool has used, and what takes its place. */
function Life({ tool: { tool, life, worn_out } }: { tool: Tool }) {
  const used: [number, string][] = [];
  if (life.minutes !== null) used.push([life.used_minutes / life.minutes, t("tool-used-minutes", { used: minutes(life.used_minutes), of: minutes(life.minutes) })]);
  if (life.parts !== null) used.push([life.used_parts / life.parts, t("tool-used-parts", { used: life.used_parts, of: life.parts })]);
  return (
    <div class={worn_out ? "life over" : "life"} data-testid={`tool-${tool}-life`}>
      {used.map(([share, text]) => (
        <span key={text}>
          {text}
          <span class="track">
            <i style={{ width: `${Math.min(100, 100 * share)}%` }} />
          </span>
        </span>
      ))}
      {worn_out && (
        <b>
          <Icon name="warning" /> {t("tool-worn-out")}
        </b>
      )}
      {life.sister !== null && (
        <span>
          <span class="hidden">{t("tool-sister")} </span>→ T{life.sister}
        </span>
      )}
    </div>
  );
}

type Change = (params: Params<"tool.set">) => Promise<unknown>;

/** What is not a measure: the remark, the pocket, wear and life, the spindle, and the end of it. */
function ToolDialog({ tool, unit, isIn, change, onDeleted, onClose }: { tool: Tool; unit: string; isIn: boolean; change: Change; onDeleted: () => void; onClose: () => void }) {
  const name = `T${tool.tool}`;
  const { life } = tool;
  const before = { remark: tool.remark, pocket: String(tool.pocket), life_minutes: limit(life.minutes), life_parts: limit(life.parts), sister: limit(life.sister) };
  const [now, setNow] = useState(before);
  const [part, setPart] = useState<(typeof PARTS)[number]>("tool");
  const [typed, setTyped] = useState<Typed | null>(null);
  const [deletes, setDeletes] = useState(false);
  const changed = (Object.keys(before) as (keyof typeof before)[]).filter((key) => now[key] !== before[key]);
  // Nothing is no end, and no sister.
  const number = (key: keyof typeof before) => (now[key].trim() === "" && key !== "pocket" ? 0 : parseNumber(now[key]));
  const wrong = changed.some((key) => key !== "remark" && !(number(key) >= 0 && (key === "life_minutes" || Number.isInteger(number(key)))));
  const set = () => void change({ tool: tool.tool, ...Object.fromEntries(changed.map((key) => [key, key === "remark" ? now.remark : number(key)])) }).then((answer) => answer !== undefined && onClose());
  const field = (key: keyof typeof before, id: string, label: string) => <Field numeric={key !== "remark"} id={id} label={label} value={now[key]} onInput={(text) => setNow({ ...now, [key]: text })} />;
  if (typed) return <RunLine typed={typed} onClose={() => setTyped(null)} />;
  if (deletes) {
    return (
      <Dialog key="delete" id="tool-delete-dialogue" title={t("tool-delete", { tool: name })} onClose={() => setDeletes(false)}>
        <p>{t("tool-delete-explained", { tool: name })}</p>
        <p class="strong">
          {tool.remark} {t("tool-details", { length: fixed(tool.length, 3), diameter: fixed(tool.diameter, 3) })}
        </p>
        <footer>
          <Button
            id="tool-delete-yes"
            kind="warn tall"
            icon="trash"
            label={t("tool-delete", { tool: name })}
            orders="tool.delete"
            onClick={() =>
              void order("tool.delete", { tool: tool.tool }).then((answer) => {
                if (answer === undefined) return;
                onDeleted();
                onClose();
              })
            }
          />
        </footer>
      </Dialog>
    );
  }
  const send = <Button id="tool-set" kind="go" label={t("set")} orders="tool.set" disabled={wrong || changed.length === 0} submit />;
  return (
    <Dialog key="edit" id="tool-edit" title={name} onClose={onClose}>
      <Choice label={name} value={part} options={PARTS.map((value) => ({ value, label: t(value), id: `part-${value}` }))} onChange={setPart} />
      {part === "tool" && (
        <>
          <Form onSend={set}>
            {field("remark", "tool-remark", t("remark"))}
            {field("pocket", "tool-pocket", t("pocket"))}
            {send}
          </Form>
          <div class="row">
            <Button id="tool-m6" icon="tool" label={t("tool-change", { tool: name })} orders="mdi" disabled={isIn} onClick={() => setTyped({ title: t("tool-change", { tool: name }), text: t("tool-m6-explained", { tool: name }), line: `${name} M6` })} />
            <Button id="tool-m61" label={t("tool-is-in", { tool: name })} orders="mdi" disabled={isIn} onClick={() => setTyped({ title: t("tool-is-in", { tool: name }), text: t("tool-m61-explained", { tool: name }), line: `M61 Q${tool.tool}` })} />
            <Button id="tool-delete" kind="warn" icon="trash" label={t("tool-delete", { tool: name })} orders="tool.delete" disabled={isIn} onClick={() => setDeletes(true)} />
          </div>
        </>
      )}
      {part === "tool-wear" && MEASURES.map((what) => <Wear key={what} what={what} unit={unit} now={wearOf(tool, what)} set={(value) => change({ tool: tool.tool, [`${what}_wear`]: value })} />)}
      {part === "tool-life" && (
        <Form onSend={set}>
          <div class="both">
            {field("life_minutes", "tool-life-minutes", t("tool-life-minutes"))}
            {field("life_parts", "tool-life-parts", t("tool-life-parts"))}
            {field("sister", "tool-sister", t("tool-sister"))}
          </div>
          <p class="muted">{t("tool-life-explained")}</p>
          {send}
        </Form>
      )}
      {part !== "tool" && (
        <>
          <p class="strong" data-testid="tool-used">
            {t("tool-used", { minutes: minutes(life.used_minutes), parts: life.used_parts })}
          </p>
          <Button
            id="tool-new"
            icon="reset"
            label={t("tool-new")}
            orders="tool.set"
            disabled={life.used_minutes === 0 && life.used_parts === 0 && MEASURES.every((what) => wearOf(tool, what) === 0)}
            onClick={() => void change({ tool: tool.tool, used_minutes: 0, used_parts: 0, length_wear: 0, diameter_wear: 0 })}
          />
        </>
      )}
    </Dialog>
  );
}

const limit = (value: number | null) => (value === null ? "" : String(value));

/** A wear and what is typed for it: a correction that is added to it, or its new value. */
function Wear({ what, unit, now, set }: { what: Measure; unit: string; now: number; set: (value: number) => Promise<unknown> }) {
  const [text, setText] = useState("");
  const typed = parseNumber(text);
  const wrong = Number.isNaN(typed);
  // No 0.30000000000000004.
  const sum = Math.round((now + typed) * 1e6) / 1e6;
  const send = (value: number) => void set(value).then((answer) => answer !== undefined && setText(""));
  const becomes = (value: number) => (wrong ? "" : ` → ${signed(value)}`);
  return (
    <Form kind="row wear" onSend={() => send(sum)}>
      <Field numeric id={`tool-${what}-wear`} label={`${t(what)}, ${unit}: ${signed(now)}`} value={text} onInput={setText} />
      <Button id={`tool-${what}-wear-add`} kind="go" label={t("add") + becomes(sum)} orders="tool.set" disabled={wrong} submit />
      <Button id={`tool-${what}-wear-set`} label={t("set") + becomes(typed)} orders="tool.set" disabled={wrong} onClick={() => send(typed)} />
    </Form>
  );
}
