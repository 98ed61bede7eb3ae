// Where a landmark is about to hang: a point, the direction that it faces, its height. Nothing is stored before all three
// are known: a landmark that faces the wrong way gives robots a wrong position.
import type { Landmark, Place } from "../api/types";
import { type Point, onWall } from "./geometry";

/** A landmark that is dropped nearer to a wall hangs on it, m. */
const SNAP_M = 0.6;
/** Length of the arrow whose end turns the landmark, px. */
export const ARM_PX = 70;

type Segments = readonly { a: number[]; b: number[] }[];

export class Placement {
  at = $state.raw<Point>();
  theta_rad = $state<number>();
  z_m = $state<number>();
  /** The wall gave the direction. */
  is_on_wall = $state(false);
  readonly name: string;
  /** Where it was. */
  readonly old: Place | undefined;
  readonly #walls: Segments;
  #is_turning = false;

  constructor({ name, place }: Landmark, walls: Segments) {
    this.name = name;
    this.old = place ?? undefined;
    this.#walls = walls;
    if (!place) return;
    this.at = [place.x_m, place.y_m];
    [this.theta_rad, this.z_m] = [place.theta_rad, place.z_m];
  }

  /** A click on the floor: where it hangs, or, where no wall says it, where it looks. */
  click(to: Point): void {
    if (this.at && this.theta_rad === undefined) this.#turn(to);
    else this.#put(to);
  }

  /** A drag: of the end of the arrow, which turns it; of anything else, which moves it. `arm_m` is the arrow's length. */
  drag(from: Point, to: Point, is_done: boolean, arm_m: number, is_first: boolean): void {
    if (is_first) this.#is_turning = this.at !== undefined && this.#isNearHandle(from, arm_m);
    if (this.#is_turning) this.#turn(to);
    else if (is_done) this.#put(to);
    else this.at = to;
  }

  /** The end of the arrow, which turns it. */
  handle(arm_m: number): Point | undefined {
    if (!this.at || this.theta_rad === undefined) return undefined;
    return [this.at[0] + arm_m * Math.cos(this.theta_rad), this.at[1] + arm_m * Math.sin(this.theta_rad)];
  }

  /** The place, once all of it is known. */
  get place(): Place | undefined {
    const { at, theta_rad, z_m } = this;
    if (!at || theta_rad === undefined || typeof z_m !== "number" || !Number.isFinite(z_m)) return undefined;
    return { roll_rad: 0, tilt_rad: 0, ...this.old, x_m: at[0], y_m: at[1], z_m, theta_rad };
  }

  #isNearHandle(from: Point, arm_m: number): boolean {
    const handle = this.handle(arm_m);
    return handle !== undefined && Math.hypot(from[0] - handle[0], from[1] - handle[1]) < arm_m / 2;
  }

  #put(to: Point): void {
    const wall = onWall(to, this.#walls, SNAP_M);
    this.is_on_wall = wall !== undefined;
    this.at = wall ? [wall.x_m, wall.y_m] : to;
    if (wall) this.theta_rad = wall.theta_rad;
  }

  #turn(to: Point): void {
    if (!this.at) return;
    this.theta_rad = Math.atan2(to[1] - this.at[1], to[0] - this.at[0]);
  }
}
