// What robots do now: the event stream of a map, kept as the last pose and the trail of each robot.
import { address, get, path } from "../api/client";
import { Stream } from "../api/stream";
import type { Robot } from "../api/types";
import type { Point } from "./geometry";

/** Points of a trail: the newest. */
const TRAIL_POINTS = 600;
/** A step of a trail, m: nearer points are left out. */
const TRAIL_STEP_M = 0.05;
/** Robots are drawn anew at most so often, ms: fifty of them send hundreds of poses a second. */
const DRAWN_EVERY_MS = 100;
/** Robots whose earlier tracks are read when a map is opened. */
const TRACKED_ROBOTS = 50;

export interface LiveRobot {
  name: string;
  is_connected: boolean;
  pose?: { x_m: number; y_m: number; theta_rad: number } | undefined;
  covariance: number[];
  trust: string;
  /** When the pose was true, by this page's clock, ms. */
  posed_ms: number;
  /** When the server last heard from it, by this page's clock, ms; absent if it never has since its start. */
  heard_ms?: number | undefined;
  trail: Point[];
  /** Where odometry alone takes it. */
  odometry: Point[];
  /** Where it truly was, if a simulator tells it. */
  truth: Point[];
  /** Where it may be while it has no pose, the most probable first. */
  hypotheses: Hypothesis[];
}

/** A place where a robot may be. */
export interface Hypothesis {
  probability: number;
  pose: { x_m: number; y_m: number; theta_rad: number };
  covariance: number[];
}

interface AnswerEvent {
  robot: string;
  answer: { hypotheses?: { probability: number; map_from_robot?: { pose?: Hypothesis["pose"]; covariance?: number[] } }[] };
}

interface PoseEvent {
  robot: string;
  pose: { x_m: number; y_m: number; theta_rad: number };
  covariance: number[];
  age_ms: number;
  trust: string;
}

interface SpotEvent {
  robot: string;
  pose: { x_m: number; y_m: number };
}

export type LinkState = "connecting" | "live" | "lost";

/** Follows the robots of a map. `changed` is called when the map itself has changed. Call `close` at the end. */
export class LiveMap {
  robots = $state.raw<ReadonlyMap<string, LiveRobot>>(new Map());
  link = $state<LinkState>("connecting");
  #stream: Stream;
  #heard = new Map<string, LiveRobot>();
  #pending = false;
  #is_closed = false;
  #told_ms = 0;
  #timer: ReturnType<typeof setTimeout> | undefined;

  constructor(map: string, changed: () => void) {
    this.#stream = new Stream(address(path`/maps/${map}/live`), {
      on: {
        pose: (event) => this.#pose(JSON.parse(event.data) as PoseEvent),
        odometry: (event) => this.#spot(JSON.parse(event.data) as SpotEvent, "odometry"),
        truth: (event) => this.#spot(JSON.parse(event.data) as SpotEvent, "truth"),
        answer: (event) => this.#answer(JSON.parse(event.data) as AnswerEvent),
        presence: (event) => {
          const { robot, alive } = JSON.parse(event.data) as { robot: string; alive: boolean };
          this.#of(robot).is_connected = alive;
          this.#tell();
        },
        map_changed: changed,
      },
      onopen: (again) => {
        this.link = "live";
        void this.#readRobots(map);
        if (again) changed();
      },
      onlost: () => (this.link = "lost"),
    });
  }

  close(): void {
    this.#is_closed = true;
    clearTimeout(this.#timer);
    this.#stream.close();
  }

  async #readRobots(map: string): Promise<void> {
    const { items } = await get("/robots", { limit: 500 }).catch(() => ({ items: [] as Robot[] }));
    const here = items.filter((robot) => robot.map === map);
    for (const { name, alive, pose, activity } of here) {
      const robot = this.#of(name);
      robot.is_connected = alive;
      if (activity?.last_message_ms != null) this.#hear(robot, activity.last_message_ms);
      if (pose && !robot.pose) this.#pose({ robot: name, pose, covariance: pose.covariance, age_ms: pose.age_ms, trust: pose.trust });
    }
    this.#tell();
    // One after the other: a browser has six connections to a server, and the map itself is to come first.
    for (const { name } of here.slice(0, TRACKED_ROBOTS)) {
      if (this.#is_closed) return;
      await this.#readTracks(name);
    }
  }

  /** Puts what was driven before the page was opened in front of what was heard since. */
  async #readTracks(name: string): Promise<void> {
    const before = await get(path("/robots/{robot}/trajectories", { robot: name })).catch(() => undefined);
    if (!before) return;
    const robot = this.#of(name);
    for (const track of ["odometry", "truth"] as const) {
      const since = robot[track].map(([x_m, y_m]) => ({ x_m, y_m }));
      robot[track] = [];
      for (const pose of [...before[track], ...since]) extend(robot[track], pose);
    }
    this.#tell();
  }

  #of(name: string): LiveRobot {
    let robot = this.#heard.get(name);
    if (!robot) {
      robot = { name, is_connected: true, covariance: [], trust: "unspecified", posed_ms: 0, trail: [], odometry: [], truth: [], hypotheses: [] };
      this.#heard.set(name, robot);
    }
    return robot;
  }

  /** A message of a robot has come, or came so long ago, ms. */
  #hear(robot: LiveRobot, ago_ms = 0): void {
    robot.heard_ms = Math.max(robot.heard_ms ?? -Infinity, performance.now() - ago_ms);
  }

  /** Keeps the places where a robot without a pose may be. */
  #answer({ robot: name, answer }: AnswerEvent): void {
    const robot = this.#of(name);
    this.#hear(robot);
    const told = answer.hypotheses ?? [];
    if (!told.length && !robot.hypotheses.length) return;
    robot.hypotheses = told.flatMap(({ probability, map_from_robot }) =>
      map_from_robot?.pose ? [{ probability, pose: map_from_robot.pose, covariance: map_from_robot.covariance ?? [] }] : [],
    );
    this.#tell();
  }

  #pose({ robot: name, pose, covariance, age_ms, trust }: PoseEvent): void {
    const robot = this.#of(name);
    robot.is_connected = true;
    this.#hear(robot, age_ms);
    Object.assign(robot, { pose, covariance, trust, posed_ms: performance.now() - age_ms, hypotheses: [] });
    extend(robot.trail, pose);
    this.#tell();
  }

  #spot({ robot, pose }: SpotEvent, track: "odometry" | "truth"): void {
    this.#hear(this.#of(robot));
    if (extend(this.#of(robot)[track], pose)) this.#tell();
  }

  /** Tells readers of all that came meanwhile, at most once in `DRAWN_EVERY_MS`, just before the browser draws. */
  #tell(): void {
    if (this.#pending) return;
    this.#pending = true;
    const tell = () => {
      [this.#pending, this.#told_ms] = [false, performance.now()];
      this.robots = new Map([...this.#heard].map(([name, robot]) => [name, { ...robot }]));
    };
    const wait_ms = Math.max(0, this.#told_ms + DRAWN_EVERY_MS - performance.now());
    this.#timer = setTimeout(() => requestAnimationFrame(tell), wait_ms);
  }
}

/** Adds a point to a trail if it is a step away. Whether it is. */
function extend(trail: Point[], { x_m, y_m }: SpotEvent["pose"]): boolean {
  const last = trail.at(-1);
  if (last && Math.hypot(last[0] - x_m, last[1] - y_m) <= TRAIL_STEP_M) return false;
  trail.push([x_m, y_m]);
  if (trail.length > TRAIL_POINTS) trail.shift();
  return true;
}
