/** Runs through the planned time of the program that is loaded, in the picture and in the text: nothing of it moves the machine. */
import { useEffect, useState } from "preact/hooks";
import { duration, t } from "../i18n";
import { setStore, useStatus } from "../store";
import { Button, Choice } from "../ui";
import type { Path } from "./path-view";

const SPEEDS = [1, 10, 60];

/** `whole`: the way is there. */
export function Preview({ path, whole }: { path: Path | null; whole: boolean }) {
  const rests = useStatus((s) => s.activity === "idle" && s.program !== null) ?? false;
  const revision = useStatus((s) => s.program?.revision);
  const [time, setTime] = useState<number | null>(null);
  const [playing, setPlaying] = useState(false);
  const [speed, setSpeed] = useState(10);
  const total = rests && whole ? (path?.plannedTime() ?? 0) : 0;
  const end = () => {
    setTime(null);
    setPlaying(false);
  };
  // Another program, or one that runs, is not looked at any more.
  useEffect(end, [revision, rests, whole]);
  useEffect(() => {
    setStore({ previewLine: path?.preview(time) ?? null });
  }, [time]);
  useEffect(() => () => setStore({ previewLine: null }), []);
  useEffect(() => {
    if (!playing) return;
    let [frame, before] = [0, performance.now()];
    const turn = (now: number) => {
      const passed = (speed * Math.max(0, now - before)) / 1000;
      before = now;
      setTime((known) => Math.min(total, (known ?? 0) + passed));
      frame = requestAnimationFrame(turn);
    };
    frame = requestAnimationFrame(turn);
    return () => cancelAnimationFrame(frame);
  }, [playing, speed, total]);
  useEffect(() => {
    if (playing && time !== null && time >= total) setPlaying(false);
  }, [playing, time, total]);
  if (total <= 0) return null;
  const now = time ?? 0;
  return (
    <div class="preview-bar" role="group" aria-label={t("preview")} data-testid="preview" data-time={time ?? ""}>
      <div class="row">
        <Button
          id="preview-play"
          icon={playing ? "hold" : "start"}
          kind="small"
          pressed={playing}
          label={t(playing ? "preview-pause" : "preview-play")}
          onClick={() => {
            if (!playing && now >= total) setTime(0);
            setPlaying(!playing);
          }}
        />
        <Choice label={t("preview-speed")} value={speed} options={SPEEDS.map((value) => ({ value, label: `${value}×`, id: `preview-${value}` }))} onChange={setSpeed} />
        <span class="preview-time" data-testid="preview-time" title={t("preview-explained")}>
          ≈ {duration(now)} {t("of")} {duration(total)}
        </span>
        {time !== null && (
          <Button id="preview-end" kind="small" icon="close" title={t("preview-end")} onClick={end}>
            <span class="hidden">{t("preview-end")}</span>
          </Button>
        )}
      </div>
      <input
        type="range"
        data-testid="preview-slider"
        min={0}
        max={total}
        step={total / 1000}
        value={now}
        aria-label={t("preview")}
        aria-valuetext={`${duration(now)} ${t("of")} ${duration(total)}`}
        onInput={(event) => {
          setPlaying(false);
          setTime(Number(event.currentTarget.value));
        }}
      />
    </div>
  );
}
