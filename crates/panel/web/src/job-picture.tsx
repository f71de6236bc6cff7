/** The picture of a job, drawn from its numbers: to scale, with its measures. Y is up. */
import type { ComponentChildren } from "preact";
import { fixed, t } from "./i18n";
import type { JobValue } from "./types";

type Point = [number, number];
type Numbers = Record<string, JobValue>;

interface Drawing {
  /** What has to be in the picture, mm. */
  box: [number, number, number, number];
  shapes: ComponentChildren;
  measures: Measure[];
}

/** A measure between two points, drawn so far off to the left of the way from one to the other, in shares of the picture. */
interface Measure {
  from: Point;
  to: Point;
  text: string;
  off: number;
}

const mm = (value: number) => fixed(value, 3).replace(/[.,]?0+$/, "");

export function JobPicture({ kind, numbers }: { kind: string; numbers: Numbers }) {
  // A number that is wrong draws nothing odd.
  const n = (name: string) => (typeof numbers[name] === "number" ? (numbers[name] as number) : 0);
  const drawing = draw(kind, n, numbers);
  if (!drawing) return null;
  const [left, low, right, high] = drawing.box;
  const size = Math.max(right - left, high - low, 1);
  if (!(size < 1e6)) return null;
  const edge = 0.17 * size;
  const place = ([x, y]: Point): Point => [x, -y];
  return (
    <svg class="job-picture" data-testid="job-picture" role="img" aria-label={t("job-picture")} viewBox={[left - edge, -high - edge, right - left + 2 * edge, high - low + 2 * edge].join(" ")} style={{ fontSize: `${0.045 * size}px` }}>
      {drawing.shapes}
      <g class="zero">
        <path d={`M${-0.04 * size} 0H${0.04 * size}M0 ${-0.04 * size}V${0.04 * size}`} />
      </g>
      {drawing.measures.map((measure) => (
        <MeasureLine key={measure.text} measure={{ ...measure, from: place(measure.from), to: place(measure.to) }} size={size} />
      ))}
      <text x={right + 0.9 * edge} y={-low + 0.85 * edge} text-anchor="end">
        {`${t("job-picture-depth")} ${mm(n("depth"))}`}
      </text>
    </svg>
  );
}

function MeasureLine({ measure: { from, to, text, off }, size }: { measure: Measure; size: number }) {
  const [dx, dy] = [to[0] - from[0], to[1] - from[1]];
  const length = Math.hypot(dx, dy);
  if (length === 0) return null;
  // Y is down here: the left of the way.
  const [ox, oy] = [(dy / length) * off * size, (-dx / length) * off * size];
  const [a, b] = [from, to].map(([x, y]) => [x + ox, y + oy]) as [Point, Point];
  const [mx, my] = [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2];
  let angle = (Math.atan2(dy, dx) * 180) / Math.PI;
  if (angle > 90 || angle <= -90) angle += 180;
  return (
    <g class="measure">
      <path d={`M${from}L${a}M${to}L${b}M${a}L${b}`} />
      <circle cx={a[0]} cy={a[1]} r={0.007 * size} />
      <circle cx={b[0]} cy={b[1]} r={0.007 * size} />
      <text x={mx} y={my} dy="-0.3em" text-anchor="middle" transform={`rotate(${angle} ${mx} ${my})`}>
        {text}
      </text>
    </g>
  );
}

function Disc({ at: [x, y], diameter, kind = "" }: { at: Point; diameter: number; kind?: string }) {
  return <circle class={kind} cx={x} cy={-y} r={Math.max(0, diameter / 2)} />;
}

function Box({ at: [x, y], size: [width, height], radius = 0, kind = "" }: { at: Point; size: Point; radius?: number; kind?: string }) {
  return <rect class={kind} x={x} y={-y - height} width={Math.max(0, width)} height={Math.max(0, height)} rx={radius} />;
}

/** A box around points, and so much more on all sides. */
function around(points: Point[], more = 0): [number, number, number, number] {
  const [xs, ys] = [points.map(([x]) => x), points.map(([, y]) => y)];
  return [Math.min(...xs) - more, Math.min(...ys) - more, Math.max(...xs) + more, Math.max(...ys) + more];
}

