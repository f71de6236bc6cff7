/** What `isocnc tune` and `isocnc jitter` last measured of this machine: their pictures. */
import { useEffect, useState } from "preact/hooks";
import { dateAndTime, t, word } from "../i18n";
import { authorised, useStore } from "../store";
import { Card, Choice } from "../ui";

interface Measurement {
  /** "step-0" is the step of joint 0. */
  name: string;
  unix_s: number;
}

/** What the panel serves at an address below `measurements/`. */
async function fetched(name: string): Promise<Response> {
  const answer = await fetch(`measurements/${name}`, { headers: authorised() });
  if (!answer.ok) throw new Error(((await answer.json()) as { error: string }).error);
  return answer;
}

/** The measurements whose names begin with one of these, the latest first; null while they are not known. */
function useMeasurements(kinds: string[]): Measurement[] | null {
  const [all, setAll] = useState<Measurement[] | null>(null);
  const connected = useStore((s) => s.connected);
  useEffect(() => {
    if (!connected) return;
    fetched("")
      .then((answer) => answer.json())
      .then(
        ({ measurements }: { measurements: Measurement[] }) => setAll(measurements.filter(({ name }) => kinds.some((kind) => name.startsWith(kind)))),
        () => setAll([]),
      );
  }, [connected]);
  return all;
}

/** A picture that is fetched with the token of this panel; touched it has the whole screen. */
function Picture({ of: { name, unix_s } }: { of: Measurement }) {
  const [source, setSource] = useState<string | null>(null);
  useEffect(() => {
    let [wanted, made] = [true, ""];
    fetched(`${name}.svg`)
      .then((answer) => answer.blob())
      .then(
        (blob) => {
          if (!wanted) return;
          made = URL.createObjectURL(blob);
          setSource(made);
        },
        () => setSource(null),
      );
    return () => {
      wanted = false;
      URL.revokeObjectURL(made);
    };
  }, [name, unix_s]);
  if (!source) return null;
  const whole = (image: HTMLElement) => void (document.fullscreenElement ? document.exitFullscreen() : image.requestFullscreen?.().catch(() => {}));
  return (
    <button type="button" class="measured" title={t("measured-larger")} onClick={(event) => whole(event.currentTarget)}>
      <img data-testid={`measured-${name}`} src={source} alt={title(name)} />
    </button>
  );
}

/** "step-0" in words. */
function title(name: string): string {
  const [, kind, joint] = /^(.*?)(?:-(\d+))?$/.exec(name)!;
  return `${word("measured", kind!)}${joint === undefined ? "" : `, ${t("joint")} ${joint}`}`;
}

/** Pictures of some kinds, of which one is looked at. */
export function Measurements({ heading, kinds, none }: { heading: string; kinds: string[]; none: string }) {
  const all = useMeasurements(kinds);
  const [chosen, setChosen] = useState<string | null>(null);
  const one = all?.find(({ name }) => name === chosen) ?? all?.[0];
  return (
    <Card id="measurements" title={heading}>
      {all?.length === 0 && <p class="muted">{none}</p>}
      {all && all.length > 1 && <Choice label={heading} value={one!.name} options={all.map(({ name }) => ({ value: name, label: title(name) }))} onChange={setChosen} />}
      {one && (
        <>
          <p class="muted">
            {all!.length === 1 && `${title(one.name)} · `}
            {dateAndTime(one.unix_s)}
          </p>
          <Picture of={one} />
        </>
      )}
    </Card>
  );
}
