// Quads of an answer in words: how a landmark was named, and why one was not.

export interface LiveQuad {
  corners: { u_px: number; v_px: number }[];
  verdict: string;
  kind: string;
  sighting?: string;
  landmark?: string;
  guided_landmark?: string;
  doubtful_landmark?: string;
  confidence: number;
  candidates?: { landmark: string; ratio?: number | null; refusal?: string }[];
}

export interface LiveAnswer {
  seq: number;
  status: string;
  quads: LiveQuad[];
  latency_ms: number;
  rejection?: { code: string; field: string; detail: string } | null;
  pose_refusal_detail?: { sentence: string } | null;
}

/** The landmark that a quad is, and whether the pose known before named it. */
export function named(quad: LiveQuad): { landmark: string; byPose: boolean } | undefined {
  if (quad.sighting === "guided" && quad.guided_landmark) return { landmark: quad.guided_landmark, byPose: true };
  return quad.verdict === "unique" && quad.landmark ? { landmark: quad.landmark, byPose: false } : undefined;
}

const REFUSALS: Record<string, string> = {
  plain: "too plain to be named without the robot's position",
  corners: "where its corners are is not clear",
};

/** What a quad is, in words. */
export function quadText(quad: LiveQuad): string {
  const name = named(quad);
  if (name?.byPose) return `${name.landmark}, by the known position`;
  if (name) return `${name.landmark} (${Math.round(100 * quad.confidence)} %)`;
  if (quad.doubtful_landmark) return `${quad.doubtful_landmark}: doubtful, a part of it shows something else`;
  const first = quad.candidates?.[0];
  const why = first?.refusal ? REFUSALS[first.refusal] : undefined;
  if (quad.verdict === "ambiguous" && first) return `${first.landmark}? ${why ?? "another landmark fits nearly as well"}`;
  return "no known landmark";
}

export type QuadKind = "named" | "by-pose" | "unsure" | "unknown";

export function quadKind(quad: LiveQuad): QuadKind {
  const name = named(quad);
  if (name) return name.byPose ? "by-pose" : "named";
  return quad.doubtful_landmark || quad.verdict === "ambiguous" ? "unsure" : "unknown";
}