/** The measure of a circle, above it. */
const across = ([x, y]: Point, diameter: number, text: string): Measure => ({ from: [x - diameter / 2, y + diameter / 2], to: [x + diameter / 2, y + diameter / 2], text, off: 0.08 });

/** Most holes or rows that are drawn. */
const COUNT_MAX = 400;

function draw(kind: string, n: (name: string) => number, numbers: Numbers): Drawing | null {
  const at: Point = [n("x"), n("y")];
  const [x, y] = at;
  const [length, width, diameter, tool] = [n("length"), n("width"), n("diameter"), n("tool_diameter")];
  const polar = (radius: number, degrees: number): Point => [x + radius * Math.cos((degrees * Math.PI) / 180), y + radius * Math.sin((degrees * Math.PI) / 180)];
  switch (kind) {
    case "facing": {
      const along = numbers.along === "y";
      const across = (along ? length : width) + n("overrun");
      const count = Math.min(COUNT_MAX, Math.max(1, Math.ceil(across / (n("stepover") || across) - 1e-6)));
      const reach = n("overrun") + tool / 2;
      const rows = Array.from({ length: count }, (_, row) => ((row + 1) * across) / count - tool / 2);
      const line = (v: number) => (along ? `M${x + v} ${-y + reach}V${-y - width - reach}` : `M${x - reach} ${-y - v}H${x + length + reach}`);
      return {
        box: around([[x, y], [x + length, y + width]], reach),
        shapes: (
          <>
            <Box at={at} size={[length, width]} kind="part" />
            <path class="way" d={rows.map(line).join("")} />
            <Disc at={along ? [x + rows[0]!, y - reach] : [x + length + reach, y + rows[0]!]} diameter={tool} kind="tool" />
          </>
        ),
        measures: [
          { from: [x, y], to: [x, y + width], text: mm(width), off: 0.06 },
          { from: [x, y + width], to: [x + length, y + width], text: mm(length), off: 0.06 },
        ],
      };
    }
    case "rectangular_pocket": {
      const corner: Point = [x - length / 2, y - width / 2];
      const radius = n("corner_radius") || tool / 2;
      return {
        box: around([corner, [x + length / 2, y + width / 2], [0, 0]]),
        shapes: (
          <>
            <Box at={corner} size={[length, width]} radius={radius} kind="pocket" />
            <Disc at={at} diameter={tool} kind="tool" />
          </>
        ),
        measures: [
          { from: corner, to: [corner[0], corner[1] + width], text: mm(width), off: 0.08 },
          { from: [corner[0], corner[1] + width], to: [corner[0] + length, corner[1] + width], text: mm(length), off: 0.08 },
        ],
      };
    }
    case "circular_pocket":
      return {
        box: around([[x - diameter / 2, y - diameter / 2], [x + diameter / 2, y + diameter / 2], [0, 0]]),
        shapes: (
          <>
            <Disc at={at} diameter={diameter} kind="pocket" />
            <Disc at={at} diameter={tool} kind="tool" />
          </>
        ),
        measures: [across(at, diameter, `⌀ ${mm(diameter)}`)],
      };
    case "bolt_circle": {
      const count = Math.min(COUNT_MAX, n("count"));
      const step = n("span") >= 360 - 1e-6 ? 360 / count : n("span") / Math.max(1, count - 1);
      const holes = Array.from({ length: count }, (_, index) => polar(diameter / 2, n("angle") + index * step));
      return {
        box: around([[x - diameter / 2, y - diameter / 2], [x + diameter / 2, y + diameter / 2], [0, 0]], tool / 2),
        shapes: (
          <>
            <Disc at={at} diameter={diameter} kind="way" />
            {holes.map((hole, index) => (
              <Disc key={index} at={hole} diameter={tool} kind={index ? "pocket" : "pocket first"} />
            ))}
          </>
        ),
        measures: [across(at, diameter, `⌀ ${mm(diameter)}`)],
      };
    }
    case "hole_rows": {
      const [columns, rows] = [Math.min(COUNT_MAX, n("columns")), n("rows")];
      const turn = (n("angle") * Math.PI) / 180;
      const hole = (column: number, row: number): Point => {
        const [u, v] = [column * n("column_spacing"), row * n("row_spacing")];
        return [x + u * Math.cos(turn) - v * Math.sin(turn), y + u * Math.sin(turn) + v * Math.cos(turn)];
      };
      const holes = Array.from({ length: Math.min(COUNT_MAX, columns * rows) }, (_, index) => hole(index % columns, Math.floor(index / columns)));
      const up = n("row_spacing") < 0 ? 0.1 : -0.1;
      const aside = n("column_spacing") < 0 ? -0.1 : 0.1;
      return {
        box: around([...holes, at, [0, 0]], tool / 2),
        shapes: holes.map((one, index) => <Disc key={index} at={one} diameter={tool} kind={index ? "pocket" : "pocket first"} />),
        measures: [
          ...(columns > 1 ? [{ from: at, to: hole(1, 0), text: mm(Math.abs(n("column_spacing"))), off: up }] : []),
          ...(rows > 1 ? [{ from: at, to: hole(0, 1), text: mm(Math.abs(n("row_spacing"))), off: aside }] : []),
        ],
      };
    }
    case "thread_milling": {
      const inside = numbers.side !== "outside";
      const profile = n("profile_depth") || n("pitch") * (inside ? 0.541266 : 0.613435);
      const root = diameter - 2 * profile;
      const tip: Point = [x + (inside ? (diameter - tool) / 2 : (root + tool) / 2), y];
      const half = Math.max(diameter / 2, tip[0] - x + tool / 2);
      return {
        box: around([[x - diameter / 2, y - diameter / 2], [x + half, y + diameter / 2], [0, 0]]),
        shapes: (
          <>
            <Disc at={at} diameter={diameter} kind={inside ? "pocket" : "part"} />
            <Disc at={at} diameter={root} kind={inside ? "pocket" : "part"} />
            <Disc at={tip} diameter={tool} kind="tool" />
          </>
        ),
        measures: [across(at, diameter, `⌀ ${mm(diameter)} x ${mm(n("pitch"))}`)],
      };
    }
    case "engraving":
      return engraving(at, n, numbers);
    default:
      return null;
  }
}

