/** Lines over time, with two cursors: uPlot draws. */
import { useEffect, useRef } from "preact/hooks";
import uPlot from "uplot";
import type { Rows } from "./scope";
import type { Channel } from "./types";

/** Lines of channels, in the order of colours of the style sheet. */
export const COLOURS = 8;

const colour = (name: string) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

export interface Cursors {
  a: number | null;
  b: number | null;
}

/** Each row twice: once with the least, once with the greatest value, so that a peak is a line from one to the other. */
function lines(rows: Rows): uPlot.AlignedData {
  const twice = (one: number[], other: number[]) => {
    const all = new Array<number>(2 * one.length);
    for (let at = 0; at < one.length; at++) [all[2 * at], all[2 * at + 1]] = [one[at]!, other[at]!];
    return all;
  };
  return [twice(rows.time, rows.time), ...rows.least.map((least, channel) => twice(least, rows.greatest[channel]!))];
}

/** A scale on which what lies between these values fills one of some lanes, the first of them at the top. */
function lane(least: number, greatest: number, at: number, lanes: number): [number, number] {
  if (!Number.isFinite(least) || !Number.isFinite(greatest)) return [0, 1];
  const height = 1.15 * (greatest - least) || Math.max(1, Math.abs(least));
  const middle = (least + greatest) / 2;
  return [middle - height * (lanes - at - 0.5), middle + height * (at + 0.5)];
}

export function Plot({
  rows,
  channels,
  own,
  cursors,
  onCursor,
  label,
}: {
  rows: Rows;
  channels: Channel[];
  /** Each channel has a scale of its own. */
  own: boolean;
  cursors: Cursors;
  onCursor: (time: number) => void;
  label: string;
}) {
  const place = useRef<HTMLDivElement>(null);
  const plot = useRef<uPlot | null>(null);
  const marks = useRef(cursors);
  marks.current = cursors;
  const names = channels.map(({ name }) => name).join(" ");

  useEffect(() => {
    const element = place.current!;
    const ink = colour("--text");
    const axis = { stroke: ink, grid: { stroke: colour("--line"), width: 1 }, ticks: { stroke: colour("--line"), width: 1 }, font: "13px sans-serif" };
    const lanes = own && channels.length > 1;
    const size = () => ({ width: element.clientWidth, height: Math.max(160, element.clientHeight) });
    const made = new uPlot(
      {
        ...size(),
        legend: { show: false },
        cursor: { y: false, drag: { x: true, y: false } },
        scales: {
          x: { time: false },
          ...(lanes ? Object.fromEntries(channels.map(({ name }, at) => [name, { range: (_: uPlot, least: number, greatest: number) => lane(least, greatest, at, channels.length) }])) : {}),
        },
        axes: [{ ...axis, size: 34 }, { ...axis, size: 64, scale: own ? channels[0]?.name : "y", show: !lanes }],
        series: [
          {},
          ...channels.map(({ name, type }, at) => ({
            label: name,
            scale: own ? name : "y",
            stroke: colour(`--signal-${at % COLOURS}`),
            width: type === "bit" ? 2 : 1.5,
            points: { show: false },
          })),
        ],
        hooks: {
          draw: [
            (drawn) => {
              const { ctx, bbox } = drawn;
              for (const [name, time] of Object.entries(marks.current)) {
                if (time === null) continue;
                const x = drawn.valToPos(time, "x", true);
                if (!(x >= bbox.left && x <= bbox.left + bbox.width)) continue;
                ctx.save();
                ctx.strokeStyle = ctx.fillStyle = ink;
                ctx.lineWidth = devicePixelRatio;
                ctx.setLineDash([4 * devicePixelRatio, 3 * devicePixelRatio]);
                ctx.beginPath();
                ctx.moveTo(x, bbox.top);
                ctx.lineTo(x, bbox.top + bbox.height);
                ctx.stroke();
                ctx.font = `${13 * devicePixelRatio}px sans-serif`;
                ctx.fillText(name.toUpperCase(), x + 4 * devicePixelRatio, bbox.top + 14 * devicePixelRatio);
                ctx.restore();
              }
            },
          ],
        },
      },
      lines(rows),
      element,
    );
    plot.current = made;
    const watch = new ResizeObserver(() => made.setSize(size()));
    watch.observe(element);
    const clicked = (event: MouseEvent) => {
      const { left } = made.over.getBoundingClientRect();
      onCursor(made.posToVal(event.clientX - left, "x"));
    };
    made.over.addEventListener("click", clicked);
    return () => {
      watch.disconnect();
      made.destroy();
    };
  }, [names, own, document.documentElement.dataset.theme]);

  useEffect(() => plot.current?.setData(lines(rows)));
  return <div ref={place} class="plot" role="img" aria-label={label} />;
}
