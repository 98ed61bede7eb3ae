// Dark lines of a floor plan. In: grey pixels, row by row from the top. Out: straight lines along the edges of the picture, as
// walls to be offered, and the line under one point, oblique ones too, in pixels of the picture.

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

/** A patch of ink is a line if it is so many times longer than it is wide. */
const LONG = 3;

/**
 * The point nearest to `at` of the middle of the dark line there; `undefined` if there is none, or no single one. It is the main
 * axis of the dark pixels within `reach_px`.
 */
export function lineAt(grey: Uint8Array, width: number, height: number, at: [number, number], reach_px: number): [number, number] | undefined {
  const reach = Math.max(reach_px, 2);
  let [n, su, sv, suu, suv, svv] = [0, 0, 0, 0, 0, 0];
  for (let y = Math.max(0, Math.floor(at[1] - reach)); y < Math.min(height, at[1] + reach); y++) {
    for (let x = Math.max(0, Math.floor(at[0] - reach)); x < Math.min(width, at[0] + reach); x++) {
      const [u, v] = [x + 0.5 - at[0], y + 0.5 - at[1]];
      if ((grey[y * width + x] ?? 255) >= DARK || u * u + v * v > reach * reach) continue;
      [n, su, sv, suu, suv, svv] = [n + 1, su + u, sv + v, suu + u * u, suv + u * v, svv + v * v];
    }
  }
  if (n < reach) return undefined;
  const [mu, mv] = [su / n, sv / n];
  const [uu, uv, vv] = [suu / n - mu * mu, suv / n - mu * mv, svv / n - mv * mv];
  const root = Math.hypot((uu - vv) / 2, uv);
  if ((uu + vv) / 2 + root < LONG * LONG * ((uu + vv) / 2 - root)) return undefined;
  const angle = 0.5 * Math.atan2(2 * uv, uu - vv);
  const [du, dv] = [Math.cos(angle), Math.sin(angle)];
  const off = mu * dv - mv * du;
  return [at[0] + off * dv, at[1] - off * du];
}
