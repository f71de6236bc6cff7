/** The tool table: what a tool measures and is called, tools added and deleted, and the one in the spindle. */
import { useEffect, useState } from "preact/hooks";
import { fixed, parseNumber, t } from "../i18n";
import type { Params } from "../rpc";
import { ask, order, tellRefused, useStatus } from "../store";
import type { Tool, Tools as Table } from "../types";
import { Button, Card, Dialog, Field, Form } from "../ui";
import { Edit, type Edited, RunLine, type Typed } from "./edit";

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
  const shown = all.filter((one) => (wanted === null ? one.tool === now || one.length !== 0 || one.diameter !== 0 || one.remark !== "" || all.length < 30 : one.tool === wanted));
  const isNew = tools !== null && wanted !== null && Number.isInteger(wanted) && wanted > 0 && !all.some((one) => one.tool === wanted);
  const tool = all.find((one) => one.tool === opened);
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
              <th scope="col">{t("remark")}</th>
            </tr>
          </thead>
          <tbody>
            {shown.map((one) => (
              <tr key={one.tool} class={one.tool === now ? "active" : ""}>
                <th scope="row">
                  <button type="button" data-testid={`tool-${one.tool}`} title={t("tool-open")} onClick={() => setOpened(one.tool)}>
                    T{one.tool}
                  </button>
                </th>
                <td>{one.pocket}</td>
                {(["length", "diameter"] as const).map((what) => (
                  <td key={what}>
                    <button type="button" onClick={() => setEdited({ title: `T${one.tool} ${t(what)}`, value: fixed(one[what], 4), set: (value) => change({ tool: one.tool, [what]: value }) })}>
                      {fixed(one[what], 3)}
                    </button>
                  </td>
                ))}
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
      {tool && <ToolDialog key={tool.tool} tool={tool} isIn={tool.tool === now} change={change} onDeleted={fetch} onClose={() => setOpened(null)} />}
    </Card>
  );
}

/** What is not a measure: the remark, the pocket, the spindle, and the end of it. */
function ToolDialog({ tool, isIn, change, onDeleted, onClose }: { tool: Tool; isIn: boolean; change: (params: Params<"tool.set">) => Promise<unknown>; onDeleted: () => void; onClose: () => void }) {
  const name = `T${tool.tool}`;
  const [remark, setRemark] = useState(tool.remark);
  const [place, setPlace] = useState(String(tool.pocket));
  const [typed, setTyped] = useState<Typed | null>(null);
  const [deletes, setDeletes] = useState(false);
  const pocket = parseNumber(place);
  const wrong = !Number.isInteger(pocket) || pocket < 0;
  const set = () =>
    void change({ tool: tool.tool, ...(remark === tool.remark ? {} : { remark }), ...(pocket === tool.pocket ? {} : { pocket }) }).then((answer) => answer !== undefined && onClose());
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
  return (
    <Dialog key="edit" id="tool-edit" title={name} onClose={onClose}>
      <Form onSend={set}>
        <Field id="tool-remark" label={t("remark")} value={remark} onInput={setRemark} />
        <Field numeric id="tool-pocket" label={t("pocket")} value={place} onInput={setPlace} />
        <Button id="tool-set" kind="go" label={t("set")} orders="tool.set" disabled={wrong || (remark === tool.remark && pocket === tool.pocket)} submit />
      </Form>
      <div class="row">
        <Button id="tool-m6" icon="tool" label={t("tool-change", { tool: name })} orders="mdi" disabled={isIn} onClick={() => setTyped({ title: t("tool-change", { tool: name }), text: t("tool-m6-explained", { tool: name }), line: `${name} M6` })} />
        <Button id="tool-m61" label={t("tool-is-in", { tool: name })} orders="mdi" disabled={isIn} onClick={() => setTyped({ title: t("tool-is-in", { tool: name }), text: t("tool-m61-explained", { tool: name }), line: `M61 Q${tool.tool}` })} />
        <Button id="tool-delete" kind="warn" icon="trash" label={t("tool-delete", { tool: name })} orders="tool.delete" disabled={isIn} onClick={() => setDeletes(true)} />
      </div>
    </Dialog>
  );
}
