/** The picture of the path with its buttons: loads the way, follows the machine, draws when something has changed. */
import { useEffect, useRef, useState } from "preact/hooks";
import { language, t } from "../i18n";
import { machine } from "../machine";
import { isInProgram } from "../orders";
import { getStore, subscribe, useStore } from "../store";
import type { Status } from "../types";
import { Button } from "../ui";
import { PathData, SPEED_MAX_MM_S, SPEED_MIN_MM_S, speedCode } from "./data";
import { FlatPicture } from "./flat";
import { loadPath } from "./load";
import type { Frame, Picture, Zero } from "./picture";
import { Preview } from "./preview";
import { PathTimes } from "./times";
import { type Place, type Standpoint, View } from "./view";

const STANDPOINTS: Standpoint[] = ["iso", "top", "front", "side"];

/** `previews`: with a slider through the planned time of the program. */
export function PathView({ previews }: { previews?: boolean } = {}) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const labels = useRef<HTMLCanvasElement>(null);
  const path = useRef<Path | null>(null);
  const [note, setNote] = useState("");
  const [legend, setLegend] = useState<[number, number] | null>(null);
  const [whole, setWhole] = useState(false);
  const previewed = useStore((s) => s.previewLine !== null);
  useEffect(() => {
    const made = new Path(canvas.current!, labels.current!, setNote, setLegend, setWhole);
    path.current = made;
    return () => made.dispose();
  }, []);
  return (
    <>
      <div class="path">
        <div class={previewed ? "picture previewed" : "picture"}>
          <canvas data-testid="path" ref={canvas} role="img" tabIndex={0} aria-label={t("path")} />
          <canvas ref={labels} class="labels" aria-hidden="true" />
          <p class="note" data-testid="path-note">{note}</p>
          {previewed && (
            <p class="preview-tag" data-testid="preview-tag">
              {t("preview")}
            </p>
          )}
          <Legend span={legend} />
        </div>
        <div class="views" role="group" aria-label={t("path")}>
          {STANDPOINTS.map((standpoint) => (
            <Button key={standpoint} id={`view-${standpoint}`} kind="small" label={t(`view-${standpoint}`)} onClick={() => path.current?.stand(standpoint)} />
          ))}
          <Button id="view-fit" kind="small" label={t("view-fit")} onClick={() => path.current?.fit()} />
        </div>
      </div>
      {previews && <Preview path={path.current} whole={whole} />}
    </>
  );
}

function Legend({ span }: { span: [number, number] | null }) {
  return (
    <div class="legend">
      <span class="rapid">{t("legend-rapid")}</span>
      <span class="feed">{t("legend-feed")}</span>
      <span class="done">
        {t("legend-done")}
        {span && (
          <span class="ramp">
            {Math.round(span[0])} <i /> {Math.round(span[1])} mm/min
          </span>
        )}
      </span>
    </div>
  );
}

/** Behind the last touch of a hand the picture is taken to move for so long, ms. */
const MOVES_MS = 200;

/** Speed of a code, mm/s: the other way round of speedCode. */
const speedOf = (code: number) => SPEED_MIN_MM_S * (SPEED_MAX_MM_S / SPEED_MIN_MM_S) ** ((code - 2) / 253);

export class Path {
  private view = new View();
  private data = new PathData();
  private picture: Picture | null = null;
  private wanted = false;
  private disposed = false;
  private loading = "";
  private loaded = "";
  private speeds: [number, number] = [255, 2];
  private ends: (() => void)[] = [];
  private error = "";
  /** Somebody looks at it from where he wants to: nothing but he changes that. */
  private moved = false;
  private ran = false;
  /** A hand turns the picture until then, and a whole picture has its pause until then; when the one under way was begun (0: none is), ms. */
  private movingUntil = 0;
  private rest = 0;
  private drawnAt = 0;
  /** The last picture was one of those in motion, which may lack something. */
  private coarse = false;
  private urgent = false;
  private awake = false;
  private times: PathTimes | null = null;
  private previewed: Place | null = null;

  constructor(
    private canvas: HTMLCanvasElement,
    private labels: HTMLCanvasElement,
    private tellNote: (note: string) => void,
    private tellLegend: (span: [number, number] | null) => void,
    private tellWhole: (whole: boolean) => void,
  ) {
    const size = new ResizeObserver(() => this.resize());
    size.observe(canvas);
    this.ends.push(() => size.disconnect(), subscribe(() => this.follow()), this.hands());
    const theme = new MutationObserver(() => this.draw());
    theme.observe(document.documentElement, { attributes: true });
    this.ends.push(() => theme.disconnect(), machine.subscribe(() => this.described()));
    void this.begin();
  }

