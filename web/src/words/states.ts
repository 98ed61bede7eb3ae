// Words for states, the same on every page.
import type { Landmark } from "../api/types";

/** How a landmark stands, as one state: health comes before learning. */
export type LandmarkState = "active" | "not-placed" | "learning" | "not-learnt" | "inactive" | "flagged" | "quarantined";

export function stateOf(landmark: Landmark): LandmarkState {
  if (landmark.health === "quarantined") return "quarantined";
  if (landmark.status === "learning") return "learning";
  if (landmark.status === "not_learnt") return "not-learnt";
  if (landmark.status === "inactive") return "inactive";
  if (landmark.health === "flagged") return "flagged";
  return landmark.place && landmark.size ? "active" : "not-placed";
}

/** Whether the server has what was learnt of it: one that looks like another is refused with its model. */
export const isLearnt = (landmark: Landmark) => Boolean(landmark.model) && !landmark.failed_gates.some(({ gate }) => gate === "looks_like");

interface Words {
  word: string;
  /** What it means for robots. */
  meaning: string;
  kind: "good" | "warn" | "bad" | "plain";
}

export const STATES: Record<LandmarkState, Words> = {
  active: { word: "In use", meaning: "Robots recognise it and find their place by it.", kind: "good" },
  "not-placed": { word: "Without a place", meaning: "Robots recognise it, but it gives no position: its size or place is missing.", kind: "warn" },
  learning: { word: "Learning", meaning: "Its model is being made.", kind: "plain" },
  "not-learnt": { word: "Not learnt", meaning: "It has no model yet. Add photographs, then learn.", kind: "plain" },
  inactive: { word: "Not in use", meaning: "It was learnt, but is not good enough to be relied on.", kind: "warn" },
  flagged: { word: "To be checked", meaning: "Robots have seen something that speaks against it. It is still used.", kind: "warn" },
  quarantined: { word: "Out of use", meaning: "Robots found that it has moved or changed, or somebody took it out of use. It corrects no robot until it is put back in use.", kind: "bad" },
};

/** Of a landmark out of use against which no robot has found anything. */
export const BY_HAND = "Somebody took it out of use: it corrects no robot until it is put back. The audit log of the server says who.";

/** How far a robot's pose is trusted. */
export const TRUST: Record<string, string> = {
  unspecified: "not checked by a landmark yet",
  unsupported: "not confirmed yet",
  supported: "landmarks agree",
  stale: "last confirmed 30 frames or 10 m ago, or longer",
  contradicted: "contradicted by the last landmark",
};

/** What a robot sends. */
export const INPUT: Record<string, string> = {
  frame: "Frames",
  odometry: "Odometry",
  scan: "Laser scans",
  camera_info: "Calibrations of cameras",
  transform: "Transforms",
  connection: "Connections",
};

/** How a frame was answered. */
export const ANSWERS: Record<string, string> = {
  matched: "recognised",
  ambiguous: "unsure between several",
  no_match: "nothing known in view",
  rejected: "frame refused",
  expired: "too old when its turn came",
  overloaded: "server overloaded",
  not_ready: "server not ready",
};

/** Where a job stands. */
export const JOBS: Record<string, string> = {
  queued: "waits",
  running: "runs",
  done: "done",
  failed: "failed",
  cancelled: "cancelled",
};
