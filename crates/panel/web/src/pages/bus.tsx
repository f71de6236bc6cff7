/** The network: who is there, how each node is, why; objects by SDO; what the cycle has left of its time. */
import { useEffect, useState } from "preact/hooks";
import { useSmall } from "../hooks";
import { fixed, t } from "../i18n";
import { OBJECT_NAMES, type ObjectAddress, type ObjectType, TYPES, addressOf, encoded, meaningOf, nameOf, rangeOf, typeOf, written } from "../objects";
import { ask, connection, order, useStatus, useStore } from "../store";
import type { Histogram } from "../types";
import { Button, Card, Choice, Field, Form, Icon } from "../ui";
import { Measurements } from "./measurements";

interface Node {
  id: number;
  name: string;
  profile: string;
  mandatory?: boolean;
  /** Objects that it exchanges in each cycle. */
  inputs?: ObjectAddress[];
  outputs?: ObjectAddress[];
  live: {
    nmt_state: string;
    operational: boolean;
    stage: string;
    why: string | null;
    lost: number;
    late: number;
    lost_in_row_max: number;
    polls: number;
    response_max_us: number;
    boots: number;
    errors_total: number;
    last_fault: string | null;
    /** In words, the newest first. */
    errors: string[];
  } | null;
}

interface Network {
  interface: string;
  cycle_us: number;
  budget: { part: string; node: number | null; wire_us: number; worst_us: number }[];
  live: { nmt_state: string; why: string | null; cycles: number; cycles_skipped: number; cycles_overrun: number; bad_frames: number; async_timeouts: number } | null;
  nodes: Node[];
}

function useNetwork(): [Network | null, string] {
  const [network, setNetwork] = useState<Network | null>(null);
  const [error, setError] = useState("");
  useEffect(() => {
    const fetch = () =>
      connection.call("bus.network").then(
        (answer) => {
          setNetwork(answer as unknown as Network);
          setError("");
        },
        (refused: Error) => setError(refused.message),
      );
    void fetch();
    const timer = setInterval(fetch, 1000);
    return () => clearInterval(timer);
  }, []);
  return [network, error];
}

function NodeCard({ node, chosen, onChoose }: { node: Node; chosen: boolean; onChoose: () => void }) {
  const { live } = node;
  return (
    <li class={live?.operational ? "node good" : "node bad"}>
      <button type="button" aria-pressed={chosen} data-testid={`node-${node.id}`} onClick={onChoose}>
        <Icon name={live?.operational ? "check" : "warning"} />
        <b>{node.name}</b>
        <span class="muted">
          {t("node")} {node.id} · {node.profile}
        </span>
        <strong>{live?.nmt_state ?? "–"}</strong>
        {live?.why && <em>{live.why}</em>}
        {live && (
          <small>
            {t("lost")} {live.lost} · {t("late")} {live.late} · {t("slowest")} {fixed(live.response_max_us, 1)} µs
          </small>
        )}
      </button>
    </li>
  );
}

/** States of CiA 402 by the bits of the statusword 6041h that tell them. */
const STATES: [number, number, string][] = [
  [0x4f, 0x00, "NOT READY TO SWITCH ON"],
  [0x4f, 0x40, "SWITCH ON DISABLED"],
  [0x6f, 0x21, "READY TO SWITCH ON"],
  [0x6f, 0x23, "SWITCHED ON"],
  [0x6f, 0x27, "OPERATION ENABLED"],
  [0x6f, 0x07, "QUICK STOP ACTIVE"],
  [0x4f, 0x0f, "FAULT REACTION ACTIVE"],
  [0x4f, 0x08, "FAULT"],
];

