import { expect, test } from "vitest";
import type { SiteTopology } from "../../src/api/types";
import { onMap } from "../../src/map/topology-layer";

const place = (map: string, number: number, x_m: number) => ({ place: `${map}/${number}`, map, x_m, y_m: 1, area_m2: 9, landmarks: [] });
const look = { landmark: "poster", along_m: 0, x_m: 1, y_m: 1, theta_rad: Math.PI / 2, pan_rad: -Math.PI / 2, tilt_rad: 0, range_m: 3 };
const topology: SiteTopology = {
  maps: [{ map: "annex", version: 1 }, { map: "hall", version: 2 }],
  places: [place("annex", 1, 9), place("hall", 1, 1), place("hall", 2, 5)],
  passages: [
    { ends: [{ place: "hall/1", x_m: 3, y_m: 1 }, { place: "hall/2", x_m: 3, y_m: 1 }], width_m: 0.9, length_m: 4, landmarks: [] },
    { ends: [{ place: "annex/1", x_m: 8, y_m: 1 }, { place: "hall/2", x_m: 6, y_m: 1 }], width_m: null, length_m: 2, landmarks: [] },
  ],
  route: {
    length_m: 6,
    legs: [
      { place: "hall/1", passage: 0, length_m: 2, path: [[1, 1], [3, 1]], next_landmark: look },
      { place: "annex/1", passage: null, length_m: 1, path: [[8, 1], [9, 1]], next_landmark: look },
    ],
  },
};

test("only what lies on the map is drawn, and a link ends at its middle", () => {
  const { places, ways, route } = onMap(topology, "hall");
  expect(places).toEqual([[1, 1], [5, 1]]);
  expect(ways).toEqual([[[1, 1], [3, 1]], [[5, 1], [3, 1]], [[5, 1], [6, 1]]]);
  expect(route).toEqual([[[1, 1], [3, 1]]]);
});

test("the camera looks along the heading turned by its pan", () => {
  const [[from, to] = []] = onMap(topology, "hall").looks;
  expect(from).toEqual([1, 1]);
  expect(to?.[0]).toBeCloseTo(4);
  expect(to?.[1]).toBeCloseTo(1);
});
