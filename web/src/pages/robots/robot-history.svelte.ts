// What one robot did since the page was opened, from the live stream of its map.
import { address, path } from "../../api/client";
import { Stream } from "../../api/stream";
import { ellipse } from "../../map/geometry";
import { type LiveAnswer, named } from "../../words/quads";

/** A measure over time: seconds since the page was opened, values. */
export type Series = [number[], number[]];

interface Spot {
  x_m: number;
  y_m: number;
}

interface AnswerEvent {
  robot: string;
  camera: string;
  answer: LiveAnswer;
}

interface PoseEvent {
  robot: string;
  pose: Spot;
  covariance: number[];
}

/** Points of a series: the newest. */
const MOST_POINTS = 600;

/** With one more point. */
export function extended([times, values]: Series, time: number, value: number): Series {
  return [[...times, time].slice(-MOST_POINTS), [...values, value].slice(-MOST_POINTS)];
}

export class RobotHistory {
  answers = $state.raw(new Map<string, LiveAnswer>());
  sigma = $state.raw<Series>([[], []]);
  latency = $state.raw<Series>([[], []]);
  named = $state.raw<Series>([[], []]);
  /** Of robots whose true place a simulator tells. */
  error = $state.raw<Series>([[], []]);
  #stream: Stream | undefined;
  #map = "";
  #truth: Spot | undefined;
  readonly #opened = performance.now();

  /** Follows a robot on a map; again with the same map changes nothing. `camera` is called when a new camera is heard. */
  follow(map: string, robot: string, camera: () => void): void {
    if (map === this.#map) return;
    this.close();
    this.#map = map;
    this.#stream = new Stream(address(path`/maps/${map}/live`), {
      on: {
        answer: (event) => this.#answer(JSON.parse(event.data) as AnswerEvent, robot, camera),
        pose: (event) => this.#pose(JSON.parse(event.data) as PoseEvent, robot),
        truth: (event) => {
          const heard = JSON.parse(event.data) as { robot: string; pose: Spot };
          if (heard.robot === robot) this.#truth = heard.pose;
        },
      },
    });
  }

  #answer(heard: AnswerEvent, robot: string, camera: () => void): void {
    if (heard.robot !== robot) return;
    if (!this.answers.has(heard.camera)) camera();
    this.answers = new Map(this.answers).set(heard.camera, heard.answer);
    this.latency = extended(this.latency, this.#now(), heard.answer.latency_ms);
    this.named = extended(this.named, this.#now(), heard.answer.quads.filter((quad) => named(quad)).length);
  }

  #pose({ robot: of, pose, covariance }: PoseEvent, robot: string): void {
    if (of !== robot) return;
    this.sigma = extended(this.sigma, this.#now(), ellipse(covariance).a);
    const truth = this.#truth;
    if (truth) this.error = extended(this.error, this.#now(), Math.hypot(pose.x_m - truth.x_m, pose.y_m - truth.y_m));
  }

  close(): void {
    this.#stream?.close();
  }

  #now(): number {
    return (performance.now() - this.#opened) / 1000;
  }
}
