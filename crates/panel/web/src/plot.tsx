/** Lines over time, with two cursors: uPlot draws. */
import { useEffect, useRef } from "preact/hooks";
import uPlot from "uplot";
import { type Scale, bitScale, digitsOf, divisionsOf, heightOf, scaleFor } from "./divisions";
import { fixed } from "./i18n";
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

export function Plot({
  rows,
  channels,
  own,
  cursors,
  onCursor,
  onSteps,
  label,
}: {
  rows: Rows;
  channels: Channel[];
  /** Each channel has a scale of its own. */
  own: boolean;
  cursors: Cursors;
  onCursor: (time: number) => void;
  /** What a division is, by the name of the channel; told when it changes. */
  onSteps: (steps: Record<string, number>) => void;
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
    const count = lanes ? channels.length : 1;
    const divisions = divisionsOf(count);
    const scales: Record<string, Scale> = {};
    let told = "";
    const ranged = (name: string, isBit: boolean, at: number) => (_: uPlot, least: number, greatest: number) => {
      const scale = isBit ? bitScale(divisions) : scaleFor(least, greatest, divisions, !lanes);
      scales[name] = scale;
      return heightOf(scale, at, count);
    };
    const tell = () => {
      const steps = Object.fromEntries(channels.map(({ name }) => [name, (own ? scales[name] : scales.y)?.step ?? 0]));
      const now = JSON.stringify(steps);
      if (now === told) return;
      told = now;
      onSteps(steps);
    };
    const edges = (drawn: uPlot) => {
      const { ctx, bbox } = drawn;
      ctx.save();
      ctx.strokeStyle = colour("--line");
      for (let k = 1; k < divisions * count; k++) {
        const y = Math.round(bbox.top + (bbox.height * k) / (divisions * count)) + 0.5;
        ctx.lineWidth = (k % divisions === 0 ? 2 : 1) * devicePixelRatio;
        ctx.beginPath();
        ctx.moveTo(bbox.left, y);
        ctx.lineTo(bbox.left + bbox.width, y);
        ctx.stroke();
      }
      ctx.restore();
    };
    const single = own ? channels[0]?.name ?? "y" : "y";
    const ticks = () => {
      const { from, step, divisions } = scales[single] ?? { from: 0, step: 1, divisions: 8 };
      return Array.from({ length: divisions + 1 }, (_, k) => from + k * step);
    };
    const size = () => ({ width: element.clientWidth, height: Math.max(160, element.clientHeight) });
    const made = new uPlot(
      {
        ...size(),
        legend: { show: false },
        cursor: { y: false, drag: { x: true, y: false } },
        scales: {
          x: { time: false },
          ...(own ? Object.fromEntries(channels.map(({ name, type }, at) => [name, { range: ranged(name, lanes && type === "bit", lanes ? at : 0) }])) : { y: { range: ranged("y", false, 0) } }),
        },
        axes: [
          { ...axis, size: 34, label: "s", labelSize: 14, labelGap: -4, labelFont: axis.font },
          { ...axis, size: 64, scale: single, show: !lanes, grid: { show: false }, splits: ticks, values: (_, all) => all.map((value) => fixed(value, digitsOf(scales[single]?.step ?? 1))) },
        ],
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
          drawClear: [edges],
          draw: [
            tell,
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
