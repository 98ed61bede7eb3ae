// node --test web/naming.test.mjs

import assert from "node:assert/strict";
import test from "node:test";
import { readFileSync } from "node:fs";
import { answerOf, correctionCells, isByPose, labelOf, named, totalsText, trustText } from "./naming.js";

const proto = readFileSync(new URL("../../protos/waymark/v1/waymark.proto", import.meta.url), "utf8");
const candidates = [{ landmark: "door-2", ratio: 0.5 }, { landmark: "door-3", ratio: 0.6 }];
const global = { verdict: "unique", sighting: "global", landmark: "poster", guided_landmark: "", kind: "full", candidates };
const guided = { verdict: "ambiguous", sighting: "guided", landmark: "", guided_landmark: "door-3", kind: "full", candidates };
const expected = { ...guided, verdict: "unknown", kind: "expected", candidates: [] };
const ambiguous = { ...guided, sighting: "unspecified", guided_landmark: "" };

test("a landmark that the pose named is dashed and says so", () => {
  assert.deepEqual(named(guided), { landmark: "door-3", byPose: true });
  assert.deepEqual([labelOf(guided, 0), answerOf(guided), isByPose(guided)], ["door-3 by pose", "door-3 by pose", true]);
  assert.deepEqual([labelOf(expected, 0), answerOf(expected), isByPose(expected)],
    ["door-3 by pose", "door-3 by pose, found where it was expected", true]);
});

test("what the picture alone says is as before", () => {
  assert.deepEqual(named(global), { landmark: "poster", byPose: false });
  assert.deepEqual([labelOf(global, 0), answerOf(global), isByPose(global)], ["poster", "poster", false]);
  assert.equal(named(ambiguous), null);
  assert.deepEqual([labelOf(ambiguous, 4), answerOf(ambiguous), isByPose(ambiguous)], ["5", "door-2?", false]);
  const refused = (refusal) => answerOf({ ...ambiguous, candidates: [{ ...candidates[0], refusal }] });
  assert.equal(refused("plain"), "door-2? too plain to be named without the robot's pose");
  assert.equal(refused("corners"), "door-2? where its corners are is not clear");
  const doubtful = { ...ambiguous, doubtful_landmark: "door-9" };
  assert.equal(labelOf(doubtful, 0), "door-9?");
  assert.match(answerOf(doubtful), /^door-9: doubtful/);
});

test("every trust of the wire has words", () => {
  const words = [...proto.matchAll(/POSE_TRUST_(\w+) =/g)].map(([, word]) => word.toLowerCase());
  assert.equal(words.length, 5);
  for (const word of words) assert.notEqual(trustText(word), word);
  assert.equal(new Set(words.map(trustText)).size, 5);
  assert.equal(trustText(undefined), "");
});

test("the log tells fixes by pose from those by picture", () => {
  const fix = { captured_ns: 7_500_000_000, modality: "guided", landmarks: ["door-3", "door-4"], outcome: "applied", chi2: 1.25,
    along_m: 0.03, across_m: -0.04, turn_rad: Math.PI / 180 };
  assert.deepEqual(correctionCells(fix, 10_000_000_000),
    ["2.5 s", "landmarks by pose", "door-3, door-4", "applied", "1.3", "5.0 cm, 1.0°"]);
  const first = { ...fix, modality: "landmarks", outcome: "started", chi2: null, along_m: null, across_m: null, turn_rad: null };
  assert.deepEqual(correctionCells(first, 7_500_000_000).slice(1), ["landmarks by picture", "door-3, door-4", "began the pose", "", ""]);
  assert.equal(totalsText({ guided: { applied: 3 }, landmarks: { started: 1, applied: 2 } }),
    "landmarks by pose: 3 applied; landmarks by picture: 1 began the pose, 2 applied");
});
