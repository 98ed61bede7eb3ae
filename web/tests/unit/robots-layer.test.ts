// What is drawn of a robot on the canvas: geometry and colours of its features.
import type LineString from "ol/geom/LineString";
import type Polygon from "ol/geom/Polygon";
import type { Style } from "ol/style";
import { expect, test } from "vitest";
import type { Colours } from "../../src/map/colours";
import type { LiveRobot } from "../../src/map/live.svelte";
import { CONE_M, drawn } from "../../src/map/robots-layer";

const COLOURS = { text: "#111111", halo: "#ffffff", robot: "#00aa00", stale: "#888888", accent: "#0000ff" } as Colours;
const NOW_MS = 100_000;
/** 0.20 m along 30 degrees, 0.05 m across it, 0.1 rad. */
const [ALONG_M, ACROSS_M, TURN_RAD, YAW_RAD] = [0.2, 0.05, Math.PI / 6, 0.1];
/** 95 % of a Gaussian over two dimensions and over one, in standard deviations. */
const [SIGMAS_2D, SIGMAS_1D] = [Math.sqrt(-2 * Math.log(0.05)), 1.959964];

function covariance(): number[] {
  const [c, s] = [Math.cos(TURN_RAD), Math.sin(TURN_RAD)];
  const [a, b] = [ALONG_M ** 2, ACROSS_M ** 2];
  const [xx, xy, yy] = [c * c * a + s * s * b, c * s * (a - b), s * s * a + c * c * b];
  return [xx, xy, 0, xy, yy, 0, 0, 0, YAW_RAD ** 2];
}

const robot = (fields: Partial<LiveRobot> = {}): LiveRobot => ({
  name: "r1", is_connected: true, pose: { x_m: 3, y_m: -2, theta_rad: 0.7 }, covariance: covariance(), trust: "supported",
  posed_ms: NOW_MS - 100, trail: [[2, -2], [3, -2]], odometry: [], truth: [], hypotheses: [], ...fields,
});

const features = (fields?: Partial<LiveRobot>) => drawn(robot(fields), NOW_MS, COLOURS);
const shapes = (fields?: Partial<LiveRobot>) => features(fields).map((one) => one.getGeometry()?.getType());
/** The points of the ellipse and of the cone. */
const polygons = () => features().flatMap((one) => (one.getGeometry()?.getType() === "Polygon" ? [(one.getGeometry() as Polygon).getCoordinates()[0] ?? []] : []));
const styles = (fields?: Partial<LiveRobot>) => features(fields).map((one) => one.getStyle() as Style);
const labels = (fields?: Partial<LiveRobot>) => styles(fields).flatMap((style) => style.getText()?.getText() ?? []);

test("a robot has a trail, an ellipse, a cone and itself", () => {
  expect(shapes()).toEqual(["LineString", "Polygon", "Polygon", "Point"]);
  expect((features()[0]?.getGeometry() as LineString).getCoordinates()).toEqual([[2, -2], [3, -2]]);
  expect(features()[3]?.get("robot")).toBe("r1");
});

test("the ellipse holds 95 %: its axes are those of the covariance", () => {
  const reach = (polygons()[0] ?? []).map(([x = 0, y = 0]) => ({ length: Math.hypot(x - 3, y + 2), angle: Math.atan2(y + 2, x - 3) }));
  const [far, near] = [reach.reduce((a, b) => (b.length > a.length ? b : a)), reach.reduce((a, b) => (b.length < a.length ? b : a))];
  expect(far.length).toBeCloseTo(SIGMAS_2D * ALONG_M, 3);
  expect(near.length).toBeCloseTo(SIGMAS_2D * ACROSS_M, 3);
  expect(Math.abs(Math.sin(far.angle - TURN_RAD))).toBeLessThan(1e-6);
  // Each point of the edge is as far from the middle by the covariance.
  const [xx = 0, xy = 0, , , yy = 0] = covariance();
  for (const [x = 0, y = 0] of polygons()[0] ?? []) {
    const [dx, dy] = [x - 3, y + 2];
    expect((dx * dx * yy - 2 * dx * dy * xy + dy * dy * xx) / (xx * yy - xy * xy)).toBeCloseTo(SIGMAS_2D ** 2, 2);
  }
});

test("the cone begins at the robot, and holds 95 % of its heading", () => {
  const cone = polygons()[1] ?? [];
  expect(cone[0]).toEqual([3, -2]);
  expect(cone.at(-1)).toEqual([3, -2]);
  const edge = cone.slice(1, -1).map(([x = 0, y = 0]) => ({ length: Math.hypot(x - 3, y + 2), angle: Math.atan2(y + 2, x - 3) }));
  for (const { length } of edge) expect(length).toBeCloseTo(CONE_M, 9);
  expect(0.7 - (edge[0]?.angle ?? NaN)).toBeCloseTo(SIGMAS_1D * YAW_RAD, 4);
  expect((edge.at(-1)?.angle ?? NaN) - 0.7).toBeCloseTo(SIGMAS_1D * YAW_RAD, 4);
});

test("a robot without a fresh pose is grey all over, and says how old its pose is", () => {
  const colours = (fields?: Partial<LiveRobot>) => {
    const [trail, ellipse, cone] = styles(fields);
    return [trail?.getStroke()?.getColor(), ellipse?.getStroke()?.getColor(), cone?.getFill()?.getColor()].map((colour) => String(colour).slice(0, 7));
  };
  expect(colours()).toEqual([COLOURS.robot, COLOURS.robot, COLOURS.robot]);
  expect(labels()).toEqual(["r1"]);
  for (const old of [{ posed_ms: NOW_MS - 12_000 }, { posed_ms: NOW_MS - 12_000, is_connected: false }]) {
    expect(colours(old)).toEqual([COLOURS.stale, COLOURS.stale, COLOURS.stale]);
    expect(labels(old)).toEqual(["r1 (12 s ago)"]);
  }
  expect(colours({ is_connected: false })).toEqual([COLOURS.stale, COLOURS.stale, COLOURS.stale]);
});

test("a robot without a pose is where it may be, each place with its share", () => {
  const place = { x_m: 1, y_m: 1, theta_rad: 0 };
  const hypotheses = [{ probability: 0.7, pose: place, covariance: covariance() }, { probability: 0.3, pose: place, covariance: covariance() }];
  expect(shapes({ pose: undefined, hypotheses })).toEqual(["Polygon", "Polygon"]);
  expect(labels({ pose: undefined, hypotheses })).toEqual(["r1? 70 %", "r1? 30 %"]);
  expect(shapes({ pose: undefined })).toEqual([]);
});

test("a pose whose covariance is not known has no ellipse and no cone", () => {
  expect(shapes({ covariance: [] })).toEqual(["LineString", "Point"]);
});
