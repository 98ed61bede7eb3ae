// What a floor plan draws, in metres of the map: its lines, their corners, and the line under a point.
import { type Point, crossing } from "./geometry";
import { type PlanLine, lineAt, planLines } from "./plan-walls";
import type { Plan } from "./underlay-layer";

/** Shorter dark lines of a plan are taken for furniture, m. */
const WALL_M = 0.8;
/** Lines that corners are made of are at least so long, m. */
const LINE_M = 0.3;
/** Corners of more lines than these are not looked for: a scan is no drawing. */
const MOST_CORNERED = 600;

/** The ends of a line, m. */
export type Line = [Point, Point];

export class PlanInk {
  readonly #grey: Uint8Array;
  readonly #plan: Plan;
  readonly #corners: Point[];

  /** Throws where this browser does not let the picture be read. */
  constructor(plan: Plan) {
    this.#plan = plan;
    this.#grey = greyOf(plan.picture);
    this.#corners = this.#cornersOf(this.lines(LINE_M).slice(0, MOST_CORNERED));
  }

  /** Straight lines along the edges of the picture, as walls to be offered. */
  lines(shortest_m = WALL_M): Line[] {
    const { picture, underlay } = this.#plan;
    return planLines(this.#grey, picture.width, picture.height, shortest_m / underlay.place.metres_per_pixel).map(({ a, b }: PlanLine): Line => [this.#onFloor(a), this.#onFloor(b)]);
  }

  /** The corner nearest to a point, within `reach` m. */
  corner(at: Point, reach: number): Point | undefined {
    let best: Point | undefined;
    let least = reach;
    for (const corner of this.#corners) {
      const off = Math.hypot(corner[0] - at[0], corner[1] - at[1]);
      if (off <= least) [best, least] = [corner, off];
    }
    return best;
  }

  /** The point of a drawn line, straight or oblique, that is nearest to `at`; within `reach` m. */
  line(at: Point, reach: number): Point | undefined {
    const { picture, underlay } = this.#plan;
    const on = lineAt(this.#grey, picture.width, picture.height, this.#onPicture(at), reach / underlay.place.metres_per_pixel);
    return on && this.#onFloor(on);
  }

  /** Where two lines meet, or would if each were a little longer: half of its thickness. */
  #cornersOf(lines: Line[]): Point[] {
    const slack_m = 4 * this.#plan.underlay.place.metres_per_pixel;
    const corners: Point[] = [];
    lines.forEach((one, i) => {
      for (const other of lines.slice(i + 1)) {
        const at = crossing(one, other, slack_m);
        if (at) corners.push(at);
      }
    });
    return corners;
  }

  #onFloor([u, v]: [number, number]): Point {
    const { picture, underlay: { place } } = this.#plan;
    const [cos, sin] = [Math.cos(place.theta_rad), Math.sin(place.theta_rad)];
    const [x, y] = [u * place.metres_per_pixel, (picture.height - v) * place.metres_per_pixel];
    return [place.x_m + cos * x - sin * y, place.y_m + sin * x + cos * y];
  }

  #onPicture([x, y]: Point): [number, number] {
    const { picture, underlay: { place } } = this.#plan;
    const [cos, sin] = [Math.cos(place.theta_rad), Math.sin(place.theta_rad)];
    const [dx, dy] = [x - place.x_m, y - place.y_m];
    return [(cos * dx + sin * dy) / place.metres_per_pixel, picture.height - (cos * dy - sin * dx) / place.metres_per_pixel];
  }
}

/** Grey of each pixel, row by row from the top; white where the picture is transparent. */
function greyOf(picture: ImageBitmap): Uint8Array {
  const canvas = new OffscreenCanvas(picture.width, picture.height);
  const pen = canvas.getContext("2d");
  if (!pen) throw new Error("This browser cannot read the picture.");
  pen.fillStyle = "#fff";
  pen.fillRect(0, 0, picture.width, picture.height);
  pen.drawImage(picture, 0, 0);
  const { data } = pen.getImageData(0, 0, picture.width, picture.height);
  const grey = new Uint8Array(picture.width * picture.height);
  for (let i = 0; i < grey.length; i++) grey[i] = Math.round(((data[4 * i] ?? 0) + (data[4 * i + 1] ?? 0) + (data[4 * i + 2] ?? 0)) / 3);
  return grey;
}