  /** Three.js comes when the rest of the page is there. */
  private async begin(): Promise<void> {
    try {
      const { ScenePicture } = await import("./scene");
      if (this.disposed) return;
      this.picture = new ScenePicture(this.canvas);
      this.canvas.dataset.renderer = "webgl2";
    } catch {
      if (this.disposed) return;
      this.picture = new FlatPicture(this.canvas);
      this.canvas.dataset.renderer = "flat";
    }
    this.resize();
    this.follow();
  }

  /** The machine is another one, or known only now. */
  private described(): void {
    this.times = null;
    if (!this.moved) this.fit();
  }

  dispose(): void {
    this.disposed = true;
    for (const end of this.ends) end();
    this.picture?.dispose();
  }

  stand(standpoint: Standpoint): void {
    this.view.stand(standpoint);
    this.fit();
  }

  /** The path, and the travel where there is no path. */
  fit(): void {
    this.moved = false;
    const box = this.box();
    if (this.data.count > 1) this.view.fit(this.data.min, this.data.max);
    else if (box) this.view.fit(box.min, box.max);
    else this.view.fit([-50, -50, -50], [50, 50, 50]);
    this.draw();
  }

  /** What the way takes, s; 0 where that is not known. */
  plannedTime(): number {
    const planned = getStore().status?.program?.planned_time_s ?? 0;
    if (this.times?.total !== planned) this.times = new PathTimes(this.data, planned, rapidTime);
    return this.times.total;
  }

  /** Shows where the tool would be at a time, or no such tool any more; the line of it. */
  preview(time_s: number | null): number | null {
    const at = time_s === null || this.data.count < 2 ? null : (this.plannedTime(), this.times!.at(time_s));
    this.previewed = at?.place ?? null;
    this.draw(time_s !== null);
    return at?.line ?? null;
  }

  private resize(): void {
    const { clientWidth, clientHeight } = this.canvas;
    if (!clientWidth || !clientHeight) return;
    this.view.width = clientWidth;
    this.view.height = clientHeight;
    if (this.moved) this.draw();
    else this.fit();
  }

  /** A message has come. */
  private follow(): void {
    const { status } = getStore();
    if (!status || !this.picture) return;
    this.load(status);
    const runs = ["running", "held", "away", "returning", "stopping"].includes(status.activity) && isInProgram(status);
    if (runs && !this.ran) this.data.restart();
    if (runs && this.data.count > 1 && this.loaded === nameOf(status) && status.activity !== "away" && status.activity !== "returning") {
      const place = xyz(status.position_mm);
      const before = this.data.reached;
      this.data.locate(place, status.line, status.done_percent === null ? null : status.done_percent / 100, status.velocity_mm_s, status.direction === "reverse");
      if (this.data.reached > before && before >= 0) this.saw(status.velocity_mm_s);
    }
    this.ran = runs;
    this.draw(false);
  }

  private saw(mm_s: number): void {
    if (mm_s < 0.2) return;
    const code = speedCode(mm_s);
    const [low, high] = this.speeds;
    if (code >= low && code <= high) return;
    this.speeds = [Math.min(low, code), Math.max(high, code)];
    this.tellLegend([60 * speedOf(this.speeds[0]), 60 * speedOf(this.speeds[1])]);
  }

  /** A program that is new, or begins elsewhere, is drawn anew; while it runs it is left as it is. */
  private load(status: Status): void {
    const key = keyOf(status);
    const busy = status.activity !== "idle" && this.loading !== "" && nameOf(status) === this.loaded;
    if (key === this.loading || busy || !getStore().connected) return;
    this.loading = key;
    this.data = new PathData(status.work_rotation_degrees);
    this.times = null;
    this.previewed = null;
    this.tellWhole(false);
    this.speeds = [255, 2];
    this.tellLegend(null);
    this.error = "";
    this.loaded = nameOf(status);
    if (!status.program) {
      this.loading = key;
      this.note(false);
      this.fit();
      return;
    }
    const data = this.data;
    let fitted = 0;
    const told = () => {
      // While it grows the picture grows with it, twice as large each time.
      if (data.count > 2 * fitted && !this.moved) {
        fitted = data.count;
        this.fit();
      }
      this.note(true);
      this.draw();
    };
    loadPath(data, told, () => !this.disposed && this.data === data).then(
      (error) => {
        if (this.data !== data) return;
        this.error = error ?? "";
        this.note(false);
        this.tellWhole(true);
        if (!this.moved) this.fit();
      },
      (error: Error) => {
        if (this.data !== data) return;
        this.error = error.message;
        this.note(false);
        // Asked for again after the next connection.
        if (!getStore().connected) this.loading = "";
      },
    );
  }

