// Walls that are being drawn or changed. What is stored stays until they are saved.
import type { Walls } from "../api/types";
import { type Point, nearestOn } from "./geometry";
import type { PlanInk } from "./plan-ink";

export type Wall = Walls["segments"][number];

/** A point this near to an end, to a wall, or to a line of the plan is on it, px. */
const SNAP_PX = 12;
/** A right angle this near to a line of the plan is along it, px: a drawn line is as thick. */
const SAME_PX = 4;
/** A direction this near to a right angle is one, rad. */
const RIGHT_RAD = (7 * Math.PI) / 180;
/** A wall is at least so long, m. */
const SHORTEST_M = 0.05;
/** Steps that can be taken back. */
const MAX_STEPS = 200;

const distance = ([ax, ay]: Point, [bx, by]: Point) => Math.hypot(ax - bx, ay - by);
const ends = ({ a, b }: Wall): [Point, Point] => [a as Point, b as Point];

export class WallEditor {
  segments = $state.raw<readonly Wall[]>([]);
  /** Where the next wall begins. */
  from = $state.raw<Point>();
  /** Where it would end. */
  hover = $state.raw<Point>();
  mode = $state<"draw" | "choose">("draw");
  chosen = $state<number>();
  /** The revision of the walls that were read. */
  revision: string;
  #steps = $state.raw<(readonly Wall[])[]>([]);
  /** What the plan draws; none without a plan. */
  readonly ink: PlanInk | undefined;
  readonly #stored: readonly Wall[];
  #held: { wall: Wall; moves: "a" | "b" | "both" } | undefined;

  constructor(segments: readonly Wall[], revision: string, ink?: PlanInk) {
    this.segments = this.#stored = segments;
    this.revision = revision;
    this.ink = ink;
  }

  get is_changed(): boolean {
    return this.segments !== this.#stored;
  }

