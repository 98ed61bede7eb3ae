// Shapes on the floor, in metres of the map.
import type { Landmark, Place } from "../api/types";

export type Point = [number, number];
export type Bounds = [number, number, number, number];

/** 95 % of a two-dimensional Gaussian. */
const CHI2_2_95 = 5.991;
/** 95 % of a Gaussian, in standard deviations. */
const SIGMAS_95 = 1.96;
/** Width of a landmark whose size nobody has measured, m. */
const USUAL_WIDTH_M = 0.5;

/** The landmark from above: a line along its width. */
export function footprint(landmark: Landmark): [Point, Point] | undefined {
  const place = landmark.place;
  if (!place) return undefined;
  const half = (landmark.size?.width_m ?? USUAL_WIDTH_M) / 2;
  const [dx, dy] = [-Math.sin(place.theta_rad) * half, Math.cos(place.theta_rad) * half];
  return [
    [place.x_m - dx, place.y_m - dy],
    [place.x_m + dx, place.y_m + dy],
  ];
}

/** Half axes (m) and turn (rad) of the 95 % ellipse of (x, y); `covariance` over (x, y, theta), row-major. */
export function ellipse(covariance: readonly number[]): { a: number; b: number; turn: number } {
  const [xx = 0, xy = 0, , , yy = 0] = covariance;
  const mean = (xx + yy) / 2;
  const root = Math.hypot((xx - yy) / 2, xy);
  const [a, b] = [Math.sqrt((mean + root) * CHI2_2_95), Math.sqrt(Math.max(mean - root, 0) * CHI2_2_95)];
  return { a, b, turn: 0.5 * Math.atan2(2 * xy, xx - yy) };
}

/** Half the angle that holds the heading with 95 %, rad. */
export const yawHalf = (covariance: readonly number[]) => Math.min(Math.PI, SIGMAS_95 * Math.sqrt(Math.max(covariance[8] ?? 0, 0)));

/** Points of an ellipse. */
export function ring(centre: Point, { a, b, turn }: { a: number; b: number; turn: number }, count = 40): Point[] {
  return Array.from({ length: count + 1 }, (_, i) => {
    const angle = (2 * Math.PI * i) / count;
    const [x, y] = [a * Math.cos(angle), b * Math.sin(angle)];
    return [centre[0] + x * Math.cos(turn) - y * Math.sin(turn), centre[1] + x * Math.sin(turn) + y * Math.cos(turn)];
  });
}

/** The smallest box around points; `undefined` for none. */
export function boundsOf(points: Iterable<Point>): Bounds | undefined {
  let box: Bounds | undefined;
  for (const [x, y] of points) {
    box = box ? [Math.min(box[0], x), Math.min(box[1], y), Math.max(box[2], x), Math.max(box[3], y)] : [x, y, x, y];
  }
  return box;
}

/** The point of a segment that is nearest to `at`. */
export function nearestOn(at: Point, [ax, ay]: Point, [bx, by]: Point): Point {
  const [dx, dy] = [bx - ax, by - ay];
  const along = Math.max(0, Math.min(1, ((at[0] - ax) * dx + (at[1] - ay) * dy) / (dx * dx + dy * dy || 1)));
  return [ax + along * dx, ay + along * dy];
}

/** Where two segments meet, each made longer by `slack` at both ends; `undefined` for parallel ones. */
export function crossing([[ax, ay], [bx, by]]: [Point, Point], [[cx, cy], [dx, dy]]: [Point, Point], slack: number): Point | undefined {
  const [ux, uy, vx, vy] = [bx - ax, by - ay, dx - cx, dy - cy];
  const [first, second] = [Math.hypot(ux, uy), Math.hypot(vx, vy)];
  const area = ux * vy - uy * vx;
  if (Math.abs(area) < 1e-9 * first * second) return undefined;
  const along = ((cx - ax) * vy - (cy - ay) * vx) / area;
  const other = ((cx - ax) * uy - (cy - ay) * ux) / area;
  const within = (share: number, length: number) => share * length >= -slack && (share - 1) * length <= slack;
  return within(along, first) && within(other, second) ? [ax + along * ux, ay + along * uy] : undefined;
}

/** Where a landmark lands that is dropped at a point: on the nearest wall within `reach_m`, facing the side it is dropped on. */
export function onWall(at: Point, walls: readonly { a: number[]; b: number[] }[], reach_m: number, facing?: Point): Pick<Place, "x_m" | "y_m" | "theta_rad"> | undefined {
  let best: { distance: number; x: number; y: number; normal: Point } | undefined;
  for (const { a, b } of walls) {
    const [ax = 0, ay = 0] = a;
    const [bx = 0, by = 0] = b;
    const [dx, dy] = [bx - ax, by - ay];
    const length = Math.hypot(dx, dy);
    if (length === 0) continue;
    const [x, y] = nearestOn(at, [ax, ay], [bx, by]);
    const distance = Math.hypot(at[0] - x, at[1] - y);
    if (distance <= reach_m && (!best || distance < best.distance)) best = { distance, x, y, normal: [-dy / length, dx / length] };
  }
  if (!best) return undefined;
  const from = facing ?? at;
  const side = Math.sign((from[0] - best.x) * best.normal[0] + (from[1] - best.y) * best.normal[1]) || 1;
  return { x_m: best.x, y_m: best.y, theta_rad: Math.atan2(side * best.normal[1], side * best.normal[0]) };
}

/** The points of a path that are at least a step apart, with the last one. */
export function thinned(points: readonly Point[], step_m: number): Point[] {
  const kept: Point[] = [];
  points.forEach((at, i) => {
    const last = kept.at(-1);
    const far = !last || Math.hypot(at[0] - last[0], at[1] - last[1]) >= step_m;
    if (far || (i === points.length - 1 && (at[0] !== last[0] || at[1] !== last[1]))) kept.push(at);
  });
  return kept;
}