/** A capital of the screen is that much lower than its type is said to be. */
const CAPITAL = 0.72;
/** Width of a letter with its space, in heights, about. */
const LETTER = 0.8;

function engraving([x, y]: Point, n: (name: string) => number, numbers: Numbers): Drawing {
  const text = String(numbers.text ?? "");
  const [height, radius, angle] = [n("height"), n("radius"), n("angle")];
  const share = { left: 0, middle: 0.5, right: 1 }[String(numbers.align)] ?? 0;
  const anchor = ["start", "middle", "end"][2 * share];
  const style = { fontSize: `${height / CAPITAL}px` };
  if (numbers.layout === "line") {
    const length = text.length * height * LETTER;
    const turn = (angle * Math.PI) / 180;
    const on = (u: number, v: number): Point => [x + u * Math.cos(turn) - v * Math.sin(turn), y + u * Math.sin(turn) + v * Math.cos(turn)];
    const [from, to] = [-share * length, (1 - share) * length];
    return {
      box: around([on(from, 0), on(to, 0), on(from, height), on(to, height), [0, 0]]),
      shapes: (
        <text class="letters" style={style} text-anchor={anchor} transform={`translate(${x} ${-y}) rotate(${-angle})`}>
          {text}
        </text>
      ),
      measures: [{ from: on(from, 0), to: on(from, height), text: mm(height), off: 0.04 }],
    };
  }
  const outwards = numbers.layout === "arc_outwards";
  // Begins opposite the text, so that the place of the text is half way.
  const at = (degrees: number) => `${x + radius * Math.cos((degrees * Math.PI) / 180)} ${-y - radius * Math.sin((degrees * Math.PI) / 180)}`;
  const turn = outwards ? 1 : 0;
  const half = `A${radius} ${radius} 0 0 ${turn}`;
  const reach = radius + (outwards ? height : 0);
  return {
    box: around([[x - reach, y - reach], [x + reach, y + reach], [0, 0]]),
    shapes: (
      <>
        <path id="job-base" class="way" d={`M${at(angle + 180)}${half} ${at(angle)}${half} ${at(angle + 180)}`} />
        <text class="letters" style={style} text-anchor={anchor}>
          <textPath href="#job-base" startOffset="50%">
            {text}
          </textPath>
        </text>
      </>
    ),
    measures: [{ from: [x, y], to: [x + radius, y], text: `R ${mm(radius)}`, off: 0 }],
  };
}
