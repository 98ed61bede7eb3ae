import { expect, test } from "vitest";
import { pgmOf, placeOf } from "../../src/pages/maps/ros-grid";

const bytes = (...parts: (string | number[])[]) => new Uint8Array(parts.flatMap((part) => (typeof part === "string" ? [...part].map((c) => c.charCodeAt(0)) : part)));

test("scale and place are read of every form of the list", () => {
  const place = { metres_per_pixel: 0.05, x_m: -10, y_m: 4.5, theta_rad: 0.1 };
  for (const origin of ["[-10.0, 4.5, 0.1]", "[-10.0,\n  4.5, 0.1]  # x, y, yaw", "\n  - -10.0\n  - 4.5\n  - 0.1", "\n- -1e1\n- 4.5\n- 1e-1"])
    expect(placeOf(`image: map.pgm\nmode: trinary\nresolution: 0.050000 # m\norigin: ${origin}\nnegate: 0\n`), origin).toEqual(place);
  expect(placeOf("origin: [0, .5]\nresolution: 5e-2")).toEqual({ metres_per_pixel: 0.05, x_m: 0, y_m: 0.5, theta_rad: 0 });
});

test("a file without scale or place is refused with the word that is missing", () => {
  expect(() => placeOf("origin: [0, 0, 0]")).toThrow(/resolution/);
  expect(() => placeOf("resolution: 0.05\norigin: here")).toThrow(/origin/);
});

test("pictures in grey levels are read, with comments, in text and with 16 bits", () => {
  const grey = (picture: Uint8Array) => [...pgmOf(picture).grey];
  expect(pgmOf(bytes("P5\n# made by a robot\n3 2\n255\n", [0, 10, 13, 35, 254, 255]))).toEqual({ width: 3, height: 2, grey: new Uint8Array([0, 10, 13, 35, 254, 255]) });
  expect(grey(bytes("P2 2 1 100\n0 100\n"))).toEqual([0, 255]);
  expect(grey(bytes("P5 2 1 65535\n", [255, 255, 0, 0]))).toEqual([255, 0]);
});

test("what is no picture in grey levels is refused", () => {
  for (const text of ["P6 1 1 255\n   ", "P5 0 1 255\n", "P5 9 9 255\n123", "hello", ""]) expect(() => pgmOf(bytes(text)), text).toThrow(/pgm/);
});
