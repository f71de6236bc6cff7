/** Zero points: touch-off, origins of the work systems, G92, G28 and G30. */
import { useEffect, useState } from "preact/hooks";
import { fixed, parseNumber, t } from "../i18n";
import { LETTERS, type Letter } from "../machine";
import type { Params } from "../rpc";
import { ask, order, say, tellRefused, useStatus } from "../store";
import type { Offsets as All, Status, Tools, WorkSystem } from "../types";
import { Button, Card, Choice, Field, Form } from "../ui";
import { Edit, type Edited, RunLine, type Typed } from "./edit";
import { inWork } from "./operate";

type SystemName = NonNullable<Params<"offset.set">["system"]>;

export function workOf(s: Status, letter: string): number {
  return inWork(s)[LETTERS.indexOf(letter)] ?? 0;
}

function useOffsets(): [All | null, () => void] {
  const [systems, setSystems] = useState<All | null>(null);
  // At rest, whatever changes one of them is told in the journal.
  const key = useStatus((s) => JSON.stringify([s.work_offset_mm, s.work_rotation_degrees, s.activity === "idle" && s.messages.at(-1)?.seq]));
  const fetch = () => void ask("offset.list").then(setSystems, tellRefused);
  useEffect(fetch, [key]);
  return [systems, fetch];
}

const warned = (answer: { warning?: string } | undefined): void => {
  if (answer?.warning) say("note", answer.warning);
};

/** The order by which a system becomes the active one. */
function activate(system: string): Typed {
  return { title: t("activate", { system }), text: t("activate-explained", { system }), line: system };
}

export function TouchOff() {
  const [what, setWhat] = useState<"work" | "tool">("work");
  return (
    <Card title={t("touch-off")} kind="touch-off">
      <Choice
        label={t("touch-off")}
        value={what}
        options={[
          { value: "work", label: t("touch-off-work"), id: "touch-off-work" },
          { value: "tool", label: t("touch-off-tool"), id: "touch-off-tool" },
        ]}
        onChange={setWhat}
      />
      {what === "work" ? <TouchOffWork /> : <TouchOffTool />}
    </Card>
  );
}

function TouchOffWork() {
  const axes = useStatus((s) => s.axes) ?? [];
  const [values, setValues] = useState<Record<string, string>>({});
  const [chosen, setChosen] = useState<string | null>(null);
  const [typed, setTyped] = useState<Typed | null>(null);
  const [systems, fetch] = useOffsets();
  const now = useStatus((s) => Object.fromEntries(s.axes.map((axis) => [axis.axis, workOf(s, axis.axis)]))) ?? {};
  const active = systems?.systems.find((one) => one.active);
  const system = systems?.systems.find((one) => one.system === chosen) ?? active;
  const number = systems ? systems.systems.indexOf(system!) + 1 : 0;
  const plain = system && active && system.rotation_degrees === 0 && active.rotation_degrees === 0;
  const origin = (of: WorkSystem, axis: string) => of.origin[axis] ?? 0;
  /** What the axis shows in the system that is chosen. */
  const reading = (axis: string) => (system === active ? (now[axis] ?? 0) : plain ? (now[axis] ?? 0) + origin(active, axis) - origin(system, axis) : null);
  const zero = `G10 L20 P${number} ${axes.map(({ axis }) => `${axis}0`).join(" ")}`;
  const name = system?.system ?? "";
  return (
    <>
      <Choice
        label={t("system")}
        value={name}
        options={(systems?.systems ?? []).map((one) => ({ value: one.system, label: one.active ? `${one.system} •` : one.system, id: `touch-off-${one.system}` }))}
        onChange={setChosen}
      />
      <p class="muted">{t(system === active ? "touch-off-explained" : "touch-off-other", { system: name })}</p>
      <ul class="touch">
        {axes.map(({ axis }) => {
          const value = parseNumber(values[axis] ?? "0");
          const shown = reading(axis);
          const before = system?.origin[axis];
          return (
            <li key={axis}>
              <Form
                onSend={() =>
                  void order("touch_off", { axis: axis as Letter, value, ...(system === active ? {} : { system: name as SystemName }) }).then((answer) => {
                    warned(answer);
                    fetch();
                  })
                }
              >
                <Field numeric id={`touch-off-value-${axis.toLowerCase()}`} label={`${axis}, ${systems?.unit ?? ""}`} value={values[axis] ?? "0"} onInput={(text) => setValues({ ...values, [axis]: text })} />
                <p class="preview">
                  {Number.isNaN(value) ? (
                    t("no-number")
                  ) : (
                    <>
                      {axis}: {shown === null ? "–" : fixed(shown, 3)} → <b>{fixed(value, 3)}</b>
                      {plain && !systems!.g92_active && shown !== null && before !== undefined && (
                        <small>
                          {t("origin")}: {fixed(before, 3)} → {fixed(before + shown - value, 3)}
                        </small>
                      )}
                    </>
                  )}
                </p>
                <span class="both">
                  <Button id={`touch-off-half-${axis.toLowerCase()}`} label="½" title={t("touch-off-half")} disabled={shown === null} onClick={() => setValues({ ...values, [axis]: String(Math.round(shown! * 500) / 1000) })}>
                    <span class="hidden">{`${axis}: ${t("touch-off-half")}`}</span>
                  </Button>
                  <Button id={`touch-off-${axis.toLowerCase()}`} label={t("set")} kind="go" orders="touch-off" disabled={Number.isNaN(value)} submit>
                    <span class="hidden">{axis}</span>
                  </Button>
                </span>
              </Form>
            </li>
          );
        })}
      </ul>
      <div class="row">
        <Button id="touch-off-zero" label={t("touch-off-zero", { system: name })} orders="mdi" onClick={() => setTyped({ title: t("touch-off-zero", { system: name }), text: t("touch-off-zero-explained", { system: name }), line: zero })} />
        {system && system !== active && <Button id="touch-off-activate" label={t("activate", { system: name })} orders="mdi" onClick={() => setTyped(activate(name))} />}
      </div>
      {typed && <RunLine typed={typed} onClose={() => setTyped(null)} />}
    </>
  );
}