  private note(under_way: boolean): void {
    const { segments } = this.data;
    const told = under_way ? t("path-loading", { n: segments.toLocaleString(language) }) : this.size();
    const flat = this.canvas.dataset.renderer === "flat" ? ` (${t("path-flat")})` : "";
    this.canvas.dataset.segments = String(segments);
    this.canvas.dataset.whole = String(!under_way);
    this.tellNote((this.error || (segments ? told : "")) + flat);
  }

  /** How large the part is, as far as the moves at feed tell. */
  private size(): string {
    const { feedMin, feedMax } = this.data;
    if (feedMin[0] > feedMax[0]) return "";
    const number = (k: number) => (feedMax[k]! - feedMin[k]!).toLocaleString(language, { maximumFractionDigits: 2, useGrouping: false });
    const axes = getStore().status?.axes.map(({ axis }) => axis) ?? [];
    return `${["X", "Y", "Z"].flatMap((axis, k) => (axes.includes(axis) ? `${axis} ${number(k)}` : [])).join(" × ")} mm`;
  }

  private box(): Frame["box"] {
    const described = machine.get();
    if (!described) return null;
    const [min, max] = [[0, 0, 0], [0, 0, 0]] as [[number, number, number], [number, number, number]];
    ["X", "Y", "Z"].forEach((letter, k) => {
      const axis = described.axes.find((one) => one.axis === letter);
      min[k] = axis?.travel?.[0] ?? 0;
      max[k] = axis?.travel?.[1] ?? 0;
    });
    return { min, max };
  }

  /** `urgent`: a hand, or another path, has changed the picture, and not only the machine, which will do so again. */
  private draw(urgent = true): void {
    this.wanted = true;
    this.urgent ||= urgent;
    if (this.awake || this.disposed) return;
    this.awake = true;
    this.canvas.dataset.busy = "true";
    requestAnimationFrame(() => this.turn());
  }

  /** Draws when the last picture is on the screen, if there is something to draw. */
  private turn(): void {
    const { picture } = this;
    const now = performance.now();
    const moving = now < this.movingUntil;
    const again = () => void requestAnimationFrame(() => this.turn());
    if (!this.disposed && picture) {
      if (!picture.ready()) return again();
      // A whole picture that took long has a pause behind it.
      if (this.drawnAt) this.rest = this.coarse ? 0 : now + 2 * (now - this.drawnAt);
      this.drawnAt = 0;
      if (this.canvas.clientWidth && (this.wanted || moving || this.coarse)) {
        if (!moving && !this.urgent && !this.coarse && now < this.rest) return again();
        this.wanted = this.urgent = false;
        this.coarse = moving;
        this.drawnAt = now;
        const frame = this.frame(getStore().status);
        picture.draw(this.view, this.data, frame, moving);
        this.canvas.dataset.drawn = String(Number(this.canvas.dataset.drawn ?? 0) + 1);
        this.write(frame);
        return again();
      }
    }
    this.awake = false;
    this.canvas.dataset.busy = "false";
  }

  private frame(status: Status | null): Frame {
    const style = getComputedStyle(this.canvas);
    const colour = (name: string) => style.getPropertyValue(`--path-${name}`).trim();
    const zeros: Zero[] = [{ name: "M", place: [0, 0, 0], axes: turned(0), large: false }];
    if (status) zeros.push({ name: status.codes.find((code) => /^G5[4-9]/.test(code)) ?? "W", place: xyz(status.work_offset_mm), axes: turned(status.work_rotation_degrees), large: true });
    const reached = this.data.reached;
    return {
      colours: {
        background: colour("background"),
        rapid: colour("rapid"),
        feed: colour("feed"),
        probe: colour("probe"),
        ramp: [0, 1, 2, 3, 4].map((i) => colour(`ramp-${i}`)),
        box: colour("box"),
        grid: colour("grid"),
        axes: [0, 1, 2].map((i) => colour(`axis-${i}`)),
        tool: colour("tool"),
        preview: colour("preview"),
        text: colour("text"),
      },
      span: this.speeds[0] <= this.speeds[1] ? this.speeds : [2, 255],
      box: this.box(),
      zeros,
      unit: 28 / this.view.pixels_per_mm,
      tool: status ? xyz(status.position_mm) : null,
      preview: this.previewed,
      tailFrom: this.ran && reached >= 0 && status?.activity !== "away" ? reached : null,
    };
  }

