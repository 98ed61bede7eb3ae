// Why a candidate was left out, in words. The keys are those of `Candidate.refusal` in protos/waymark/v1/waymark.proto.

const GATES: Record<string, string> = {
  correlation: "its brightness differs too much",
  hausdorff: "its edges lie elsewhere",
  similarity: "its gradients differ too much",
  mismatch: "a part of it shows something else",
  low_content: "there is too little to see in it",
  margin: "another landmark fits nearly as well",
  points: "so many points would agree by chance too often",
  disagreement: "a connected part of it shows something else",
  corners: "where its corners are is not clear",
  plain: "its small picture alone speaks for it",
};

export const gateText = (gate: string) => GATES[gate] ?? gate.replaceAll("_", " ");