function Objects({ node }: { node: Node }) {
  const [drive, setDrive] = useState<string | null>(null);
  useEffect(() => {
    setDrive(null);
    if (node.profile !== "drive") return;
    const word = (index: number) => ask("bus.sdo_read", { node: node.id, index, sub: 0 }).then(({ value }) => parseInt(value.match(/../g)!.reverse().join(""), 16));
    word(0x6041).then(
      (status) => setDrive(STATES.find(([mask, bits]) => (status & mask) === bits)?.[2] ?? ""),
      () => setDrive(null),
    );
  }, [node.id, node.live?.operational]);
  return (
    <Card title={`${node.name}: ${t("objects")}`}>
      {drive !== null && (
        <ol class="states402" aria-label="CiA 402">
          {STATES.map(([, , name]) => (
            <li key={name} aria-current={name === drive ? "step" : undefined}>
              {name}
            </li>
          ))}
        </ol>
      )}
      {node.live && (node.live.last_fault || node.live.errors.length > 0) && (
        <>
          <h3>{t("node-errors", { n: node.live.errors_total })}</h3>
          <ul class="node-errors scroll" tabIndex={0} aria-label={t("node-errors", { n: node.live.errors_total })}>
            {node.live.last_fault && <li>{node.live.last_fault}</li>}
            {node.live.errors.map((error, at) => (
              <li key={at}>{error}</li>
            ))}
          </ul>
        </>
      )}
      <ObjectForm key={node.id} node={node} />
    </Card>
  );
}

/** An object that is read and written, by its name or its index. */
function ObjectForm({ node }: { node: Node }) {
  const [typed, setTyped] = useState("statusword");
  const [chosen, setChosen] = useState<ObjectType | "">("");
  const [value, setValue] = useState("");
  const [read, setRead] = useState<{ object: ObjectAddress; octets: string } | null>(null);
  const [said, setSaid] = useState("");
  const object = addressOf(typed);
  const own = object && typeOf(object);
  const same = read !== null && object !== null && written(read.object) === written(object);
  // What is read tells its length.
  const length = same ? TYPES.find((type) => type === `u${4 * read.octets.length}`) : undefined;
  const type = chosen || own || length || null;
  const octets = type && encoded(value, type);
  // What the node exchanges in each cycle comes first.
  const mapped = [...(node.inputs ?? []), ...(node.outputs ?? [])];
  const suggestions = [...new Set([...mapped.map((one) => nameOf(one) || written(one)), ...(node.profile === "drive" ? OBJECT_NAMES : OBJECT_NAMES.filter((name) => addressOf(name)!.index < 0x6000))])];
  const meaning = read && meaningOf(read.octets, chosen || typeOf(read.object));
  const look = async () => {
    if (!object) return;
    const answer = await order("bus.sdo_read", { node: node.id, ...object });
    if (answer) setRead({ object, octets: answer.value });
  };
  const write = async () => {
    if (!object || !octets) return;
    setSaid("");
    const done = await order("bus.sdo_write", { node: node.id, ...object, value: octets });
    if (done) setSaid(t("object-written", { value: value.trim(), object: `${nameOf(object)} ${written(object)}`.trim() }));
  };
  return (
    <div class="objects">
      <Form kind="row" onSend={() => void look()}>
        <label class="field wide">
          <span>{t("object")}</span>
          <input
            data-testid="sdo-object"
            list="object-names"
            value={typed}
            autocomplete="off"
            spellcheck={false}
            onInput={(event) => {
              setTyped(event.currentTarget.value);
              setSaid("");
            }}
          />
          <datalist id="object-names">
            {suggestions.map((name) => (
              <option key={name} value={name} />
            ))}
          </datalist>
        </label>
        <label class="field">
          <span>{t("object-type")}</span>
          <select data-testid="sdo-type" value={chosen} onChange={(event) => setChosen(event.currentTarget.value as ObjectType | "")}>
            <option value="">{t("object-type-own", { type: own ?? length ?? t("object-type-length") })}</option>
            {TYPES.map((one) => (
              <option key={one} value={one}>
                {one}
              </option>
            ))}
          </select>
        </label>
        <Button id="sdo-read" label={t("read")} orders="bus.sdo_read" disabled={!object} submit />
      </Form>
      <p class="muted" data-testid="sdo-what">
        {object ? [written(object), nameOf(object)].filter(Boolean).join(" ") : t("object-wrong")}
      </p>
      {read && meaning && (
        <dl class="facts" data-testid="sdo-value">
          <div>
            <dt>{t("object-read")}</dt>
            <dd>{[written(read.object), nameOf(read.object)].filter(Boolean).join(" ")}</dd>
          </div>
          {([["decimal", meaning.decimal], ["hex", meaning.hex], ["text", meaning.text], ["octets", meaning.octets]] as const)
            .filter(([, one]) => one)
            .map(([what, one]) => (
              <div key={what}>
                <dt>{t(`object-as-${what}`)}</dt>
                <dd data-testid={`sdo-${what}`}>{what === "octets" || what === "hex" ? <code>{one}</code> : one}</dd>
              </div>
            ))}
        </dl>
      )}
      <Form kind="row" onSend={() => void write()}>
        <Field id="sdo-new" label={t("object-value")} value={value} onInput={setValue} />
        <Button id="sdo-write" kind="warn" label={t("write")} orders="bus.sdo_write" needs="set-up" disabled={!object || !octets} submit />
      </Form>
      <p class="muted" data-testid="sdo-send">
        {said || (value.trim() === "" ? "" : octets ? t("object-octets", { octets: octets.match(/../g)!.join(" ").toUpperCase() }) : wrongValue(type))}
      </p>
    </div>
  );
}

