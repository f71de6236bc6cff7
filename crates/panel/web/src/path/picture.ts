/** What a picture of the path shows, whoever draws it. */
import type { PathData } from "./data";
import type { View } from "./view";

export interface Zero {
  name: string;
  place: [number, number, number];
  /** Directions of X, Y, Z. */
  axes: [number, number, number][];
  large: boolean;
}

export interface Frame {
  colours: {
    background: string;
    rapid: string;
    feed: string;
    probe: string;
    /** Slow to fast. */
    ramp: string[];
    box: string;
    grid: string;
    axes: string[];
    tool: string;
    preview: string;
    text: string;
  };
  /** Codes of the slowest and the fastest speed of the done part. */
  span: [number, number];
  /** Travel of the machine; null where nobody says. */
  box: { min: [number, number, number]; max: [number, number, number] } | null;
  zeros: Zero[];
  /** How long the axes of a zero are drawn, mm. */
  unit: number;
  tool: [number, number, number] | null;
  /** Where the tool would be at a time that somebody looks at: never the machine. */
  preview: readonly [number, number, number] | null;
  /** The vertex from which the machine has gone on to where it is. */
  tailFrom: number | null;
}

export interface Picture {
  /** `moving`: the next picture follows at once, and this one may have less in it than there is. */
  draw(view: View, data: PathData, frame: Frame, moving: boolean): void;
  /** Whether what was drawn last is on the screen. */
  ready(): boolean;
  dispose(): void;
}