  /** How many walls are new or moved, and how many of the stored ones are not there any more. */
  get difference(): { added: number; removed: number } {
    const [stored, now] = [new Set(this.#stored), new Set(this.segments)];
    return { added: this.segments.filter((wall) => !stored.has(wall)).length, removed: this.#stored.filter((wall) => !now.has(wall)).length };
  }

  get can_undo(): boolean {
    return this.#steps.length > 0;
  }

  undo(): void {
    const before = this.#steps.at(-1);
    if (!before) return;
    this.#steps = this.#steps.slice(0, -1);
    this.segments = before;
    this.from = this.chosen = undefined;
  }

  #set(segments: readonly Wall[]): void {
    this.#steps = [...this.#steps, this.segments].slice(-MAX_STEPS);
    this.segments = segments;
  }

  /** Several walls at once, such as those found in the plan. */
  add(walls: readonly Wall[]): void {
    if (walls.length) this.#set([...this.segments, ...walls]);
  }

  /** Other walls instead of all that are there. */
  replace(walls: readonly Wall[]): void {
    this.#set([...walls]);
    this.from = this.hover = this.chosen = undefined;
  }

  use(mode: "draw" | "choose"): void {
    this.mode = mode;
    this.from = this.hover = this.chosen = undefined;
  }

  /** Ends the line of walls that is being drawn. */
  finish(): void {
    this.from = this.hover = undefined;
  }

  /** A click on the floor; `px_m` is the size of a pixel there, m. */
  click(at: Point, px_m: number): void {
    if (this.mode === "choose") {
      const near = this.#nearest(at, SNAP_PX * px_m);
      this.chosen = near;
      return;
    }
    const to = this.snapped(at, px_m);
    const { from } = this;
    if (from && distance(from, to) >= SHORTEST_M) {
      // A line that comes to a wall that was there is done.
      const is_joined = this.#endNear(to, 1e-9) !== undefined;
      this.#set([...this.segments, { a: [...from], b: [...to] }]);
      this.from = is_joined ? undefined : to;
    } else if (!from) {
      this.from = to;
    }
  }

  /** Where a point lands: on an end, on a corner or a line of the plan, at a right angle to the wall before, on a wall. */
  snapped(at: Point, px_m: number): Point {
    const reach = SNAP_PX * px_m;
    const end = this.#endNear(at, reach) ?? this.ink?.corner(at, reach);
    if (end) return end;
    const right = this.from && this.#square(this.from, at);
    const drawn = this.ink?.line(at, reach);
    if (drawn && !(right && distance(drawn, right) <= SAME_PX * px_m)) return drawn;
    if (right) {
      // Along the right angle, and level with an end if there is one near.
      const level = this.segments.flatMap(ends).find((other) => distance(this.#along(this.from as Point, right, other), right) < reach && distance(this.from as Point, other) > reach);
      return level ? this.#along(this.from as Point, right, level) : right;
    }
    const near = this.#nearest(at, reach);
    const wall = near === undefined ? undefined : this.segments[near];
    return wall ? nearestOn(at, ...ends(wall)) : at;
  }

  /** The point of the line from `from` through `through` that is nearest to `other`. */
  #along(from: Point, through: Point, other: Point): Point {
    const [dx, dy] = [through[0] - from[0], through[1] - from[1]];
    const share = ((other[0] - from[0]) * dx + (other[1] - from[1]) * dy) / (dx * dx + dy * dy || 1);
    return [from[0] + share * dx, from[1] + share * dy];
  }

  /** The point at a right angle to the wall that ends at `from`, or to the axes of the map; `undefined` if none is near. */
  #square(from: Point, at: Point): Point | undefined {
    const length = distance(from, at);
    if (length === 0) return undefined;
    const angle = Math.atan2(at[1] - from[1], at[0] - from[0]);
    const before = this.segments.findLast((wall) => ends(wall).some((end) => distance(end, from) < 1e-9));
    const bases = before ? [Math.atan2((before.b[1] ?? 0) - (before.a[1] ?? 0), (before.b[0] ?? 0) - (before.a[0] ?? 0)), 0] : [0];
    for (const base of bases) {
      const turns = Math.round((angle - base) / (Math.PI / 2));
      const square = base + (turns * Math.PI) / 2;
      const off = angle - square;
      if (Math.abs(off) <= RIGHT_RAD) return [from[0] + length * Math.cos(off) * Math.cos(square), from[1] + length * Math.cos(off) * Math.sin(square)];
    }
    return undefined;
  }

  #endNear(at: Point, reach: number): Point | undefined {
    let best: Point | undefined;
    for (const end of this.segments.flatMap(ends)) if (distance(end, at) <= Math.min(reach, best ? distance(best, at) : Infinity)) best = end;
    return best;
  }

  #nearest(at: Point, reach: number): number | undefined {
    let best: number | undefined;
    let least = reach;
    this.segments.forEach((wall, i) => {
      const off = distance(at, nearestOn(at, ...ends(wall)));
      if (off <= least) [best, least] = [i, off];
    });
    return best;
  }

  remove(): void {
    if (this.chosen === undefined) return;
    this.#set(this.segments.filter((_, i) => i !== this.chosen));
    this.chosen = undefined;
  }

  /** Drags the chosen wall, or the end of it that is near. Its new course was measured by hand. */
  drag(from: Point, to: Point, is_first: boolean, is_done: boolean, px_m: number): void {
    const { chosen } = this;
    const wall = chosen === undefined ? undefined : this.segments[chosen];
    if (chosen === undefined || !wall) return;
    if (is_first || !this.#held) {
      const [a, b] = ends(wall);
      const reach = 2 * SNAP_PX * px_m;
      const moves = distance(from, a) <= Math.min(reach, distance(from, b)) ? "a" : distance(from, b) <= reach ? "b" : "both";
      this.#held = { wall, moves };
      this.#steps = [...this.#steps, this.segments].slice(-MAX_STEPS);
    }
    const { wall: was, moves } = this.#held;
    const [dx, dy] = [to[0] - from[0], to[1] - from[1]];
    const moved = ([x, y]: Point): Point => [x + dx, y + dy];
    const others = new WallEditor(this.segments.filter((_, i) => i !== chosen), "", this.ink);
    others.from = (moves === "a" ? was.b : was.a) as Point;
    const end = (at: Point): Point => [...others.snapped(moved(at), px_m)];
    const now = moves === "both" ? { a: moved(was.a), b: moved(was.b) } : moves === "a" ? { a: end(was.a), b: was.b } : { a: was.a, b: end(was.b) };
    this.segments = this.segments.map((one, i) => (i === chosen ? now : one));
    if (is_done) this.#held = undefined;
  }
}