/** Why a value cannot be written. */
function wrongValue(type: ObjectType | null): string {
  if (type === null) return t("object-no-type");
  if (type === "bytes") return t("object-bytes");
  const [min, max] = rangeOf(type).map(String) as [string, string];
  return type === "string" ? "" : t("object-range", { type, min, max });
}

function Time({ network }: { network: Network }) {
  const late = useStatus((s) => s.late_max_us) ?? 0;
  const used = network.budget.reduce((sum, part) => sum + part.worst_us, 0);
  return (
    <Card title={t("time-budget", { us: network.cycle_us })}>
      <ul class="budget">
        {network.budget.map((part, i) => (
          <li key={i}>
            <span>{part.node === null ? part.part : (network.nodes.find((node) => node.id === part.node)?.name ?? part.part)}</span>
            <span class="bar-track">
              <i style={{ width: `${(100 * part.worst_us) / network.cycle_us}%` }} />
            </span>
            <span>{fixed(part.worst_us, 1)} µs</span>
          </li>
        ))}
        <li class="strong">
          <span>{t("sum")}</span>
          <span />
          <span>
            {fixed(used, 1)} µs ({fixed((100 * used) / network.cycle_us, 0)} %)
          </span>
        </li>
      </ul>
      <dl class="facts">
        <div>
          <dt>{t("cycles")}</dt>
          <dd>{network.live?.cycles ?? "–"}</dd>
        </div>
        <div>
          <dt>{t("cycles-skipped")}</dt>
          <dd>{network.live?.cycles_skipped ?? "–"}</dd>
        </div>
        <div>
          <dt>{t("late-max")}</dt>
          <dd>{fixed(late, 1)} µs</dd>
        </div>
        <div>
          <dt>{t("bad-frames")}</dt>
          <dd>{network.live?.bad_frames ?? "–"}</dd>
        </div>
      </dl>
    </Card>
  );
}

const TIMES = ["period", "lateness", "exchange", "compute"] as const;
type Which = (typeof TIMES)[number];

