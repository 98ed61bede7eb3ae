// The parts of a stored `Answer` that the page shows (protos/waymark/v1/waymark.proto as JSON).
import type { LiveAnswer, LiveQuad } from "../../words/quads";

export interface Candidate {
  landmark: string;
  /** Absent where points decide. */
  distance?: number;
  threshold?: number;
  ratio?: number | null;
  refusal?: string;
  gradient_similarity?: number;
}

export interface StoredQuadBody extends Omit<LiveQuad, "candidates"> {
  candidates?: Candidate[];
  points?: { matches: number; inliers: number; checked: number; agreeing: number; log10_chance: number; agreement: string[] };
}

export interface PoseBody {
  pose?: { x_m: number; y_m: number; theta_rad: number };
  /** Over (x, y, theta), row-major. */
  covariance?: number[];
}

export interface AnswerBody extends Omit<LiveAnswer, "quads" | "pose_refusal_detail"> {
  pose_refusal?: string;
  pose_refusal_detail?: { sentence: string; chi2: number; limit: number };
  quads: StoredQuadBody[];
  map_from_robot?: PoseBody;
  guided_map_from_robot?: PoseBody;
}
