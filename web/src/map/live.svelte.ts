// What robots do now: the event stream of a map, kept as the last pose and the trail of each robot.
import { address, get, path } from "../api/client";
import type { Robot } from "../api/types";
import type { Point } from "./geometry";

/** Points of a trail: the newest. */
const TRAIL_POINTS = 600;
/** A step of a trail, m: nearer points are left out. */
const TRAIL_STEP_M = 0.05;
/** A pose that is older is no pose, ms. */
export const STALE_MS = 2000;

export interface LiveRobot {
  name: string;
  is_connected: boolean;
  pose?: { x_m: number; y_m: number; theta_rad: number } | undefined;
  covariance: number[];
  trust: string;
  /** When the pose was true, by this page's clock, ms. */
  posed_ms: number;
  trail: Point[];
}

interface PoseEvent {
  robot: string;
  pose: { x_m: number; y_m: number; theta_rad: number };
  covariance: number[];
  age_ms: number;
  trust: string;
}

export type LinkState = "connecting" | "live" | "lost";

/** Follows the robots of a map. `changed` is called when the map itself has changed. Call `close` at the end. */
export class LiveMap {
  robots = $state.raw<ReadonlyMap<string, LiveRobot>>(new Map());
  link = $state<LinkState>("connecting");
  #source: EventSource;
  #heard = new Map<string, LiveRobot>();
  #pending = false;

  constructor(map: string, changed: () => void) {
    this.#source = new EventSource(address(path`/maps/${map}/live`));
    this.#source.onopen = () => {
      this.link = "live";
      this.#readRobots(map);
    };
    this.#source.onerror = () => (this.link = "lost");
    this.#source.addEventListener("pose", (event) => this.#pose(JSON.parse(event.data) as PoseEvent));
    this.#source.addEventListener("presence", (event) => {
      const { robot, alive } = JSON.parse(event.data) as { robot: string; alive: boolean };
      this.#of(robot).is_connected = alive;
      this.#tell();
    });
    this.#source.addEventListener("map_changed", changed);
  }

  close(): void {
    this.#source.close();
  }

  async #readRobots(map: string): Promise<void> {
    const { items } = await get<{ items: Robot[] }>("/robots", { limit: 500 }).catch(() => ({ items: [] as Robot[] }));
    for (const { name, alive, pose } of items.filter((robot) => robot.map === map)) {
      const robot = this.#of(name);
      robot.is_connected = alive;
      if (pose && !robot.pose) this.#pose({ robot: name, pose, covariance: pose.covariance, age_ms: pose.age_ms, trust: pose.trust });
    }
    this.#tell();
  }

  #of(name: string): LiveRobot {
    let robot = this.#heard.get(name);
    if (!robot) {
      robot = { name, is_connected: true, covariance: [], trust: "unspecified", posed_ms: 0, trail: [] };
      this.#heard.set(name, robot);
    }
    return robot;
  }

  #pose({ robot: name, pose, covariance, age_ms, trust }: PoseEvent): void {
    const robot = this.#of(name);
    robot.is_connected = true;
    Object.assign(robot, { pose, covariance, trust, posed_ms: performance.now() - age_ms });
    const last = robot.trail.at(-1);
    if (!last || Math.hypot(last[0] - pose.x_m, last[1] - pose.y_m) > TRAIL_STEP_M) {
      robot.trail.push([pose.x_m, pose.y_m]);
      if (robot.trail.length > TRAIL_POINTS) robot.trail.shift();
    }
    this.#tell();
  }

  /** Tells readers at most once for each picture that the browser draws. */
  #tell(): void {
    if (this.#pending) return;
    this.#pending = true;
    requestAnimationFrame(() => {
      this.#pending = false;
      this.robots = new Map([...this.#heard].map(([name, robot]) => [name, { ...robot }]));
    });
  }
}