/** How many cycles took how long: since the start, and while this page is open. */
function Jitter() {
  const [which, setWhich] = useState<Which>("period");
  const [first, setFirst] = useState<Record<Which, Histogram> | null>(null);
  const [now, setNow] = useState<Record<Which, Histogram> | null>(null);
  const [failed, setFailed] = useState("");
  const look = (begin: boolean) =>
    connection.call("cycle.times").then(
      (answer) => {
        if (begin) setFirst(answer);
        setNow(answer);
        setFailed("");
      },
      (refused: Error) => setFailed(refused.message),
    );
  useEffect(() => {
    void look(true);
    const timer = setInterval(() => void look(false), 500);
    return () => clearInterval(timer);
  }, []);
  if (!now || !first) return <Card title={t("jitter")}>{failed && <p class="muted">{failed}</p>}</Card>;
  const { edges_us, counts } = now[which];
  const live = counts.map((count, at) => count - first[which].counts[at]!);
  const [all, seen] = [counts, live].map((list) => list.reduce((sum, count) => sum + count, 0)) as [number, number];
  // Rare cycles are what is looked for: by the logarithm.
  const height = (count: number, sum: number) => (count === 0 ? 0 : 8 + (92 * Math.log10(count + 1)) / Math.log10(sum + 1));
  const label = (at: number) => (at < edges_us.length ? `≤ ${edges_us[at]} µs` : `> ${edges_us.at(-1)} µs`);
  const used = counts.map((count, at) => (count > 0 ? at : -1)).filter((at) => at >= 0);
  const [from, to] = [Math.max(0, (used[0] ?? 0) - 1), Math.min(counts.length - 1, (used.at(-1) ?? 0) + 1)];
  const save = () => {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([JSON.stringify(now, null, 1)], { type: "application/json" }));
    link.download = "isocnc-cycle-times.json";
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
  };
  return (
    <Card id="jitter" title={t("jitter")} tools={<Button label={t("jitter-anew")} onClick={() => setFirst(now)} />}>
      <Choice label={t("jitter")} value={which} options={TIMES.map((value) => ({ value, label: t(`times-${value}`) }))} onChange={setWhich} />
      <ol class="histogram" data-testid="histogram" data-cycles={all} data-live={seen} tabIndex={0} aria-label={t("jitter")}>
        <li class="head">
          <span>{t("histogram-share")}</span>
          <span>{t("histogram-time", { what: t(`times-${which}`) })}</span>
          <span>{t("histogram-all")}</span>
          <span>{t("histogram-live")}</span>
        </li>
        {counts.slice(from, to + 1).map((count, place) => (
          <li key={from + place}>
            <span class="bars">
              <i class="all" style={{ width: `${height(count, all)}%` }} />
              <i class="live" style={{ width: `${height(live[from + place]!, seen)}%` }} />
            </span>
            <span>{label(from + place)}</span>
            <span>{count}</span>
            <span>{live[from + place]}</span>
          </li>
        ))}
        <li class="strong">
          <span />
          <span>{t("sum")}</span>
          <span>{all}</span>
          <span>{seen}</span>
        </li>
      </ol>
      <p class="series">
        <i class="all" /> {t("jitter-all")} <i class="live" /> {t("jitter-live")}
      </p>
      <div class="row">
        <Button label={t("jitter-save")} onClick={save} />
      </div>
    </Card>
  );
}

type Part = "objects" | "time" | "jitter" | "tuning";

export function Bus() {
  const [network, error] = useNetwork();
  const [chosen, setChosen] = useState<number | null>(null);
  const [part, setPart] = useState<Part>("time");
  const times = useStore((s) => s.methods.has("cycle.times"));
  const connected = useStore((s) => s.connected);
  const node = network?.nodes.find((one) => one.id === chosen);
  const small = useSmall();
  const recorded = <Measurements heading={t("recorded")} kinds={["jitter"]} none={t("recorded-none")} />;
  return (
    <div class="page two" data-testid="bus">
      <div class="column">
        <Card title={network ? `${network.interface}: ${network.live?.nmt_state ?? ""}` : t("page-bus")}>
          {error && connected && <p class="muted">{error}</p>}
          {network?.live?.why && <p class="strong">{network.live.why}</p>}
          <ul class="nodes">
            {network?.nodes.map((one) => (
              <NodeCard
                key={one.id}
                node={one}
                chosen={one.id === chosen}
                onChoose={() => {
                  setChosen(one.id);
                  setPart("objects");
                }}
              />
            ))}
          </ul>
        </Card>
        {part === "jitter" && !small && recorded}
      </div>
      <div class="column" tabIndex={0} role="group" aria-label={t("time")}>
        <Choice
          label={t("page-bus")}
          value={part}
          options={
            [
              ...(node ? [{ value: "objects", label: t("objects"), id: "part-objects" }] : []),
              { value: "time", label: t("time"), id: "part-time" },
              ...(times ? [{ value: "jitter", label: t("jitter"), id: "part-jitter" }] : []),
              { value: "tuning", label: t("tuning"), id: "part-tuning" },
            ] as { value: Part; label: string; id: string }[]
          }
          onChange={setPart}
        />
        {part === "jitter" && (
          <>
            <Jitter />
            {small && recorded}
          </>
        )}
        {part === "tuning" && <Measurements heading={t("tuning")} kinds={["step", "sweep", "pid", "ball-bar"]} none={t("tuning-none")} />}
        {part === "objects" && node && part === "objects" ? <Objects node={node} /> : network && (part === "time" || part === "objects") && <Time network={network} />}
      </div>
    </div>
  );
}
