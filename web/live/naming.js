// Words for people: how a landmark was named, how far a pose is trusted, what became of a fix. No page and no server here:
// `naming.test.mjs` checks it.

// The landmark that a quad is, and whether the pose known before named it; null for a quad without a name.
export function named(quad) {
  if (quad.sighting === "guided") return { landmark: quad.guided_landmark, byPose: true };
  return quad.verdict === "unique" ? { landmark: quad.landmark, byPose: false } : null;
}

// What the pose brought into the frame is drawn dashed.
export const isByPose = (quad) => quad.sighting === "guided" || quad.kind === "expected";

// At the quad in the picture; `index` counts from 0.
export function labelOf(quad, index) {
  const name = named(quad);
  if (name) return name.byPose ? `${name.landmark} by pose` : name.landmark;
  return quad.doubtful_landmark ? `${quad.doubtful_landmark}?` : `${index + 1}`;
}

// Why the picture alone leaves one landmark open.
const REFUSALS = {
  plain: "too plain to be named without the robot's pose", corners: "where its corners are is not clear",
};

// In the table of quads.
export function answerOf(quad) {
  const name = named(quad);
  if (name?.byPose) return `${name.landmark} by pose${quad.kind === "expected" ? ", found where it was expected" : ""}`;
  if (name) return name.landmark;
  if (quad.doubtful_landmark) return `${quad.doubtful_landmark}: doubtful, a part of it shows something else`;
  const [first] = quad.candidates ?? [];
  if (quad.verdict === "ambiguous" && REFUSALS[first?.refusal]) return `${first.landmark}? ${REFUSALS[first.refusal]}`;
  return quad.verdict === "ambiguous" && first ? `${first.landmark}?` : quad.verdict || quad.kind;
}

const TRUST = {
  unspecified: "not checked by a landmark yet",
  unsupported: "not confirmed yet",
  supported: "landmarks agree",
  stale: "last confirmed 30 frames or 10 m ago, or longer",
  contradicted: "contradicted by the last landmark",
};

export const trustText = (trust) => (trust ? TRUST[trust] ?? trust : "");

const KINDS = {
  landmarks: "landmarks by picture", guided: "landmarks by pose", laser: "laser", relocalisation: "the last place left",
  map_change: "the pose on another map",
};
const OUTCOMES = {
  started: "began the pose", applied: "applied", gated_out: "left out: contradicts the pose", reset: "replaced the pose",
  excluded_by_mode: "not used: another modality is better here", too_old: "left out: too old", waiting: "waits for odometry",
  carried_over: "carried over", repeated: "repeated", no_pose: "no pose to correct",
};

export const kindText = (modality) => KINDS[modality] ?? modality;
export const outcomeText = (outcome) => OUTCOMES[outcome] ?? outcome.replaceAll("_", " ");

// By how much a fix moved the pose.
export function movedText({ along_m, across_m, turn_rad }) {
  if (along_m === null || along_m === undefined) return "";
  return `${(100 * Math.hypot(along_m, across_m)).toFixed(1)} cm, ${(turn_rad * 180 / Math.PI).toFixed(1)}°`;
}

// How many fixes of each kind came to which end.
export const totalsText = (totals) => Object.entries(totals)
  .map(([kind, ends]) => `${kindText(kind)}: ${Object.entries(ends).map(([end, n]) => `${n} ${outcomeText(end)}`).join(", ")}`)
  .join("; ");

// The cells of one fix; `newest_ns` is the capture time of the last one.
export function correctionCells(correction, newest_ns) {
  const before_s = (newest_ns - correction.captured_ns) / 1e9;
  return [`${before_s.toFixed(1)} s`, kindText(correction.modality), correction.landmarks.join(", "), outcomeText(correction.outcome),
    correction.chi2?.toFixed(1) ?? "", movedText(correction)];
}
