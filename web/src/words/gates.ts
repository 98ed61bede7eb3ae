// Why a candidate was left out, in words. The keys are those of `Candidate.refusal` in protos/waymark/v1/waymark.proto.

const GATES: Record<string, string> = {
  correlation: "its brightness differs too much",
  hausdorff: "its edges lie elsewhere",
  similarity: "its gradients differ too much",
  mismatch: "a part of it shows something else",
  low_content: "there is too little to see in it",
  margin: "another landmark fits nearly as well",
  points: "too few matching points to be sure",
  disagreement: "a connected part of it shows something else",
  corners: "where its corners are is not clear",
  plain: "its small picture alone speaks for it",
};

export const gateText = (gate: string) => GATES[gate] ?? gate.replaceAll("_", " ");

// Why a frame gave no position. The keys are those of `pose_refusal`, and of the codes of rejected frames.
const POSE_GATES: Record<string, string> = {
  landmark_not_placed: "the landmark that was recognised has no place on the map",
  landmark_quarantined: "the landmark that was recognised is out of use until a person decides",
  no_extrinsics: "where the camera sits on the robot is not known",
  weak_observation: "what was recognised is seen too badly to measure by it",
  ambiguous: "two positions fit equally well",
  degenerate: "the corners do not determine a position",
  gate_reprojection: "size, place, camera height or tilt do not fit what was seen",
  gate_prior: "it is too far from the position that was known before",
  gate_behind_wall: "the robot would stand behind the wall",
  gate_inconsistent: "the landmarks contradict one another",
  gate_camera_height: "the camera would be below the floor or far above it",
  gate_imprecise: "the landmarks give the camera's position worse than to 15 cm",
};

export const poseGateText = (code: string) => POSE_GATES[code] ?? gateText(code);