  /** Names of the zeros and of their axes. */
  private write(frame: Frame): void {
    const { labels, view } = this;
    labels.width = view.width * devicePixelRatio;
    labels.height = view.height * devicePixelRatio;
    const c = labels.getContext("2d")!;
    c.scale(devicePixelRatio, devicePixelRatio);
    c.font = "600 12px system-ui, sans-serif";
    c.textAlign = "center";
    c.textBaseline = "middle";
    if (frame.preview) {
      const [x, y] = view.project(frame.preview);
      c.fillStyle = frame.colours.preview;
      c.fillText(t("preview"), x, y - 52);
    }
    for (const zero of frame.zeros) {
      const [x, y] = view.project(zero.place);
      c.fillStyle = frame.colours.text;
      c.fillText(zero.name, x - 12, y + 10);
      if (!zero.large) continue;
      zero.axes.forEach((axis, k) => {
        const [ex, ey] = view.project(zero.place.map((v, i) => v + axis[i]! * frame.unit * 1.4) as [number, number, number]);
        const length = Math.hypot(ex - x, ey - y);
        if (length < 8) return;
        c.fillStyle = frame.colours.axes[k]!;
        c.fillText("XYZ"[k]!, ex + ((ex - x) / length) * 9, ey + ((ey - y) / length) * 9);
      });
    }
  }

  /** Fingers, mouse and keys: turn by one, move and zoom by two; with a mouse, the right button or shift moves. */
  private hands(): () => void {
    const canvas = this.canvas;
    const down = new Map<number, [number, number]>();
    const changed = () => {
      this.moved = true;
      this.movingUntil = performance.now() + MOVES_MS;
      this.draw();
    };
    const at = (event: PointerEvent | WheelEvent): [number, number] => {
      const box = canvas.getBoundingClientRect();
      return [event.clientX - box.left, event.clientY - box.top];
    };
    const events: Record<string, (event: never) => void> = {
      pointerdown: (event: PointerEvent) => {
        canvas.setPointerCapture(event.pointerId);
        down.set(event.pointerId, at(event));
      },
      pointermove: (event: PointerEvent) => {
        const before = down.get(event.pointerId);
        if (!before) return;
        const now = at(event);
        const [dx, dy] = [now[0] - before[0], now[1] - before[1]];
        const other = [...down.entries()].find(([id]) => id !== event.pointerId)?.[1];
        if (other) {
          const span = (p: [number, number]) => Math.hypot(p[0] - other[0], p[1] - other[1]);
          this.view.zoom(span(now) / Math.max(1, span(before)), (now[0] + other[0]) / 2, (now[1] + other[1]) / 2);
          this.view.pan(dx / 2, dy / 2);
        } else if (event.shiftKey || event.buttons & 6) this.view.pan(dx, dy);
        else this.view.turn(dx, dy);
        down.set(event.pointerId, now);
        changed();
      },
      pointerup: (event: PointerEvent) => void down.delete(event.pointerId),
      pointercancel: (event: PointerEvent) => void down.delete(event.pointerId),
      wheel: (event: WheelEvent) => {
        event.preventDefault();
        this.view.zoom(Math.exp(-event.deltaY * 0.0015), ...at(event));
        changed();
      },
      contextmenu: (event: Event) => event.preventDefault(),
      keydown: (event: KeyboardEvent) => {
        const turns: Record<string, [number, number]> = { ArrowLeft: [-10, 0], ArrowRight: [10, 0], ArrowUp: [0, -10], ArrowDown: [0, 10] };
        const turn = turns[event.key];
        if (turn && document.documentElement.dataset.keys !== "on") this.view.turn(...turn);
        else if (event.key === "+" || event.key === "-") this.view.zoom(event.key === "+" ? 1.25 : 0.8, this.view.width / 2, this.view.height / 2);
        else return;
        event.preventDefault();
        changed();
      },
    };
    const entries = Object.entries(events) as [string, (event: Event) => void][];
    for (const [name, heard] of entries) canvas.addEventListener(name, heard, { passive: false });
    return () => {
      for (const [name, heard] of entries) canvas.removeEventListener(name, heard);
    };
  }
}

/** How long the axes need for a rapid move, s, at their greatest speeds. */
function rapidTime(...by: [number, number, number]): number {
  const axes = machine.get()?.axes ?? [];
  return Math.max(...["X", "Y", "Z"].map((letter, k) => Math.abs(by[k]!) / (axes.find(({ axis }) => axis === letter)?.velocity_per_s ?? Infinity)));
}

const nameOf = (status: Status) => JSON.stringify([status.program?.name, status.program?.lines, status.program?.revision]);

const keyOf = (status: Status) =>
  JSON.stringify([nameOf(status), status.program?.planned_time_s, status.work_offset_mm, status.work_rotation_degrees, status.block_delete]);

/** X, Y and Z of nine numbers. */
function xyz(numbers: readonly number[]): [number, number, number] {
  return [numbers[0]!, numbers[1]!, numbers[2]!];
}

function turned(degrees: number): [number, number, number][] {
  const [s, c] = [Math.sin((degrees * Math.PI) / 180), Math.cos((degrees * Math.PI) / 180)];
  return [[c, s, 0], [-s, c, 0], [0, 0, 1]];
}