/** The length of a tool, by touching something whose height is known. */
function TouchOffTool() {
  const now = useStatus((s) => s.tool) ?? 0;
  const machine_z = useStatus((s) => s.position_mm[2]) ?? 0;
  const [text, setText] = useState("0");
  const [number, setNumber] = useState("");
  const [table, setTable] = useState<Tools | null>(null);
  const [systems, fetchOffsets] = useOffsets();
  const fetch = () => void ask("tool.list").then(setTable, tellRefused);
  useEffect(fetch, [now]);
  const [tool, value] = [number === "" ? now : parseNumber(number), parseNumber(text)];
  const known = table?.tools.find((one) => one.tool === tool);
  const active = systems?.systems.find((one) => one.active);
  const length = active && machine_z - (active.origin.Z ?? 0) - (systems!.g92_active ? (systems!.g92.Z ?? 0) : 0) - value;
  const wrong = Number.isNaN(value) ? t("no-number") : known ? "" : t(tool === 0 ? "tool-choose" : "tool-unknown", { tool: String(tool) });
  return (
    <>
      <p class="muted">{t("touch-off-tool-explained")}</p>
      <ul class="touch">
        <li>
          <Form
            onSend={() =>
              void order("touch_off", { axis: "Z", value, tool }).then((answer) => {
                warned(answer);
                fetch();
                fetchOffsets();
              })
            }
          >
            <span class="both">
              <Field numeric id="touch-off-tool-number" label="T" value={number === "" && now ? String(now) : number} onInput={setNumber} />
              <Field numeric id="touch-off-tool-value" label={`Z, ${systems?.unit ?? ""}`} value={text} onInput={setText} />
            </span>
            <p class="preview" data-testid="touch-off-tool-preview">
              {wrong || (
                <>
                  T{tool} {t("length")}: {fixed(known!.length, 3)} → <b>{length === undefined ? "–" : fixed(length, 3)}</b>
                </>
              )}
            </p>
            <Button id="touch-off-tool-set" label={t("set")} kind="go" orders="touch-off" disabled={wrong !== ""} submit />
          </Form>
        </li>
      </ul>
      <p class="muted">{t("tool-g43")}</p>
    </>
  );
}

/** Places that G28 and G30 go to: the first of the parameters that keep each. */
const PLACES = [
  ["g28", "G28", 5161],
  ["g30", "G30", 5181],
] as const;

