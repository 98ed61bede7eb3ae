// Short names of the bodies that the pages use.
import type { components } from "./schema";

type Schemas = components["schemas"];
export type AuditEntry = Schemas["AuditEntry"];
export type Backup = Schemas["Backup"];
export type Camera = Schemas["Camera"];
export type CalibrationReport = Schemas["CalibrationReport"];
export type Corrections = Schemas["CorrectionsBody"];
export type MappingProgress = Schemas["MappingProgressBody"];
export type ModalityMap = Schemas["ModalityMapBody"];
export type Recording = Schemas["RecordingStatusBody"];
export type ReferenceRun = Schemas["ReferenceRunBody"];
export type Relocalisation = Schemas["RelocalisationStatus"];
export type VisibilitySettings = Schemas["VisibilitySettingsBody"];
export type Commit = Schemas["Commit"];
export type Draft = Schemas["Draft"];
export type DraftDifference = Schemas["DraftDifference"];
export type DistanceHistogram = Schemas["DistanceHistogram"];
export type DuplicatePair = Schemas["DuplicatePair"];
export type Job = Schemas["Job"];
export type Landmark = Schemas["Landmark"];
export type LandmarkDistances = Schemas["LandmarkDistances"];
export type LandmarkEvidence = Schemas["LandmarkEvidence"];
export type LandmarkModelDetail = Schemas["LandmarkModelDetail"];
export type MapBody = Schemas["Map"];
export type Place = Schemas["Place"];
export type PriorCheck = Schemas["PriorCheck"];
export type QuadMatches = Schemas["QuadMatches"];
export type Problem = Schemas["Problem"];
export type Readiness = Schemas["Readiness"];
export type Replay = Schemas["Replay"];
export type Robot = Schemas["Robot"];
export type RobotActivity = Schemas["RobotActivity"];
export type RobotInput = Schemas["RobotInput"];
export type RefusedView = Schemas["RefusedView"];
export type Role = Schemas["Role"];
export type ServerEvent = Schemas["ServerEvent"];
export type Servers = Schemas["Servers"];
export type Size = Schemas["Size"];
export type StorageHealth = Schemas["StorageHealth"];
export type StoredAnswer = Schemas["StoredAnswer"];
export type StoredAnswerSummary = Schemas["StoredAnswerSummary"];
export type Token = Schemas["Token"];
export type TrainingView = Schemas["TrainingView"];
export type Underlay = Schemas["Underlay"];
export type VisibleResponse = Schemas["VisibleResponse"];
export type CoverageResponse = Schemas["CoverageResponse"];
export type Walls = Schemas["WallsBody"];
export type Whoami = Schemas["Whoami"];

/** A page of a list. */
export interface Listed<T> {
  items: T[];
  /** Where the next page begins; absent on the last one. */
  next?: string | null;
  total?: number | null;
}
