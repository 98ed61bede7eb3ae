// What one robot did since the page was opened, from the live stream of its map.
import { address, path } from "../../api/client";
import { ellipse } from "../../map/geometry";
import { type LiveAnswer, named } from "../../words/quads";

/** A measure over time: seconds since the page was opened, values. */
export type Series = [number[], number[]];

/** Points of a series: the newest. */
const MOST_POINTS = 600;

function extended([times, values]: Series, time: number, value: number): Series {
  return [[...times, time].slice(-MOST_POINTS), [...values, value].slice(-MOST_POINTS)];
}

export class RobotHistory {
  answers = $state.raw(new Map<string, LiveAnswer>());
  sigma = $state.raw<Series>([[], []]);
  latency = $state.raw<Series>([[], []]);
  named = $state.raw<Series>([[], []]);
  #source: EventSource | undefined;
  #map = "";
  readonly #opened = performance.now();

  /** Follows a robot on a map; again with the same map changes nothing. `camera` is called when a new camera is heard. */
  follow(map: string, robot: string, camera: () => void): void {
    if (map === this.#map) return;
    this.close();
    this.#map = map;
    this.#source = new EventSource(address(path`/maps/${map}/live`));
    this.#source.addEventListener("answer", (event) => {
      const heard = JSON.parse(event.data) as { robot: string; camera: string; answer: LiveAnswer };
      if (heard.robot !== robot) return;
      if (!this.answers.has(heard.camera)) camera();
      this.answers = new Map(this.answers).set(heard.camera, heard.answer);
      this.latency = extended(this.latency, this.#now(), heard.answer.latency_ms);
      this.named = extended(this.named, this.#now(), heard.answer.quads.filter((quad) => named(quad)).length);
    });
    this.#source.addEventListener("pose", (event) => {
      const heard = JSON.parse(event.data) as { robot: string; covariance: number[] };
      if (heard.robot === robot) this.sigma = extended(this.sigma, this.#now(), ellipse(heard.covariance).a);
    });
  }

  close(): void {
    this.#source?.close();
  }

  #now(): number {
    return (performance.now() - this.#opened) / 1000;
  }
}