export function Offsets() {
  const [systems, fetch] = useOffsets();
  const [edited, setEdited] = useState<Edited | null>(null);
  const [typed, setTyped] = useState<Typed | null>(null);
  const axes = useStatus((s) => s.axes.map((axis) => axis.axis)) ?? [];
  const set = (params: Params<"offset.set">) => order("offset.set", params).then((answer) => (fetch(), answer));
  const row = (values: Record<string, number>) => axes.map((axis) => <td key={axis}>{fixed(values[axis] ?? 0, 3)}</td>);
  const head = (first: string, last: string) => (
    <thead>
      <tr>
        <th scope="col">{first}</th>
        {axes.map((axis) => (
          <th scope="col" key={axis}>
            {axis}
          </th>
        ))}
        <th scope="col">{last}</th>
      </tr>
    </thead>
  );
  return (
    <>
      <Card title={`${t("offsets")}, ${systems?.unit ?? ""}`}>
        <div class="scroll" tabIndex={0} role="group" aria-label={t("offsets")}>
          <table class="grid" data-testid="offsets-table">
            {head(t("system"), t("rotation"))}
            <tbody>
              {systems?.systems.map((one) => (
                <tr key={one.system} class={one.active ? "active" : ""}>
                  <th scope="row">
                    {one.active ? (
                      <>
                        {one.system}
                        <small> {t("active")}</small>
                      </>
                    ) : (
                      <button type="button" data-testid={`activate-${one.system}`} title={t("activate", { system: one.system })} onClick={() => setTyped(activate(one.system))}>
                        {one.system}
                      </button>
                    )}
                  </th>
                  {axes.map((axis) => (
                    <td key={axis}>
                      <button
                        type="button"
                        onClick={() =>
                          setEdited({ title: `${one.system} ${axis}`, value: fixed(one.origin[axis] ?? 0, 4), set: (value) => set({ system: one.system as SystemName, axis: axis as Letter, value }) })
                        }
                      >
                        {fixed(one.origin[axis] ?? 0, 3)}
                      </button>
                    </td>
                  ))}
                  <td>
                    <button
                      type="button"
                      onClick={() => setEdited({ title: `${one.system} ${t("rotation")}`, value: fixed(one.rotation_degrees, 4), set: (rotation_degrees) => set({ system: one.system as SystemName, rotation_degrees }) })}
                    >
                      {fixed(one.rotation_degrees, 3)}°
                    </button>
                  </td>
                </tr>
              ))}
            </tbody>
          </table>
        </div>
        <p class="muted">{t("activate-tap")}</p>
      </Card>
      {systems && (
        <Card title={t("places")}>
          <div class="scroll" tabIndex={0} role="group" aria-label={t("places")}>
            <table class="grid" data-testid="places-table">
              {head("", "")}
              <tbody>
                <tr class={systems.g92_active ? "active" : ""}>
                  <th scope="row">
                    G92 <small>{t(systems.g92_active ? "on" : "off")}</small>
                  </th>
                  {row(systems.g92)}
                  <td>
                    <SetOrClear
                      name="g92"
                      onSet={() => setTyped({ title: t("place-set", { place: "G92" }), text: t("g92-explained"), line: `G92 ${axes.map((axis) => `${axis}0`).join(" ")}` })}
                      onClear={() => setTyped({ title: t("place-clear", { place: "G92" }), text: t("g92-clear-explained"), line: "G92.1" })}
                    />
                  </td>
                </tr>
                {PLACES.map(([name, place, first]) => (
                  <tr key={name}>
                    <th scope="row">{place}</th>
                    {row(systems[name])}
                    <td>
                      <SetOrClear
                        name={name}
                        onSet={() => setTyped({ title: t("place-set", { place }), text: t("place-explained", { place }), line: `${place}.1` })}
                        onClear={() => setTyped({ title: t("place-clear", { place }), text: t("place-clear-explained", { place }), line: axes.map((axis) => `#${first + LETTERS.indexOf(axis)}=0`).join(" ") })}
                      />
                    </td>
                  </tr>
                ))}
              </tbody>
            </table>
          </div>
        </Card>
      )}
      {edited && <Edit edited={edited} onClose={() => setEdited(null)} />}
      {typed && <RunLine typed={typed} onClose={() => setTyped(null)} />}
    </>
  );
}

function SetOrClear({ name, onSet, onClear }: { name: string; onSet: () => void; onClear: () => void }) {
  return (
    <span class="both">
      <Button kind="small" id={`${name}-set`} label={t("set")} orders="mdi" onClick={onSet} />
      <Button kind="small" id={`${name}-clear`} label={t("clear")} orders="mdi" onClick={onClear} />
    </span>
  );
}
