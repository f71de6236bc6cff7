/** Simple jobs: numbers in, their picture and the program out; it is loaded like any other program, and only Start runs it. */
import { useEffect, useState } from "preact/hooks";
import { inWords } from "../control-words";
import { parseNumber, t, word } from "../i18n";
import { JobPicture } from "../job-picture";
import { PathView } from "../path/path-view";
import { Refused } from "../rpc";
import { send } from "../send";
import { ask, tellRefused, useStatus } from "../store";
import type { Job, JobField, JobKind, JobValue } from "../types";
import { Button, Card, Field } from "../ui";

/** Behind the last key the program is written after so long, ms. */
const TYPING_MS = 250;

type Typed = Record<string, string>;

interface Wrong {
  field: string | undefined;
  text: string;
}

function kept(kind: string): Typed {
  try {
    return JSON.parse(localStorage.getItem(`job-${kind}`) ?? "{}") as Typed;
  } catch {
    return {};
  }
}

/** As it was typed, or its default. */
const shown = (field: JobField, typed: Typed): string => typed[field.name] ?? String(field.default);

const isNumber = ({ default: value }: JobField) => typeof value === "number";

/** What is sent: a text that is no number is left for the control to refuse. */
function given(fields: JobField[], typed: Typed): Record<string, JobValue> {
  const value = (field: JobField): JobValue => {
    const text = shown(field, typed);
    const number = isNumber(field) ? parseNumber(text) : NaN;
    return Number.isNaN(number) ? text : number;
  };
  return Object.fromEntries(fields.map((field) => [field.name, value(field)]));
}

function label(kind: string, { name, unit }: JobField): string {
  const own = `job-field-${kind.replaceAll("_", "-")}`;
  const special = word(own, name);
  const text = special === name ? word("job-field", name) : special;
  return unit ? `${text}, ${unit === "degrees" ? "°" : unit}` : text;
}

function Input({ kind, field, value, wrong, onInput }: { kind: string; field: JobField; value: string; wrong: string | undefined; onInput: (value: string) => void }) {
  const id = `job-${field.name}`;
  return (
    <div class={wrong ? "job-field wrong" : "job-field"}>
      {field.choices.length ? (
        <label class="field">
          <span>{label(kind, field)}</span>
          <select data-testid={id} value={value} onChange={(event) => onInput(event.currentTarget.value)}>
            {field.choices.map((choice) => (
              <option key={choice} value={choice}>
                {word("job-choice", choice)}
              </option>
            ))}
          </select>
        </label>
      ) : (
        <Field id={id} numeric={isNumber(field)} label={label(kind, field)} value={value} onInput={onInput} />
      )}
      {wrong && (
        <p class="error" role="alert" data-testid={`${id}-wrong`}>
          {wrong}
        </p>
      )}
    </div>
  );
}

export function Jobs() {
  const [kinds, setKinds] = useState<JobKind[]>([]);
  const [chosen, setChosen] = useState(localStorage.getItem("job-kind") ?? "");
  const [typed, setTyped] = useState<Typed>({});
  const [job, setJob] = useState<Job | null>(null);
  const [wrong, setWrong] = useState<Wrong | null>(null);
  const [loading, setLoading] = useState(false);
  const program = useStatus((s) => s.program?.name);
  const kind = kinds.find((one) => one.kind === chosen) ?? kinds[0];
  useEffect(() => {
    void ask("job.kinds").then(setKinds, tellRefused);
  }, []);
  useEffect(() => {
    if (kind) setTyped(kept(kind.kind));
  }, [kind]);
  useEffect(() => {
    if (!kind) return;
    let over = false;
    const write = async () => {
      try {
        const made = await ask("job.make", { kind: kind.kind, numbers: given(kind.fields, typed) });
        if (over) return;
        setJob(made);
        setWrong(null);
      } catch (error) {
        if (over) return;
        setJob(null);
        setWrong({ field: (error as Refused).field, text: error instanceof Refused ? inWords(error.said) : String(error) });
      }
    };
    const waits = setTimeout(() => void write(), TYPING_MS);
    return () => {
      over = true;
      clearTimeout(waits);
    };
  }, [kind, typed]);
  if (!kind) return <p class="muted">{t("connecting")}</p>;
  const type = (values: Typed) => {
    // What is loaded is what is shown.
    setJob(null);
    setTyped(values);
    localStorage.setItem(`job-${kind.kind}`, JSON.stringify(values));
  };
  const choose = (next: string) => {
    if (next === kind.kind) return;
    setJob(null);
    setChosen(next);
    localStorage.setItem("job-kind", next);
  };
  const load = async () => {
    setLoading(true);
    await send(new File([job!.text], job!.name), () => {}).catch(tellRefused);
    setLoading(false);
  };
  const save = () => {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([job!.text], { type: "text/plain" }));
    link.download = job!.name;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
  };
  return (
    <div class="page programs jobs">
      <div class="column">
        <Card title={t("page-jobs")} tools={<Button label={t("job-defaults")} id="job-defaults" onClick={() => type({})} />}>
          <label class="field">
            <span>{t("job-kind")}</span>
            <select
              data-testid="job-kind"
              value={kind.kind}
              onChange={(event) => choose(event.currentTarget.value)}
            >
              {kinds.map((one) => (
                <option key={one.kind} value={one.kind}>
                  {word("job", one.kind)}
                </option>
              ))}
            </select>
          </label>
          <div class="job-fields">
            {kind.fields.map((field) => (
              <Input
                key={`${kind.kind} ${field.name}`}
                kind={kind.kind}
                field={field}
                value={shown(field, typed)}
                wrong={wrong?.field === field.name ? wrong.text : undefined}
                onInput={(value) => type({ ...typed, [field.name]: value })}
              />
            ))}
          </div>
        </Card>
      </div>
      <div class="column">
        <Card title={word("job", kind.kind)}>
          <JobPicture kind={kind.kind} numbers={given(kind.fields, typed)} />
        </Card>
        <Card
          title={t("program")}
          tools={
            <div class="row">
              <Button id="job-save" label={t("job-save")} disabled={!job} onClick={save} />
              <Button id="job-load" kind="go" icon="upload" label={t("job-load")} orders="program load" disabled={!job || loading} onClick={() => void load()} />
            </div>
          }
        >
          {wrong && !wrong.field && <p class="error">{wrong.text}</p>}
          {job ? <pre class="job-text" data-testid="job-program" tabIndex={0} aria-label={t("program")}>{job.text}</pre> : <p class="muted">{wrong ? t("job-wrong") : t("job-writing")}</p>}
        </Card>
        {job && program === job.name && (
          <Card kind="path-card" title={t("job-loaded")}>
            <PathView />
          </Card>
        )}
      </div>
    </div>
  );
}
