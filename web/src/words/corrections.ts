// What became of the fixes of a robot's pose, in words.

const KINDS: Record<string, string> = {
  odometry: "odometry",
  landmarks: "landmarks by their picture",
  guided: "landmarks by the known position",
  laser: "laser",
  relocalisation: "the last possible place",
  by_hand: "a person said it",
  map_change: "the position on another map",
};

const OUTCOMES: Record<string, string> = {
  started: "began the position",
  applied: "applied",
  gated_out: "left out: it contradicts the position",
  reset: "replaced the position",
  excluded_by_mode: "not used: another sensor is better here",
  too_old: "left out: too old",
  waiting: "waits for odometry",
  carried_over: "carried over",
  repeated: "repeated",
  no_pose: "no position to correct",
  no_walls: "the map has no walls",
};

const MISSING: Record<string, string> = {
  higher_probability: "other places are still too probable",
  second_landmark: "another landmark has to be seen",
  consistent_observations: "what was seen does not agree well enough",
  no_rival_pose: "another place would explain what was seen nearly as well",
};

export const kindText = (modality: string) => KINDS[modality] ?? modality.replaceAll("_", " ");
export const outcomeText = (outcome: string) => OUTCOMES[outcome] ?? outcome.replaceAll("_", " ");
export const missingText = (condition: string) => MISSING[condition] ?? condition.replaceAll("_", " ");

/** By how much a fix has moved the pose; empty if it has not. */
export function movedBy({ along_m, across_m, turn_rad }: { along_m?: number | null; across_m?: number | null; turn_rad?: number | null }): string {
  if (along_m == null) return "";
  return `${(100 * Math.hypot(along_m, across_m ?? 0)).toFixed(1)} cm, ${(((turn_rad ?? 0) * 180) / Math.PI).toFixed(1)}°`;
}
