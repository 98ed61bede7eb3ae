import { expect, test } from "vitest";
import { boundsOf, ellipse, onWall, ring, thinned, yawHalf } from "../../src/map/geometry";

test("the ellipse has the axes of the covariance", () => {
  const { a, b, turn } = ellipse([4, 0, 0, 0, 1, 0, 0, 0, 0.01]);
  expect(a / b).toBeCloseTo(2);
  expect(a).toBeCloseTo(2 * Math.sqrt(5.991));
  expect(turn).toBeCloseTo(0);
  const turned = ellipse([2.5, 1.5, 0, 1.5, 2.5, 0, 0, 0, 0]);
  expect(turned.turn).toBeCloseTo(Math.PI / 4);
  expect(turned.a / turned.b).toBeCloseTo(2);
  expect(yawHalf([0, 0, 0, 0, 0, 0, 0, 0, 0.01])).toBeCloseTo(0.196);
});

test("a ring is closed and as far from its centre as its axes", () => {
  const points = ring([1, 2], { a: 3, b: 1, turn: 0 });
  const [west, south, east, north] = boundsOf(points) ?? [0, 0, 0, 0];
  expect([east - west, north - south]).toEqual([expect.closeTo(6, 1), expect.closeTo(2, 1)]);
  expect(points.at(-1)?.[0]).toBeCloseTo(points[0]?.[0] ?? NaN);
});

test("a landmark snaps to the nearest wall and faces the side it is dropped on", () => {
  const walls = [{ a: [0, 0], b: [10, 0] }, { a: [0, 5], b: [10, 5] }];
  const north = onWall([3, 0.2], walls, 0.5);
  expect(north).toEqual({ x_m: 3, y_m: 0, theta_rad: expect.closeTo(Math.PI / 2) as number });
  expect(onWall([3, -0.2], walls, 0.5)?.theta_rad).toBeCloseTo(-Math.PI / 2);
  expect(onWall([3, 2.5], walls, 0.5)).toBeUndefined();
  expect(onWall([12, 0], walls, 0.5)).toBeUndefined();
  expect(onWall([3, 0], [{ a: [1, 1], b: [1, 1] }], 5)).toBeUndefined();
});

test("a driven path is thinned to steps, and keeps both ends", () => {
  const path = Array.from({ length: 11 }, (_, i): [number, number] => [i / 10, 0]);
  expect(thinned(path, 0.3).map(([x]) => x)).toEqual([0, 0.3, 0.6, 0.9, 1]);
  expect(thinned([[1, 1], [1, 1], [1, 1]], 0.3)).toEqual([[1, 1]]);
  expect(thinned([], 0.3)).toEqual([]);
});
