// Straight dark lines of a floor plan along its edges, as walls to be offered. In: grey pixels, row by row from the top.
// Out: lines in pixels of the picture. Oblique and curved walls are not found: a person draws them.

/** A line of the picture: its ends, px from the left and the top. */
export interface PlanLine {
  a: [number, number];
  b: [number, number];
}

/** Darker than this is drawn, of 255. */
const DARK = 128;
/** A gap in a line that is no door, px. */
const GAP_PX = 3;
/** A line is at least so many times longer than it is thick: letters and filled areas are none. */
const SLENDER = 4;
/** Lines found at most, the longest. */
export const MOST_LINES = 2000;

interface Run {
  from: number;
  to: number;
}

/** Runs of dark pixels of at least `shortest`. */
function runs(dark: (i: number) => boolean, length: number, shortest: number): Run[] {
  const found: Run[] = [];
  let begun = -1;
  let last = -1;
  for (let i = 0; i <= length; i++) {
    if (i < length && dark(i)) {
      if (begun < 0) begun = i;
      last = i;
    } else if (begun >= 0 && (i - last > GAP_PX || i === length)) {
      if (last + 1 - begun >= shortest) found.push({ from: begun, to: last + 1 });
      begun = -1;
    }
  }
  return found;
}

/** Bands of neighbouring runs: each becomes its middle line. */
function bands(rows: Run[][], shortest: number): { at: number; from: number; to: number }[] {
  const lines: { at: number; from: number; to: number }[] = [];
  let open: { first: number; last: number; from: number; to: number }[] = [];
  const close = (band: (typeof open)[number]) => {
    const [thick, long] = [band.last + 1 - band.first, band.to - band.from];
    if (long >= shortest && long >= SLENDER * thick) lines.push({ at: (band.first + band.last + 1) / 2, from: band.from, to: band.to });
  };
  [...rows, []].forEach((row, y) => {
    const kept: typeof open = [];
    for (const { from, to } of row) {
      const above = open.find((band) => band.last === y - 1 && Math.min(band.to, to) - Math.max(band.from, from) > 0.7 * Math.max(band.to - band.from, to - from));
      if (above) [above.last, above.from, above.to] = [y, Math.min(above.from, from), Math.max(above.to, to)];
      else kept.push({ first: y, last: y, from, to });
    }
    for (const band of open) if (band.last < y) close(band);
    open = [...open.filter((band) => band.last === y), ...kept];
  });
  return lines;
}

/** `shortest_px`: shorter lines are furniture and letters. */
export function planLines(grey: Uint8Array, width: number, height: number, shortest_px: number): PlanLine[] {
  const rows = Array.from({ length: height }, (_, y) => runs((x) => (grey[y * width + x] ?? 255) < DARK, width, shortest_px));
  const columns = Array.from({ length: width }, (_, x) => runs((y) => (grey[y * width + x] ?? 255) < DARK, height, shortest_px));
  const level = bands(rows, shortest_px).map(({ at, from, to }): PlanLine => ({ a: [from, at], b: [to, at] }));
  const upright = bands(columns, shortest_px).map(({ at, from, to }): PlanLine => ({ a: [at, from], b: [at, to] }));
  const long = ({ a, b }: PlanLine) => Math.hypot(a[0] - b[0], a[1] - b[1]);
  return [...level, ...upright].sort((one, other) => long(other) - long(one)).slice(0, MOST_LINES);
}
