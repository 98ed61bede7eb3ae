import { readFileSync } from "node:fs";
import { expect, test } from "vitest";
import rights from "../../src/api/rights.json";
import { path } from "../../src/api/client";
import type { Landmark } from "../../src/api/types";
import { ago, bytes, count, degrees } from "../../src/words/amounts";
import { operation } from "../../src/words/changes";
import { summaryText } from "../../src/words/difference";
import { gateText, poseGateText } from "../../src/words/gates";
import { priorText } from "../../src/words/prior";
import { type LiveQuad, named, quadKind, quadText } from "../../src/words/quads";
import { recordingOf } from "../../src/words/recording";
import { robotAge, robotState } from "../../src/words/robots";
import { stateOf } from "../../src/words/states";
import { area, proposals } from "../../src/pages/teach/photograph";

/** Questions, which change nothing. */
const WORDLESS = /\/(recognise|localise|visible|coverage|gaze|walls\/read)$/;

test("every change has words", () => {
  const wordless = Object.keys(rights).filter((name) => !name.startsWith("GET ") && !WORDLESS.test(name) && operation(name) === name);
  expect(wordless).toEqual([]);
});

test("every gate of the wire has words", () => {
  const proto = readFileSync("../protos/waymark/v1/waymark.proto", "utf8");
  const listed = /the gate that refused it: ([^.]*)\./s.exec(proto)?.[1] ?? "";
  const gates = listed.replace(/\/\/|\([^)]*\)/gs, " ").split(",").map((gate) => gate.trim()).filter(Boolean);
  expect(gates.length).toBeGreaterThan(8);
  for (const gate of gates) expect(gateText(gate), gate).toMatch(/ /);
});

test("every reason for no position has words", () => {
  const fixes = readFileSync("../engine/src/frame/fixes.rs", "utf8");
  const codes = [...fixes.matchAll(/=> "([a-z_]+)"/g)].map((found) => found[1] ?? "");
  expect(codes.length).toBeGreaterThan(8);
  for (const code of codes) expect(poseGateText(code), code).not.toBe(code.replaceAll("_", " "));
});

test("the gate of the known position is told with its number and limit", () => {
  const check = { prior: { pose: null, covariance: [] }, distance2: 20.25, limit: 11.34, source: "robot" as const, refused: true };
  expect(priorText(check)).toBe("Disagrees: the position by the picture and the one that the robot sent are 4.5 sigma apart; at most 3.4 sigma is let pass.");
  expect(priorText({ ...check, distance2: 1, refused: false })).toMatch(/^Agrees: .* 1\.0 sigma apart/);
  expect(priorText({ ...check, distance2: 1, refused: false, source: "server" })).toMatch(/refuses nothing.* within 3\.4 sigma\.$/);
  expect(priorText({ ...check, distance2: null })).toMatch(/gave no position/);
});

const landmark = (fields: Partial<Landmark>): Landmark => ({
  name: "a", status: "active", health: "sound", views: 3, failed_gates: [], waived_gates: [], size: { width_m: 1, height_m: 1 },
  place: { x_m: 0, y_m: 0, z_m: 1, theta_rad: 0 }, ...fields,
});

test("the worst is the state of a landmark", () => {
  expect(stateOf(landmark({}))).toBe("active");
  expect(stateOf(landmark({ place: null }))).toBe("not-placed");
  expect(stateOf(landmark({ size: null }))).toBe("not-placed");
  expect(stateOf(landmark({ health: "flagged" }))).toBe("flagged");
  expect(stateOf(landmark({ health: "quarantined", status: "learning" }))).toBe("quarantined");
  expect(stateOf(landmark({ status: "inactive", health: "flagged" }))).toBe("inactive");
});

const quad = (fields: Partial<LiveQuad>): LiveQuad => ({ corners: [], verdict: "unknown", kind: "detected", confidence: 0, ...fields });

test("a quad is called by what named it, and nothing else", () => {
  const unique = quad({ verdict: "unique", landmark: "door", confidence: 0.97 });
  expect([named(unique)?.landmark, quadText(unique), quadKind(unique)]).toEqual(["door", "door (97 %)", "named"]);
  const guided = quad({ sighting: "guided", guided_landmark: "door" });
  expect([quadText(guided), quadKind(guided)]).toEqual(["door, by the known position", "by-pose"]);
  const unsure = quad({ verdict: "ambiguous", candidates: [{ landmark: "door", ratio: 0.9, refusal: "corners" }] });
  expect([named(unsure), quadKind(unsure)]).toEqual([undefined, "unsure"]);
  expect(quadText(unsure)).toContain("corners");
  expect(quadText(quad({}))).toBe("no known landmark");
});

test("a robot's state and age follow the clock alone", () => {
  const robot = { is_connected: true, pose: {}, posed_ms: 1000, heard_ms: 1000 };
  expect([robotState(robot, 2900).word, robotState(robot, 3100).word]).toEqual(["Live", "No fresh position"]);
  expect([robotAge(robot, 1500), robotAge(robot, 13_000)]).toEqual(["position now", "position 12 s ago"]);
  expect(robotState({ ...robot, is_connected: false }, 1000).word).toBe("Not connected");
  const lost = { is_connected: true, posed_ms: 0, heard_ms: 1000 };
  expect([robotState(lost, 1100).word, robotAge(lost, 61_000)]).toEqual(["No position", "last seen 60 s ago"]);
  expect(robotAge({ is_connected: false, posed_ms: 0 }, 0)).toBe("not heard since the server's start");
});

test("amounts are short and right", () => {
  expect([bytes(999), bytes(64_000), bytes(2_500_000)]).toEqual(["999 B", "64 kB", "2.5 MB"]);
  expect([count(1, "map"), count(2000, "landmark")]).toEqual(["1 map", "2,000 landmarks"]);
  expect([degrees(-Math.PI / 2), degrees(2 * Math.PI), degrees(1e-9)]).toEqual(["270°", "0°", "0°"]);
  expect([ago(200), ago(30_000), ago(7_200_000)]).toEqual(["now", "30 s ago", "2 h ago"]);
});

test("a difference is told in one line", () => {
  const none = { landmarks: [], landmarks_added: 0, landmarks_changed: 0, landmarks_removed: 0, models_changed: 0, reference_runs_added: 0, reference_runs_removed: 0, settings: [], underlay_changed: false, views_added: 0, views_removed: 0, walls_changed: false };
  expect(summaryText(none)).toBe("nothing");
  expect(summaryText({ ...none, landmarks_added: 1, views_added: 4, walls_changed: true })).toBe("1 landmark added, 4 photographs added, walls changed");
});

test("names in addresses are encoded", () => {
  expect(path`/maps/${"a/b"}/landmarks/${"c d"}`).toBe("/maps/a%2Fb/landmarks/c%20d");
});

test("proposals are the quads of four corners, largest first", () => {
  const corners = (side: number) => [[0, 0], [side, 0], [side, side], [0, side]].map(([u_px = 0, v_px = 0]) => ({ u_px, v_px }));
  const found = proposals({ seq: 1, status: "no_match", latency_ms: 1, quads: [quad({ corners: corners(2) }), quad({ corners: corners(9) }), quad({ corners: corners(3).slice(1) })] });
  expect(found.map(area)).toEqual([81, 4]);
});

test("commands that record and replay have only options that the program has", () => {
  const sources = ["record", "replay", "mod"].map((name) => readFileSync(`../cli/src/recording/${name}.rs`, "utf8")).join("") + readFileSync("../cli/src/session.rs", "utf8");
  const commands = recordingOf("r1", "hall", "http://127.0.0.1:8080");
  expect(commands.record).toBe("waymark record r1.mcap --robot r1 --server http://127.0.0.1:8080");
  expect(commands.compare).toBe("waymark replay r1.mcap --robot replay --map hall --server http://127.0.0.1:8080 --compare");
  for (const option of new Set(Object.values(commands).join(" ").match(/--[a-z]+/g))) expect(sources, option).toMatch(new RegExp(`\\b${option.slice(2)}: `));
});
