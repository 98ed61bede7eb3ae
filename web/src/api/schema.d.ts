// Made by `npm run types` of docs/openapi.json. Do not edit.
export interface components {
    schemas: {
        /** What is accepted. */
        AcceptRequest: {
            /** At least one. */ tracks: components["schemas"]["AcceptedTrackBody"][];
            /** Learn these landmarks at once. */ learn?: boolean;
        };
        /** What an acceptance came to. */
        AcceptanceBody: {
            /** The landmarks that got views, by name. */ landmarks: components["schemas"]["ExtendedLandmark"][];
            job?: components["schemas"]["Job"] | null;
        };
        /** A track that is accepted. */
        AcceptedTrackBody: {
            /** Number of the track. */ track: number;
            /** Name of the landmark it becomes: a new one, or one without views. Several tracks of one object may be given one name. Not needed for views of a landmark that is known. */
            name?: string | null;
        };
        /** What follows for a robot there. */
        AdviceBody: {
            best?: components["schemas"]["ModalityBody"] | null;
            /** What is fused. */ used: components["schemas"]["ModalityBody"][];
            /** Whose runs say so: those through the `cell`, those through it and the eight around it (`neighbourhood`), those through the named `area`, or all of the `map`. */
            scope: components["schemas"]["StatsScopeBody"];
            /** What each modality gets wrong there beyond what it claims. */
            error_models: components["schemas"]["ErrorModelBody"][];
        };
        /** robot/{robot}/answer, with the camera attached */
        Answer: {
            epoch: number;
            seq: number;
            captured_ns: number;
            map: string;
            map_version: number;
            status: components["schemas"]["AnswerStatus"];
            rejection: components["schemas"]["Rejection"] | null;
            quads: components["schemas"]["QuadAnswer"][];
            map_from_robot: components["schemas"]["Pose2Covariance"] | null;
            /** The landmarks it rests on. */ pose_landmarks: string[];
            /** Receipt to answer, server clock. */ latency_ms: number;
            timings: components["schemas"]["StageTime"][];
            /** The capture time is more than 2 s from the server's clock, or does not fit those of the robot's other messages: then the answer holds for the image, and the frame has no influence on the fused pose. */
            clock_suspect: boolean;
            /** Why recognised landmarks gave no robot pose: empty, no_extrinsics, landmark_not_placed, landmark_quarantined (found moved or missing; see its health), weak_observation (seen too poorly to tell whether it was moved, by a robot whose pose is known well enough without), ambiguous, or a gate: gate_prior (the robot's prior rules it out), gate_reprojection (no upright robot on the floor sees them so), gate_behind_wall (it would stand behind the wall), gate_inconsistent (the landmarks contradict one another), degenerate. */
            pose_refusal: string;
            /** Where the robot may be while it does not know its pose and sees only landmarks that each may be several, most probable first; it needs odometry for that. None of them is a pose: that comes on the key `pose` when one is left. */
            hypotheses: components["schemas"]["Hypothesis"][];
            guided_map_from_robot: components["schemas"]["Pose2Covariance"] | null;
            /** The landmarks it rests on: the guided ones, and those named globally where they alone gave no pose. */
            guided_landmarks: string[];
            /** Landmarks were looked for only where the robot's pose expects them: nothing was detected, and nothing named by the picture alone. By default only while frames wait (the server's setting `search_frames`). */
            only_expected: boolean;
            pose_refusal_detail: components["schemas"]["PoseRefusalDetail"] | null;
            camera_pose: components["schemas"]["CameraPose"] | null;
            /** Why recognised landmarks gave no pose of the camera: empty, landmark_not_placed, landmark_quarantined, ambiguous, gate_camera_height (below the floor or more than 5 m above it), gate_inconsistent, gate_imprecise (its position is known worse than to 15 cm), degenerate. */
            camera_pose_refusal: string;
            /** The server that answers, over zenoh; empty over HTTP. */ server: string;
            /** What the walls of the map say against the pose of a photograph, or of a localisation by a frame: behind_wall (a wall is between the camera and a landmark that the pose rests on), outside_map (it is outside of what the walls surround). The pose stands all the same. Usually the place, the facing or the size of a landmark is wrong, or the map lacks walls. */
            pose_cautions: string[];
        };
        /** What came of a frame. */
        AnswerStatus: "matched" | "ambiguous" | "no_match" | "rejected" | "expired" | "overloaded" | "not_ready" | "unspecified";
        /** A part of the map with a name: a room, a piece of corridor. It speaks for its square metres that were hardly driven through. */
        AreaBody: {
            /** Unique, 1 to 64 bytes. */ name: string;
            /** Its corners in order, x and y in metres: 3 to 64. */ corners_m: components["schemas"]["Pair"][];
        };
        /** What is known of a place. */
        AreaStatsBody: {
            /** What follows for a robot there. */ advice: components["schemas"]["AdviceBody"];
            /** What runs have shown, by modality. */ statistics: components["schemas"]["ModalityStatsBody"][];
        };
        /** The chain as it was found: the digest of every entry was computed anew. */
        AuditCheck: {
            /** Entries that are kept. */ entries: number;
            /** Entries that were forgotten for want of room; the chain goes on from their last one. */
            forgotten: number;
            /** The newest entry. Noted elsewhere, it proves later that nothing before it was changed. */
            head: components["schemas"]["AuditHead"];
            /** The first thing that is wrong; none where the chain is whole. */ fault?: string | null;
        };
        /** A change, and who made it. */
        AuditEntry: {
            /** 1, 2, 3, ... without gaps. */ seq: number;
            /** ms since the Unix epoch. */ time_ms: number;
            /** Name of the token; `local` for the local one, `server` for what the server does by itself. */
            actor: string;
            /** Number of the token; none for the local one and the server. */ token?: number | null;
            /** Method and path of the operation, as in the authorisation table, or what the server did. */
            action: string;
            /** Path of the request. */ target: string;
            /** Id of the request, as in the log of the server. */ request?: string | null;
            /** The reason that was given. */ why?: string | null;
            /** Digest of this entry and of all before it: SHA-256, hexadecimal. */ sha256: string;
        };
        /** A place in the chain. */
        AuditHead: {
            /** Number of the entry; 0 before the first. */ seq: number;
            /** Its digest: SHA-256, hexadecimal. */ sha256: string;
        };
        /** A backup in the server's data directory. */
        Backup: {
            /** Its time in UTC, as in `20261123-140530`. */ name: string;
            /** How far it is. */ state: components["schemas"]["BackupState"];
            /** When it was begun, ms since the Unix epoch. */ created_ms: number;
            /** Size of the file; 0 until it is complete. */ bytes: number;
            /** Why it failed, or what is wrong with it. */ reason?: string | null;
            manifest?: components["schemas"]["BackupManifest"] | null;
        };
        /** The state of backups, in `/readyz`. */
        BackupHealth: {
            /** Hours between scheduled backups; 0: none are scheduled. */ every_hours: number;
            /** Name of the newest complete backup in the data directory. */ newest?: string | null;
            /** When that was made, ms since the Unix epoch. */ newest_ms?: number | null;
            /** Why the last attempt failed; absent once one has succeeded. */ failed?: string | null;
        };
        /** What a backup holds. */
        BackupManifest: {
            /** When it was made, ms since the Unix epoch. */ created_ms: number;
            /** Version of the program that made it. */ program: string;
            /** Number of the last step of the database's schema. */ schema: number;
            /** The maps, by name. */ maps: components["schemas"]["BackupMap"][];
            /** Number of stored pictures. */ pictures: number;
            /** What was wrong with the data when the backup was made. */ faults: string[];
        };
        /** What a backup holds of one map. */
        BackupMap: {
            /** Its name. */ name: string;
            /** Its version. */ version: number;
            /** Number of landmarks. */ landmarks: number;
            /** Number of training views. */ views: number;
            /** Number of models. */ models: number;
            /** Number of wall segments. */ walls: number;
            /** SHA-256 over the digests of its settings, landmarks, views, models and walls, hexadecimal. */
            sha256: string;
        };
        /** How far a backup is. */ BackupState: "running" | "complete" | "failed" | "damaged";
        /** Least x, least y, greatest x, greatest y, in metres. */
        Bounds: [
            number,
            number,
            number,
            number
        ];
        /** What was done to several landmarks. */
        BulkOutcome: {
            /** Landmarks made or deleted. */ count: number;
        };
        /** What may be said beside the views. */
        CalibrationConstraintsBody: {
            /** Radial coefficients (k1, k2) that may be fitted, 0 to 2; only those are that the views ask for. */
            radial?: number;
            /** The camera does not roll (C2). */ zero_roll?: boolean;
            /** The camera is this high over the landmark's centre in all views, metres; negative below, -100 to 100 (C3). */
            height_m?: number | null;
            /** The ratio of the landmark's sides is not what its size says, and is found with the camera. */
            unknown_aspect?: boolean;
        };
        /** A calibrated camera. Standard deviations are infinite (null in JSON) where the views do not determine them. */
        CalibrationReport: {
            /** As frames carry it, with the standard deviations below: what is not known of the camera is then in the poses. */
            intrinsics: components["schemas"]["Intrinsics"];
            /** Width of the pictures that it was calibrated with. */ width_px: number;
            /** Height of these pictures. */ height_px: number;
            /** Standard deviation of the focal length. */ fx_sigma_px: number | null;
            /** Standard deviation of the principal point, to the right. */ cx_sigma_px: number | null;
            /** Standard deviation of the principal point, down. */ cy_sigma_px: number | null;
            /** Focal length of the linear solution, where there was one. */ linear_fx_px?: number | null;
            /** Root mean square residual per coordinate. */ rms_px: number;
            /** Weighted squared residual over its degrees of freedom: about 1 where corners are as good as claimed. */
            reduced_chi2: number;
            /** Orientations of the landmark that differ by more than 15 degrees. */ orientations: number;
            /** Height over width of the landmark over what its size says. */ aspect_ratio: number;
            /** Why it should not be believed without a look: empty where nothing speaks against it. */
            warnings: string[];
            /** Each view, in the order given. */ views: components["schemas"]["CalibrationViewReport"][];
        };
        /** What to calibrate from. */
        CalibrationRequest: {
            uploaded_views?: components["schemas"]["UploadedViews"] | null;
            /** What is known beside the views. */ constraints?: components["schemas"]["CalibrationConstraintsBody"];
        };
        /** One view of a calibration. */
        CalibrationViewReport: {
            /** Whether the camera rests on it; a view that does not fit is left out. */ used: boolean;
            /** Root mean square residual per coordinate. */ rms_px?: number | null;
            /** Distance of the camera from the landmark's centre, metres. */ distance_m?: number | null;
        };
        /** A camera of a robot, since the server started. */
        Camera: {
            /** `[a-z0-9_-]{1,64}`, unique on the robot. */ name: string;
            /** As its frames say. */ intrinsics: components["schemas"]["Intrinsics"];
            /** Of its frames. */ width_px: number;
            /** Of its frames. */ height_px: number;
            /** Frames with these intrinsics in which a landmark was recognised. */ frames: number;
            /** Views of landmarks from different sides that are kept for calibration. */ views: number;
            /** What the residuals of its fixes say: `suspicion` is set when the intrinsics seem off, with the reason and its number. */
            intrinsics_monitor: components["schemas"]["IntrinsicsMonitorBody"];
        };
        /** Where a photograph was taken. Nothing is assumed of how the camera was held. */
        CameraPose: {
            map_from_camera: components["schemas"]["Pose3"] | null;
            /** Over (rotation vector, position), map frame; 36 numbers. */ covariance: number[];
            /** The landmark that gives the pose, then those that agree with it. */ landmarks: string[];
        };
        /** A robot's cameras. */
        Cameras: {
            /** By name. */ cameras: components["schemas"]["Camera"][];
        };
        Candidate: {
            landmark: string;
            /** C^r and H^r; absent where points decide. H^r is absent, too, when there are too few points, and when another gate refused already. */
            correlation: number | null;
            hausdorff: number | null;
            /** The distance that decides and its threshold; absent where points decide, and where the distance is infinite. */
            distance: number | null;
            threshold: number | null;
            /** Accepted below 1: the distance over its threshold, or, where points decide, -5 over their log10_chance. Absent where it is infinite: too few points. */
            ratio: number | null;
            /** Equal for each landmark that the verdict leaves, and for `probability_none` where that is left. */
            probability: number;
            /** Empty, or the gate that refused it: correlation, hausdorff, similarity, mismatch, low_content, margin, points (so many points would agree by chance too often), disagreement (a connected part shows something else), corners (points agree, but do not tell where its corners are), plain (its icon alone speaks for it). */
            refusal: string;
            /** Gradient similarity of the picture and the learnt icon after alignment, -1 to 1; absent where the map's distances decide alone. */
            gradient_similarity: number | null;
        };
        /** A pose cell: a square metre that was driven through in one of four headings. */
        CellBody: {
            /** Its lower left corner, x. */ x_m: number;
            /** Its lower left corner, y. */ y_m: number;
            /** 0, pi/2, pi or -pi/2, each for a quarter of the circle about it. */ heading_rad: number;
            best?: components["schemas"]["ModalityBody"] | null;
            /** What is fused. */ used: components["schemas"]["ModalityBody"][];
        };
        /** A request for a certificate. The robot's private key stays where it was made. */
        CertificateRequest: {
            /** PKCS #10, PEM, signed with the private key. Of it only the public key is taken. */ request: string;
            /** Seconds for which the certificate is valid, by the server's clock: 60 to ten years; a year if absent. */
            valid_s?: number | null;
        };
        /** Kind of a change. */ ChangeKind: "added" | "removed" | "changed";
        /** Counts of what changed. */
        ChangeSummary: {
            /** Landmarks that are new. */ landmarks_added: number;
            /** Landmarks that are gone. */ landmarks_removed: number;
            /** Landmarks with another name, size, place, model, or other views. */ landmarks_changed: number;
            /** Training views that are new. */ views_added: number;
            /** Training views that are gone. */ views_removed: number;
            /** Models that differ, if only by a threshold. */ models_changed: number;
            /** The walls differ. */ walls_changed: boolean;
            /** The picture under the map, or where it lies, differs. */ underlay_changed: boolean;
            /** Reference runs that are new. */ reference_runs_added: number;
            /** Reference runs that are gone. */ reference_runs_removed: number;
            /** Which settings differ: `name`, `site`, `building`, `floor`, `parent`, `pipeline` (detector or decision), `learning`, `fusion_mode`, `areas`, `visibility_settings`. */
            settings: string[];
            /** Names of the first landmarks that differ, at most 8. */ landmarks: string[];
        };
        /** A commit: what one request or job changed of a map. */
        Commit: {
            /** Its number: later commits have greater ones, also across maps. */ id: number;
            /** The commit of this map before it; it may be forgotten. */ parent?: number | null;
            /** ms since the Unix epoch. */ created_ms: number;
            /** Name of the token, `local` for that of the server's machine, `server` for what the server does by itself. Of a job: who asked for it. */
            author: string;
            /** The job, if one did it. */ job?: number | null;
            /** Method and path of the request, as `PATCH /maps/{map}/landmarks/{landmark}`; of a job its kind; `outside` for what another program wrote into the database. */
            operation: string;
            /** The reason that the client gave (header `Waymark-Why`). */ why?: string | null;
            /** What changed. */ summary: components["schemas"]["ChangeSummary"];
        };
        /** Corners in pixels: top-left, top-right, bottom-right, bottom-left. */
        Corners: [
            components["schemas"]["Pair"],
            components["schemas"]["Pair"],
            components["schemas"]["Pair"],
            components["schemas"]["Pair"]
        ];
        /** A fix, what became of it, and by how much it moved the pose. */
        CorrectionBody: {
            /** Echo of the frame or scan. */ epoch: number;
            /** Echo of the frame or scan, robot's clock. */ captured_ns: number;
            /** The map it is a pose in. */ map: string;
            /** `landmarks` (named without the pose), `guided` (landmarks named by the pose), `laser` or `relocalisation`; `by_hand` when a person said where it is; `map_change` when the robot came from another map. */
            modality: string;
            /** The landmarks it rests on, by name; empty for the laser. */ landmarks: string[];
            /** `started` (it gave the first pose), `applied`, `gated_out` (it contradicts the pose and was left out), `reset` (the last of several that contradict the pose and agree with one another, or a person: it replaced the pose), `excluded_by_mode` (it agrees, but reference runs have shown another modality to be better here, and the map's fusion mode leaves this one out), `too_old`, `waiting` (newer than the last odometry), `carried_over` (the pose on another map, in the frame of this one). */
            outcome: string;
            /** Squared Mahalanobis distance of the fix from the pose before it, 3 degrees of freedom; for `applied`, `excluded_by_mode` and `gated_out`. */
            chi2?: number | null;
            /** By how much it moved the pose, in the robot's frame before it: forwards, metres. */
            along_m?: number | null;
            /** By how much it moved the pose to the left, metres. */ across_m?: number | null;
            /** By how much it turned the pose to the left. */ turn_rad?: number | null;
        };
        /** What a robot's pose rests on, and what became of its fixes. */
        CorrectionsBody: {
            /** What the pose rests on now: `odometry`, `landmarks`, `guided`, `laser`, `relocalisation`, `by_hand`; empty without a pose. */
            modalities: string[];
            /** For each modality how many fixes came to which end. For the laser also why scans gave no fix: `no_pose` (there is none to correct), `no_walls` (the map has none), `few_points`, `poor_match` (it shows something else than the map), `gate_prior` (it contradicts the pose), `ambiguous` (several poses fit), `superseded` (a newer one came first). */
            totals: {
                [key: string]: {
                    [key: string]: number;
                };
            };
            /** The latest 200 of each modality, oldest first; without `repeated` ones, which tell nothing new. */
            corrections: components["schemas"]["CorrectionBody"][];
        };
        /** A covariance over (x, y, theta), row-major, in m and rad. */
        Covariance: [
            number,
            number,
            number,
            number,
            number,
            number,
            number,
            number,
            number
        ];
        /** A piece of the path from which no landmark is seen. */
        CoverageGapBody: {
            /** Its beginning, metres along the path. */ from_m: number;
            /** Its end, metres along the path. */ to_m: number;
        };
        /** A path to look at. */
        CoverageRequest: {
            /** Its points: x, y in metres. */ path: components["schemas"]["Pair"][];
            /** How often to look: 0.01 to 10 m. */ step_m?: number;
            /** Another camera than the map's. */ visibility_settings?: components["schemas"]["VisibilitySettingsBody"];
        };
        /** What is seen along a path. */
        CoverageResponse: {
            /** Of this version of the map. */ map_version: number;
            /** Length of the path. */ length_m: number;
            /** Share of the path from which some landmark is seen. */ share: number;
            /** Pieces without a landmark, in order. */ gaps: components["schemas"]["CoverageGapBody"][];
            /** Places along the path, `step_m` apart. */ steps: components["schemas"]["CoverageSampleBody"][];
        };
        /** One place of the path. */
        CoverageSampleBody: {
            /** Metres from the beginning of the path. */ along_m: number;
            /** Metres, in the map. */ x_m: number;
            /** Metres, in the map. */ y_m: number;
            /** Names of the landmarks that are seen. */ landmarks: string[];
        };
        /** A new token, with its text. */
        CreatedToken: {
            /** `wmk_{id}_{secret}`, sent as `Authorization: Bearer`. It is shown this once: only its digest is stored. */
            text: string;
            /** What it is. */ token: components["schemas"]["Token"];
        };
        /** The check of every page, row and index of the database that runs once after each start. */
        DatabaseCheckBody: {
            /** How far it is. */ state: components["schemas"]["DatabaseCheckState"];
            /** When it ended, ms since the Unix epoch. */ ended_ms?: number | null;
            /** What is wrong, at most 20; empty for whoever does not see all maps. */ faults?: string[];
            /** What to do where it failed. */ advice?: string | null;
        };
        /** How far the check of the database is. */ DatabaseCheckState: "running" | "ok" | "failed";
        /** What differs between a map at two commits. */
        Difference: {
            /** The earlier commit. */ from_commit: number;
            /** The later commit; the newest one for the present state. */ to_commit: number;
            /** Counts of all of it. */ summary: components["schemas"]["ChangeSummary"];
            walls?: components["schemas"]["WallsDifference"] | null;
            /** The landmarks that differ, in the order of their numbers. */
            landmarks: components["schemas"]["Page_LandmarkDifference"];
        };
        /** Which distance decides in a map. */ Distance: "both" | "correlation" | "hausdorff";
        /** Distances of one kind that a threshold was fitted to. */
        DistanceHistogram: {
            /** Accepted below; 0 accepts nothing. */ threshold: number;
            /** Width of a bin; the first begins at 0. */ bin_width: number;
            /** Held-out distances of the landmark's own views, by bin. */ own: number[];
            /** Own distances beyond the last bin, infinite ones included. */ own_beyond: number;
            /** Distances to other landmarks and distractors, by bin; of these only the 64 nearest are stored. */
            others: number[];
            /** Distances to others that are in no bin: beyond the last one, or not among the nearest. */
            others_beyond: number;
        };
        /** A draft: a map of its own, made of another one and published to it as one commit. */
        Draft: {
            /** Its name: every operation on maps takes it. */ name: string;
            /** The commit of the map that it began with. */ from_commit: number;
            /** ms since the Unix epoch. */ created_ms: number;
            /** That of the draft, as of any map. */ revision: string;
            /** Landmarks in it. */ landmarks: number;
        };
        /** What publishing a draft would change of its map. */
        DraftDifference: {
            /** The commit of the map that the draft began with. */ from_commit: number;
            /** What both have changed since, in words: while there is any, the draft cannot be published. */
            conflicts: string[];
            /** Counts of all of it. */ summary: components["schemas"]["ChangeSummary"];
            walls?: components["schemas"]["WallsDifference"] | null;
            /** The landmarks that differ. */ landmarks: components["schemas"]["Page_LandmarkDifference"];
        };
        /** Two landmarks that look alike. */
        DuplicatePair: {
            /** The landmark whose name comes first. */ first: string;
            /** The other one. */ second: string;
            /** Gradient similarity of the two, at most 1. */ gradient_similarity: number;
            /** 1 minus that: what thresholds are compared with. */ distance: number;
            /** Whether the first one is matched. */ first_in_use: boolean;
            /** Whether the second one is matched. */ second_in_use: boolean;
        };
        /** A new certificate, with what a robot needs to connect. */
        EnrolledRobot: {
            /** The certificate, PEM. */ certificate_pem: string;
            /** Who has signed the server's certificate, PEM; null if that is a file of the operator's own. */
            authority_pem?: string | null;
            /** Where robots connect, as the server listens: its host may be `0.0.0.0`. */ zenoh: string;
            /** Names and addresses of the server's settings. */ names: string[];
            /** Name in every key. */ fleet: string;
            /** What was stored of it. */ certificate: components["schemas"]["RobotCertificate"];
        };
        /** A second epoch speaks under the name of a robot while the first is live. */
        EpochConflictBody: {
            /** The epoch that was refused last. */ epoch: number;
            /** Messages refused since the conflict began. */ refused: number;
            /** Milliseconds since the last of them. */ last_ms: number;
        };
        /** What a modality gets wrong: along, to the left, heading. */
        ErrorModelBody: {
            /** `odometry`, `laser` or `landmarks`. */ modality: components["schemas"]["ModalityBody"];
            /** Subtracted from what it says: metres, metres, radians; of odometry for each metre. */
            bias: components["schemas"]["Triple"];
            /** Added to each variance, as a share of what it claims. */
            variance_inflation: components["schemas"]["Triple"];
        };
        /** Where the object of a track seems to be, in the map. */
        EstimatedPlace: {
            /** Centre, x. */ x_m: number;
            /** Centre, y. */ y_m: number;
            /** Centre, above the floor. */ z_m: number;
            /** Direction of the outward normal on the floor. */ theta_rad: number;
            /** Width of the rectangle on the wall. */ width_m: number;
            /** Height of the rectangle on the wall. */ height_m: number;
            /** Views that agree on it. */ views: number;
            /** How far off the normal the camera looked: least and most. */ angle_rad: components["schemas"]["Pair"];
        };
        /** A kind of events that a reader can choose, for the document: [`ServerEventBody::KINDS`]. */
        EventKind: "map_changed" | "landmark_changed" | "landmarks_changed" | "job" | "presence" | "gathering" | "backup" | "tokens_changed";
        /** A landmark that got views. */
        ExtendedLandmark: {
            /** Name of the landmark. */ name: string;
            /** How many it got. */ views: number;
            /** Whether they place it. */ placing: components["schemas"]["PlacementReportBody"];
        };
        /** Why a landmark is not in use, or a track should not become one. A reason occurs once. */
        FailedGate: {
            /** Which gate, for programs. */ gate: components["schemas"]["GateBody"];
            /** What is wrong: one sentence for a person. */ sentence: string;
            /** What to do: one sentence for a person. */ advice: string;
            look_alike?: components["schemas"]["LookAlikeBody"] | null;
        };
        /** What was taken of a file. Nothing is stored. */
        FileWalls: {
            /** The walls, in the order of the file. */ segments: components["schemas"]["WallBody"][];
            /** Their length, m. */ length_m: number;
            /** What a person should know of how it was read. */ note?: string | null;
        };
        /** What robots found of a landmark that is not where the map says. Stored as JSON. */
        FindingBody: {
            /** Where it is observed. */ observed_place: components["schemas"]["ObservedPlaceBody"];
            /** Distance from its place. */ offset_m: number;
            /** Observations that agree on it. */ sightings: number;
            kind: "moved";
        } | {
            /** Consecutive frames without it. */ missed_frames: number;
            kind: "missing";
        };
        /** A number that a robot pose by landmarks rests on. */
        FixQuantity: "unspecified" | "size" | "camera_height" | "camera_tilt" | "mounting";
        /** What is fused where runs have told which modality is best. Odometry carries the pose in any case. */
        FusionModeBody: "all" | "near_best" | "best";
        /** A quality gate, or another reason why something is not in use. */
        GateBody: "views" | "saliency" | "stable_points" | "content" | "visibility_confidence" | "not_distinct" | "looks_like" | "by_pose_only" | "stored_model" | "similar_tracks" | "known_landmark";
        /** Views being gathered, or gathered. */
        Gathering: {
            /** Its number, counting up over all maps. */ id: number;
            /** The map. */ map: string;
            /** Who gathers. */ robot: string;
            /** The only landmark whose views are wanted. */ landmark?: string | null;
            /** Whether views of recognised landmarks are wanted. */ known: boolean;
            /** It goes on. */ open: boolean;
            /** What became of the frames. Of a gathering that was interrupted by a restart: since then. */
            counts: components["schemas"]["GatheringCountsBody"];
            /** ms since the Unix epoch. */ created_ms: number;
            /** ms since the Unix epoch. */ ended_ms?: number | null;
        };
        /** What became of a gathering. */ GatheringChange: "begun" | "ended" | "decided" | "deleted";
        /** What became of frames and quads. */
        GatheringCountsBody: {
            /** Frames offered. */ frames: number;
            /** Of these, dropped because others were still being followed. */ dropped: number;
            /** Frames on another map. */ other_map: number;
            /** Quads that were too small, cut off or blurred to have an icon. */ unusable: number;
            /** Quads that are not flat on a wall of the map. */ not_on_wall: number;
            /** Views kept. */ kept: number;
            /** Quads that repeat a stored view. */ near_duplicate: number;
            /** Quads not yet observed often enough. */ too_few_observations: number;
            /** Quads of tracks that have all the views they may have. */ full: number;
            /** Quads of tracks that were decided on. */ decided: number;
            /** Quads that show a landmark, or may. */ known_landmark: number;
            /** Quads that are no landmark, where only landmarks are wanted. */ not_requested: number;
            /** Quads at the place of a track that look different. */ appearance_mismatch: number;
            /** Quads beyond the number of tracks. */ track_limit: number;
            /** Views that were not stored because a bound was reached or the disk is full. */ not_stored: number;
        };
        /** A question where to look. */
        GazeQueryBody: {
            /** Where the robot is. */ pose: components["schemas"]["PoseBody"];
            /** `camera_m`, `pan_rad`, `tilt_rad`, `rate_radps`. */ head?: Record<string, never>;
            /** `focal_px`, `pan_rad`, `tilt_rad` and the rest of the camera; absent for the map's (`/maps/{map}/visibility-settings`). */
            viewer?: Record<string, never> | null;
            /** `product` (the paper's) or `information`. */ criterion?: string;
        };
        /** Where to look. */
        GazeRankingBody: {
            /** Of this version of the map. */ map_version: number;
            /** Best first; empty when nothing is in sight. */ ranked: components["schemas"]["GazeTargetBody"][];
        };
        /** A landmark worth looking at. */
        GazeTargetBody: {
            /** Name of the landmark. */ landmark: string;
            /** Pan that centres it, left positive. */ pan_rad: number;
            /** Tilt that centres it, up positive. */ tilt_rad: number;
            /** What it is ranked by; the criterion's number. */ utility: number;
            /** Probability that it is seen. */ probability: number;
            /** Distance to the boundary of its area, positive inside. */ margin_m: number;
            /** Expected gain of information on the pose. */ gain_nats: number;
            /** Distance of the camera from its centre. */ range_m: number;
            /** Angle between its normal and the line of sight. */ incidence_rad: number;
        };
        /** A Harris point of an exemplar with its descriptor. */
        HarrisPoint: {
            /** To the right, in icon pixels. */ x_px: number;
            /** Downwards, in icon pixels. */ y_px: number;
            /** Harris response, grey levels to the fourth. */ response: number;
            /** The seven components of the 7-jet, whitened: differences are in standard deviations. */ jet: number[];
        };
        /** Harris points of an exemplar. */
        HarrisSet: {
            /** Which exemplar, from 1. */ exemplar: number;
            /** At most 60, by falling response. */ points: components["schemas"]["HarrisPoint"][];
        };
        /** The process lives. */
        Health: {
            /** `ok`. */ status: string;
        };
        /** A place where the robot may be. */
        Hypothesis: {
            /** Its share of the belief, 0 to 1. */ probability: number;
            map_from_robot: components["schemas"]["Pose2Covariance"] | null;
        };
        /** A Harris point of the mean icon. */
        IconKeypoint: {
            /** To the right, in icon pixels. */ x_px: number;
            /** Downwards, in icon pixels. */ y_px: number;
        };
        Intrinsics: {
            fx_px: number;
            fy_px: number;
            cx_px: number;
            cy_px: number;
            /** The lens: none for a rectified image, else one of these three, in the order of ROS and OpenCV. k1, k2, p1, p2, k3. */
            plumb_bob: number[];
            /** k1, k2, p1, p2, k3, k4, k5, k6; k4 to k6 are of the denominator. */ rational_polynomial: number[];
            /** OpenCV's fisheye: k1, k2, k3, k4 of the angle from the axis. */ equidistant: number[];
            /** How surely the camera is known: standard deviations in pixels, 0 to a quarter of fx_px, such as a calibration gives. What the camera has wrong is in every pose's covariance, and never averages out. Absent: 0.005 of fx_px. */
            focal_sigma_px: number | null;
            /** Of each coordinate of the principal point. Absent: 0.003 of fx_px. */ center_sigma_px: number | null;
            /** Width and height of the pictures that the camera was calibrated with: both, or neither. An image of another scale has the intrinsics scaled; one of other proportions is refused (size_mismatch). */
            width_px: number | null;
            height_px: number | null;
        };
        /** What is known of a camera's intrinsics from its use. */
        IntrinsicsMonitorBody: {
            /** Frames counted. */ tries: number;
            /** Of them, refused because no robot on the floor sees the corners there. */ refused: number;
            /** Different landmarks in them. */ landmarks: number;
            /** Mean chi2 a degree of freedom of the fixes; about 1 where all is well. */ reduced_chi2?: number | null;
            /** True over stated focal length, less 1, by the residuals. */ focal_error?: number | null;
            /** Standard deviation of `focal_error`. */ focal_sigma?: number | null;
            suspicion?: components["schemas"]["IntrinsicsSuspicionBody"] | null;
        };
        /** Why the intrinsics of a camera seem wrong. */
        IntrinsicsSuspicionBody: {
            /** True over stated, less 1. */ error: number;
            /** Standard deviation of `error`. */ sigma: number;
            reason: "focal";
        } | {
            /** About 1 where all is well. */ reduced_chi2: number;
            reason: "misfit";
        } | {
            /** Share of the frames, 0 to 1. */ share: number;
            reason: "refused";
        };
        /** Long work. */
        Job: {
            /** Its number, counting up over all maps. */ id: number;
            /** `learn`. */ kind: string;
            /** The map it works on. */ map: string;
            /** Where it stands. */ state: components["schemas"]["JobState"];
            /** 0 to 1. */ progress: number;
            /** What it does, or why it failed. */ message: string;
            /** What came of it. */ result?: unknown;
            /** Name of the token that asked for it; `server` for what the server does by itself. */ by?: string;
            /** When it was asked for, ms since the Unix epoch. */ created_ms?: number;
            /** When it was begun last; absent while it waits. */ started_ms?: number | null;
            /** When it ended. */ ended_ms?: number | null;
        };
        /** Where a job stands. */ JobState: "queued" | "running" | "done" | "failed" | "cancelled";
        /** A landmark. */
        Landmark: {
            /** `[a-z0-9_-]{1,64}`, unique in the map. */ name: string;
            /** Another one after every edit of name, size, place, views or, by a person, health, and after every lesson of its model; the same after what robots do by themselves. `If-Match` takes it, in quotes. */
            revision?: string;
            /** How far it has come. */ status: components["schemas"]["LandmarkStatus"];
            /** Why it is not matched; empty unless it is inactive. */
            failed_gates: components["schemas"]["FailedGate"][];
            /** Gates that it does not pass and that do not keep it from being matched. */
            waived_gates: components["schemas"]["FailedGate"][];
            learning?: components["schemas"]["LearningSettings"] | null;
            /** Real views stored. */ views: number;
            size?: components["schemas"]["Size"] | null;
            place?: components["schemas"]["Place"] | null;
            place_sigma?: components["schemas"]["PlaceSigma"] | null;
            model?: components["schemas"]["LandmarkModelBody"] | null;
            /** How far what robots saw lets it be trusted. */ health: components["schemas"]["LandmarkHealthBody"];
            finding?: components["schemas"]["FindingBody"] | null;
        };
        /** What became of a landmark. */ LandmarkChange: "added" | "changed" | "removed";
        /** A landmark to be deleted. */
        LandmarkDeletion: {
            /** Its name. */ name: string;
            /** The revision that is meant; absent for whatever is there. */ revision?: string | null;
        };
        /** Landmarks to be deleted together: all, or none. */
        LandmarkDeletions: {
            /** 1 to 2000. */ landmarks: components["schemas"]["LandmarkDeletion"][];
        };
        /** How a landmark differs. */
        LandmarkDifference: {
            /** Its name after the change, or before it if it is gone. */ name: string;
            /** Its name before, where that was another one. */ old_name?: string | null;
            /** Whether it is new, gone, or differs. */ change: components["schemas"]["ChangeKind"];
            /** Of one that stays: name, size, place, learning. */ fields: string[];
            before?: components["schemas"]["SizeAndPlace"] | null;
            after?: components["schemas"]["SizeAndPlace"] | null;
            /** Training views that are new. */ views_added: number;
            /** Training views that are gone. */ views_removed: number;
            /** Its model differs, if only by a threshold. */ model_changed: boolean;
        };
        /** How far a landmark's own views and everything else are from its model. */
        LandmarkDistances: {
            /** The landmark. */ landmark: string;
            /** The correlation distance, 0 to 2. */ correlation: components["schemas"]["DistanceHistogram"];
            /** The Hausdorff distance. */ hausdorff: components["schemas"]["DistanceHistogram"];
            /** 1 minus the gradient similarity. */ gradient_dissimilarity: components["schemas"]["DistanceHistogram"];
        };
        /** How strongly the points of quads spoke for a landmark in the stored answers: heaps by the negative decimal logarithm of the number of false alarms. */
        LandmarkEvidence: {
            /** The landmark. */ landmark: string;
            /** Stored answers that were read: the newest that name it or were compared with it, at most 500. */
            answers: number;
            /** Accepted from here upwards. */ threshold: number;
            /** Width of a bin; the first begins at 0. The last has everything beyond, too. */ bin_width: number;
            /** Quads that were named as it, by bin. */ named: number[];
            /** Quads with its points while a part of it showed something else, by bin. */ doubtful: number[];
            /** Quads named as it without points, by the picture as a whole. */ named_without_points: number;
        };
        /** How far a landmark is trusted. */ LandmarkHealthBody: "sound" | "flagged" | "quarantined";
        /** A landmark beside a quad that was compared with it. */
        LandmarkIcon: {
            /** Its name at that time. */ landmark: string;
            /** Path of its icon as it was learnt; absent if there is no landmark with a model of this name any more. */
            icon?: string | null;
        };
        /** How to learn one landmark. */
        LandmarkLesson: {
            /** Views generated from each photograph, 0 to 100; absent fills up where photographs are few. */
            generated_views?: number | null;
        };
        /** Another landmark that is the same object. */
        LandmarkMerge: {
            /** Its name. It is deleted. */ from: string;
        };
        /** What was learnt of a landmark, in brief. */
        LandmarkModelBody: {
            /** Real views it rests on. */ views: number;
            /** Views generated from the real ones. */ generated_views: number;
            /** ms since the Unix epoch. */ learnt_ms: number;
        } & {
            [key: string]: unknown;
        };
        /** What was learnt of a landmark. */
        LandmarkModelDetail: {
            /** Its landmark. */ landmark: string;
            /** SHA-256 of the stored bytes, hexadecimal: the same digest is the same model. */ sha256: string;
            /** Whether it is matched. */ in_use: boolean;
            /** Whether its points identify the landmark, and its icons never. */ named_by_points: boolean;
            /** Views that it was learnt from, generated ones included. */ views: number;
            /** How many of them were generated. */ generated_views: number;
            /** Learnt icons: the mean, and up to two modes. */ exemplars: number;
            /** Side of an icon, in icon pixels. */ icon_px: number;
            /** Harris points of the mean icon. */ keypoints: components["schemas"]["IconKeypoint"][];
            /** Points of up to three photographs, at most 240. */ points: components["schemas"]["LandmarkPoint"][];
            /** Bits of the descriptor of one point. */ bits_per_point: number;
            /** Share of the variance of the views that the leading modes explain, 0 to 1 each, falling. */
            mode_shares: number[];
            /** Harris points of each exemplar with their descriptors, where they are asked for. */
            harris?: components["schemas"]["HarrisSet"][];
            /** Threshold of the correlation distance, 0 to 2. */ correlation: components["schemas"]["ThresholdBody"];
            /** Threshold of the Hausdorff distance. */ hausdorff: components["schemas"]["ThresholdBody"];
            /** What these two weigh. */ weights: components["schemas"]["ThresholdWeights"];
            /** Threshold of 1 minus the gradient similarity: its cap, or a share of the nearest negative. */
            gradient_dissimilarity: components["schemas"]["ThresholdBody"];
            /** Saliency, 0 to 1. */ saliency: number;
            /** Keypoints of the mean icon that are found in the other views, too. */ stable_points: number;
            /** Spread of the viewpoints of all views, generated ones included, 0 to 10. No gate takes it. */
            visibility_confidence: number;
            /** The same of photographed views only; 0 with fewer than two. The gate and the choice of gaze take this one. */
            photographed_visibility_confidence: number;
            /** Memory in use. */ memory: components["schemas"]["MemoryPart"][];
        };
        /** What changes of a landmark. A field that is absent stays, one that is null is forgotten. */
        LandmarkPatch: {
            /** Another name, `[a-z0-9_-]{1,64}`, unique in the map. Everything that belongs to the landmark stays with it. */
            name?: string | null;
            size?: components["schemas"]["Size"] | null;
            place?: components["schemas"]["Place"] | null;
            learning?: components["schemas"]["LearningSettings"] | null;
            health?: components["schemas"]["LandmarkHealthBody"] | null;
        };
        /** A point of the landmark's photographs. */
        LandmarkPoint: {
            /** To the right, 0 to 1 over the landmark's width. */ x: number;
            /** Downwards, 0 to 1 over the landmark's height. */ y: number;
            /** Scale, in shares of the landmark's side. */ sigma: number;
        };
        LandmarkPose: {
            camera_from_landmark: components["schemas"]["Pose3"] | null;
            /** Over (rotation vector, translation), left perturbation, camera frame; 36 numbers. */
            covariance: number[];
            reprojection_rms_px: number;
        };
        /** How far a landmark has come. */ LandmarkStatus: "not_learnt" | "learning" | "active" | "inactive";
        /** Weights and gates of a map or of one landmark, where a person wants others than the server has. What is absent of a landmark is as the map has it, and of a map as the server has it. */
        LearningSettings: {
            /** Why: one line of 1 to 200 characters. The history of the map has it, too. */ reason: string;
            /** Cost of a wrong acceptance, 0.1 to 1000, where a refused own view costs 1 (lambda : mu). */
            false_positive_weight?: number | null;
            /** Fewest views, 1 to 200. */ min_views?: number | null;
            /** Least saliency F, 0 to 1000. */ min_saliency_f?: number | null;
            /** Fewest stable points, 0 to 60. */ min_stable_points?: number | null;
            /** Least visibility confidence of its photographs, 0 to 10. */ min_visibility_confidence?: number | null;
            /** Whether a smaller visibility confidence keeps it out of use. */ refuse_one_side?: boolean | null;
            /** It is used whatever its measured gates say. Without a threshold it is still not. */
            use_despite_gates?: boolean | null;
        };
        /** An object of a drive that is no landmark. */
        LeftOutBody: {
            /** Its centre in the map, metres. */ x_m: number;
            /** Metres. */ y_m: number;
            /** Over the floor, metres. */ z_m: number;
            /** Metres. */ width_m: number;
            /** Metres. */ height_m: number;
            /** Number of its views. */ views: number;
            /** Why it is none. */ reason: string;
        };
        /** The order of a list: by name, or by the time of the last edit or lesson; `-` reverses it. */
        ListOrder: "name" | "-name" | "changed" | "-changed";
        /** The answer to a frame. */
        LiveAnswer: {
            /** Name of the robot. */ robot: string;
            /** Name of its camera. */ camera: string;
            /** What was answered, the map's name included. */ answer: components["schemas"]["Answer"];
        };
        /** The data of an event of a map's stream, for the document: the name of the event says which of these it is. `odometry` and `truth` are positions; `missed` is the number of events that a slow reader has missed. */
        LiveEventData: components["schemas"]["LiveAnswer"] | components["schemas"]["LivePose"] | components["schemas"]["LivePosition"] | components["schemas"]["LivePresence"] | components["schemas"]["MapChangeBody"] | number;
        /** A fused pose, as it was published. */
        LivePose: {
            /** Name of the robot. */ robot: string;
            /** The map it is a pose in. */ map: string;
            /** Where the robot is. */ pose: components["schemas"]["Pose2"];
            /** Over (x, y, theta), row-major. */ covariance: number[];
            /** Corrections by landmarks so far. */ corrections: number;
            /** From the capture of what supports it to its publication. */ age_ms: number;
            /** How far it is trusted. */ trust: components["schemas"]["PoseTrust"];
        };
        /** A pose without covariance. */
        LivePosition: {
            /** Name of the robot. */ robot: string;
            /** The map it is a pose in. */ map: string;
            /** Where the robot is. */ pose: components["schemas"]["Pose2"];
        };
        /** A robot came or went. */
        LivePresence: {
            /** Name of the robot. */ robot: string;
            /** Its map, if it has one; else empty. */ map: string;
            /** Came, or went. */ alive: boolean;
        };
        /** Where the robot may be. */
        LocaliseHypothesisBody: {
            /** The pose with its covariance. */ map_from_robot: components["schemas"]["Pose2Covariance"];
            /** All hypotheses sum to 1. */ probability: number;
            /** The landmarks that it rests on. */ landmarks: string[];
            /** Share of the scan's points with a wall, 0 to 1; null where the scan was not used. */
            matched?: number | null;
        };
        /** Where a robot is, without its history. */
        LocaliseResult: {
            /** The map. */ map: string;
            /** Its version. */ map_version: number;
            /** What came of it. */ status: components["schemas"]["LocaliseStatus"];
            /** Why there is not exactly one pose: `nothing_recognised`, a code of `pose_refusal` of an answer, `ambiguous`, `undetermined` (the walls leave a direction open), `few_points`, `poor_match`, `map_too_large`, `stopped`. */
            reason?: string | null;
            map_from_robot?: components["schemas"]["Pose2Covariance"] | null;
            /** Where the robot may be, most probable first, at most 16. */
            hypotheses: components["schemas"]["LocaliseHypothesisBody"][];
            answer?: components["schemas"]["Answer"] | null;
        };
        /** What came of a localisation. */ LocaliseStatus: "located" | "ambiguous" | "no_match";
        /** A landmark that looks like another one. */
        LookAlikeBody: {
            /** Name of the other landmark. */ landmark: string;
            /** Gradient similarity of the two, at most 1. */ gradient_similarity: number;
        };
        /** A map. */
        Map: {
            /** `[a-z0-9_-]{1,64}`, unique. */ name: string;
            /** Counts up with every change that an answer could depend on. */ version: number;
            /** Another one after every edit or lesson of the map or of what is in it, the same after what robots do by themselves: `If-Match` takes it, in quotes. */
            revision?: string;
            /** Landmarks in it, learnt or not. */ landmarks: number;
            /** A picture is shown under it: `GET /maps/{map}/underlay`. */ has_underlay?: boolean;
            preset?: components["schemas"]["PipelinePreset"] | null;
            /** Which distance decides. */ distance: components["schemas"]["Distance"];
            learning?: components["schemas"]["LearningSettings"] | null;
            /** The map that it is a draft of. */ draft_of?: string | null;
            /** The site it belongs to, in words. */ site?: string | null;
            /** The building it belongs to, in words. */ building?: string | null;
            /** The floor it belongs to, in words. */ floor?: string | null;
            parent?: components["schemas"]["Parent"] | null;
        };
        /** A map has a new version, or is gone. */
        MapChangeBody: {
            /** Name of the map. */ map: string;
            /** New version; absent when deleted. */ version?: number | null;
        };
        /** What to learn of a map, and how. */
        MapLesson: {
            /** Names; absent means every landmark that has views. */ landmarks?: string[] | null;
            /** Views generated from each photograph, 0 to 100; absent fills up where photographs are few. */
            generated_views?: number | null;
        };
        /** What changes of a map. A field that is absent stays, one that is null is forgotten. */
        MapPatch: {
            /** Another name. Refused while a robot, an open job or an open gathering has the present one. */
            name?: string | null;
            preset?: components["schemas"]["PipelinePreset"] | null;
            distance?: components["schemas"]["Distance"] | null;
            learning?: components["schemas"]["LearningSettings"] | null;
            /** The site it belongs to, in words: 1 to 64 characters. */ site?: string | null;
            /** The building it belongs to, in words: 1 to 64 characters. */ building?: string | null;
            /** The floor it belongs to, in words: 1 to 64 characters. */ floor?: string | null;
            parent?: components["schemas"]["Parent"] | null;
        };
        /** A mapping as it stands. */
        MappingProgressBody: {
            /** Name of the map. */ map: string;
            /** Whose scans. */ robot: string;
            /** How far it has come. */ stage: components["schemas"]["MappingStageBody"];
            /** Scans that were taken. */ scans: number;
            /** Scans that were not: the queue was full, the robot's software was started again, or there were too many. */
            dropped: number;
            /** Frames that were taken; absent where no landmarks are looked for. */ frames?: number | null;
            /** What of the frames cannot be used: how often, and why. */ frames_refused?: string | null;
            /** Number of landmarks that are proposed, once they are found. */ landmarks?: number | null;
            /** What hangs there and is no landmark, and why: the 64 with the most views. */
            left_out?: components["schemas"]["LeftOutBody"][];
            /** The gathering whose tracks these are, once the walls are stored. */ gathering?: number | null;
            /** Way driven, metres. */ distance_m: number;
            pose?: components["schemas"]["Triple"] | null;
            /** Number of walls, once they are found. */ segments?: number | null;
            /** Loop closures, once fitted. */ loop_closures?: number | null;
            /** Why it failed, or why a finished one proposes no landmarks. */ reason?: string | null;
            /** Why further scans are not kept on disk: a restart of the server would lose them. Absent while they are. */
            journal_error?: string | null;
            /** The walls that are held: what would replace those of the map. Absent at every other stage. */
            walls?: components["schemas"]["WallBody"][] | null;
        };
        /** How far a mapping has come. */
        MappingStageBody: "resuming" | "mapping" | "finishing" | "found" | "done" | "failed";
        /** Memory of a model for one purpose. */
        MemoryPart: {
            /** What it holds. */ purpose: string;
            /** Bytes. */ bytes: number;
        };
        /** Why the first hypothesis is not yet the pose. */
        MissingConditionBody: "higher_probability" | "second_landmark" | "consistent_observations" | "no_rival_pose";
        /** What estimates poses by itself. */ ModalityBody: "odometry" | "laser" | "landmarks";
        /** All that is known of a map's modalities. */
        ModalityMapBody: {
            /** What is fused. */ fusion_mode: components["schemas"]["FusionModeBody"];
            /** Areas with a name. */ areas: components["schemas"]["NamedAreaBody"][];
            /** Side of the cells. */ cell_m: number;
            /** Cells that were driven through; see `modalities/at` for what was found in one. */
            cells: components["schemas"]["CellBody"][];
            /** Cells that this answer has no room for. */ omitted_cells: number;
            /** All of the map. */ map: components["schemas"]["AreaStatsBody"];
        };
        /** What changes; a field that is absent stays. */
        ModalityMapPatch: {
            fusion_mode?: components["schemas"]["FusionModeBody"] | null;
            /** All named areas, at most 64; where they overlap the first one counts. */
            areas?: components["schemas"]["AreaBody"][] | null;
        };
        /** What runs have shown of one modality: odometry alone, or the laser or landmarks each with odometry only. Errors are robot-aligned: metres along, metres to the left, radians. */
        ModalityStatsBody: {
            /** `odometry`, `laser` or `landmarks`. */ modality: components["schemas"]["ModalityBody"];
            /** Mean error of its own position. */ mean: components["schemas"]["Triple"];
            /** Standard deviations about that. */ sigma: components["schemas"]["Triple"];
            /** Share of the way on which it knew something lately. */ availability: number;
            /** Measurements a second. */ rate_hz: number;
            /** Share of them off by more than three of the standard deviations that they claim. */ outliers: number;
            /** Mean squared error over availability, 0.1 rad as much as a metre; absent if it never knew anything. The lowest is best. */
            score?: number | null;
            /** Steps of 5 cm that were compared. */ steps: number;
            /** Measurements that were compared. */ measurements: number;
        };
        /** A stored picture of a model. */
        ModelPicture: "exemplar1" | "exemplar2" | "exemplar3" | "mean" | "mode1" | "mode2";
        /** A GeoJSON `MultiPolygon`: polygons of rings of points, m in the map; the outer ring counter-clockwise, that of a hole clockwise, the first point repeated. */
        MultiPolygon: {
            /** `MultiPolygon`. */ type: string;
            /** By polygon, ring and point: x, y in metres. */ coordinates: components["schemas"]["Pair"][][][];
        };
        /** A named area and what is known of it. */
        NamedAreaBody: {
            /** Unique, 1 to 64 bytes. */ name: string;
            /** Its corners in order, x and y in metres. */ corners_m: components["schemas"]["Pair"][];
            /** By heading: 0, pi/2, pi, -pi/2. */ headings: components["schemas"]["AreaStatsBody"][];
        };
        /** A copy of a map to be. */
        NewCopy: {
            /** Its name: `[a-z0-9_-]{1,64}`, unique. */ name: string;
        };
        /** A draft to be. */
        NewDraft: {
            /** Its name: `[a-z0-9_-]{1,64}`, unique among maps and drafts. */ name: string;
        };
        /** Who gathers what. */
        NewGatheringBody: {
            /** A robot that stands on this map. */ robot: string;
            /** Only views of this landmark, which must be learnt already; absent: of whatever flat four-sided thing is none yet. */
            landmark?: string | null;
            /** Views of every landmark that is recognised beyond doubt, too. */ known?: boolean;
        };
        /** A landmark to be. */
        NewLandmark: {
            /** `[a-z0-9_-]{1,64}`, unique in the map. */ name: string;
            size?: components["schemas"]["Size"] | null;
            place?: components["schemas"]["Place"] | null;
        };
        /** Landmarks to be made together: all, or none. */
        NewLandmarks: {
            /** 1 to 2000. */ landmarks: components["schemas"]["NewLandmark"][];
        };
        /** A map to be. */
        NewMap: {
            /** `[a-z0-9_-]{1,64}`, unique. */ name: string;
            preset?: components["schemas"]["PipelinePreset"] | null;
            distance?: components["schemas"]["Distance"] | null;
            /** The site it belongs to, in words: 1 to 64 characters. */ site?: string | null;
            /** The building it belongs to, in words: 1 to 64 characters. */ building?: string | null;
            /** The floor it belongs to, in words: 1 to 64 characters. */ floor?: string | null;
            parent?: components["schemas"]["Parent"] | null;
        };
        /** Who makes the map. */
        NewMapping: {
            /** A robot that stands on this map; its scans must come with odometry. */ robot: string;
            origin?: components["schemas"]["Triple"] | null;
            /** Look for landmarks, too: its frames, with intrinsics and mounting, are kept until the end, and objects on walls become tracks of a gathering. */
            landmarks?: boolean;
        };
        /** A token to be made. */
        NewToken: {
            /** Who or what it is for, `[a-z0-9_-]{1,64}`; several may have the same. */ name: string;
            /** What it may do. */ role: components["schemas"]["Role"];
            /** Maps that it is for; absent for all maps and what is above maps. */ maps?: string[] | null;
            /** Seconds until it expires, by the server's clock, at most ten years; absent for never. */
            valid_s?: number | null;
        };
        /** A landmark to look for, and the pose from which the camera turns to it. */
        NextLandmarkBody: {
            /** Name of the landmark. */ landmark: string;
            /** How far along the leg the robot is. */ along_m: number;
            /** The robot there, metres, in the map. */ x_m: number;
            /** The robot there. */ y_m: number;
            /** Its heading along the leg. */ theta_rad: number;
            /** Turn of the camera from the heading, left positive. */ pan_rad: number;
            /** Tilt of the camera, up positive. */ tilt_rad: number;
            /** Distance on the floor. */ range_m: number;
        };
        /** The order of a list by number; `-` reverses it. */ NumberOrder: "number" | "-number";
        /** Where a landmark is observed, in the map. */
        ObservedPlaceBody: {
            /** Centre, x. */ x_m: number;
            /** Centre, y. */ y_m: number;
            /** Direction of the outward normal on the floor. */ theta_rad: number;
        };
        /** A link that opens the page once, with the rights of the one who asked for it. */
        PageLink: {
            /** Path and query, to be put after the server's address: `/open?code=...`. */ path: string;
            /** Seconds for which it is valid. */ valid_s: number;
        };
        /** A page of a list. */
        Page_AuditEntry: {
            /** The items, in order. */ items: components["schemas"]["AuditEntry"][];
            /** Give this as `cursor` for the next page; null on the last. */ next?: string | null;
            /** Items of all pages together. */ total?: number;
        };
        /** A page of a list. */
        Page_Backup: {
            /** The items, in order. */ items: components["schemas"]["Backup"][];
            /** Give this as `cursor` for the next page; null on the last. */ next?: string | null;
            /** Items of all pages together. */ total?: number;
        };
        /** A page of a list. */
        Page_Commit: {
            /** The items, in order. */ items: components["schemas"]["Commit"][];
            /** Give this as `cursor` for the next page; null on the last. */ next?: string | null;
            /** Items of all pages together. */ total?: number;
        };
        /** A page of a list. */
        Page_Draft: {
            /** The items, in order. */ items: components["schemas"]["Draft"][];
            /** Give this as `cursor` for the next page; null on the last. */ next?: string | null;
            /** Items of all pages together. */ total?: number;
        };
        /** A page of a list. */
        Page_DuplicatePair: {
            /** The items, in order. */ items: components["schemas"]["DuplicatePair"][];
            /** Give this as `cursor` for the next page; null on the last. */ next?: string | null;
            /** Items of all pages together. */ total?: number;
        };
        /** A page of a list. */
        Page_Gathering: {
            /** The items, in order. */ items: components["schemas"]["Gathering"][];
            /** Give this as `cursor` for the next page; null on the last. */ next?: string | null;
            /** Items of all pages together. */ total?: number;
        };
        /** A page of a list. */
        Page_Job: {
            /** The items, in order. */ items: components["schemas"]["Job"][];
            /** Give this as `cursor` for the next page; null on the last. */ next?: string | null;
            /** Items of all pages together. */ total?: number;
        };
        /** A page of a list. */
        Page_Landmark: {
            /** The items, in order. */ items: components["schemas"]["Landmark"][];
            /** Give this as `cursor` for the next page; null on the last. */ next?: string | null;
            /** Items of all pages together. */ total?: number;
        };
        /** A page of a list. */
        Page_LandmarkDifference: {
            /** The items, in order. */ items: components["schemas"]["LandmarkDifference"][];
            /** Give this as `cursor` for the next page; null on the last. */ next?: string | null;
            /** Items of all pages together. */ total?: number;
        };
        /** A page of a list. */
        Page_Map: {
            /** The items, in order. */ items: components["schemas"]["Map"][];
            /** Give this as `cursor` for the next page; null on the last. */ next?: string | null;
            /** Items of all pages together. */ total?: number;
        };
        /** A page of a list. */
        Page_RefusedView: {
            /** The items, in order. */ items: components["schemas"]["RefusedView"][];
            /** Give this as `cursor` for the next page; null on the last. */ next?: string | null;
            /** Items of all pages together. */ total?: number;
        };
        /** A page of a list. */
        Page_Robot: {
            /** The items, in order. */ items: components["schemas"]["Robot"][];
            /** Give this as `cursor` for the next page; null on the last. */ next?: string | null;
            /** Items of all pages together. */ total?: number;
        };
        /** A page of a list. */
        Page_RobotCertificate: {
            /** The items, in order. */ items: components["schemas"]["RobotCertificate"][];
            /** Give this as `cursor` for the next page; null on the last. */ next?: string | null;
            /** Items of all pages together. */ total?: number;
        };
        /** A page of a list. */
        Page_StoredAnswerSummary: {
            /** The items, in order. */ items: components["schemas"]["StoredAnswerSummary"][];
            /** Give this as `cursor` for the next page; null on the last. */ next?: string | null;
            /** Items of all pages together. */ total?: number;
        };
        /** A page of a list. */
        Page_Token: {
            /** The items, in order. */ items: components["schemas"]["Token"][];
            /** Give this as `cursor` for the next page; null on the last. */ next?: string | null;
            /** Items of all pages together. */ total?: number;
        };
        /** A page of a list. */
        Page_TrainingView: {
            /** The items, in order. */ items: components["schemas"]["TrainingView"][];
            /** Give this as `cursor` for the next page; null on the last. */ next?: string | null;
            /** Items of all pages together. */ total?: number;
        };
        /** Two numbers: x and y in metres, or columns and rows in pixels. */
        Pair: [
            number,
            number
        ];
        /** Where a map lies in another. */
        Parent: {
            /** The map in whose frame it lies. */ map: string;
            /** Its origin there, x. */ x_m: number;
            /** Its origin there, y. */ y_m: number;
            /** Direction of its x axis there. */ theta_rad: number;
            /** Its floor above that one's, within 1000 m. */ level_m?: number;
            covariance?: components["schemas"]["Covariance"] | null;
        };
        /** What a part of a landmark says. */ PartAgreement: "unspecified" | "silent" | "agrees" | "disagrees";
        /** An end of a passage. */
        PassageEnd: {
            /** The place there, `hall/3`. */ place: string;
            /** The middle of the passage, metres, in the map of the place. */ x_m: number;
            /** Of the middle. */ y_m: number;
        };
        /** A whole pipeline by its name. */ PipelinePreset: "default" | "paper";
        /** Where a landmark is, in the map. */
        Place: {
            /** Centre, x. */ x_m: number;
            /** Centre, y. */ y_m: number;
            /** Centre, above the floor. */ z_m: number;
            /** Direction of the outward normal on the floor, counter-clockwise from map x; under a ceiling, where the top points. */
            theta_rad: number;
            /** Turn about the outward normal, within 0.5; 0 when the sides are vertical. */ roll_rad?: number;
            /** Turn of the outward normal from level downwards: 0 on a wall, pi/2 under a ceiling. */
            tilt_rad?: number;
        };
        /** A landmark seen from a place. */
        PlaceLandmark: {
            /** Name of the landmark. */ landmark: string;
            /** Share of the place from which it is seen, above 0 to 1. */ share: number;
        };
        /** Standard deviations of a place that the server found from views. */
        PlaceSigma: {
            /** Of the centre, x. */ x_m: number;
            /** Of the centre, y. */ y_m: number;
            /** Of the centre, above the floor. */ z_m: number;
            /** Of the direction. */ theta_rad: number;
            /** Of the width. */ width_m: number;
            /** Of the height. */ height_m: number;
        };
        /** What came of placing a landmark by its views. */
        PlacementReportBody: {
            /** The landmark has a place by its views now. */ placed: boolean;
            /** Views with a robot pose that the place rests on. */ views_used: number;
            /** Why not: `by_hand` (a place by hand stays), or what is wrong with the views, with the residual. */
            reason?: string | null;
        };
        Point: {
            u_px: number;
            v_px: number;
        };
        /** What matched points say of the first candidate. */
        PointEvidence: {
            /** Tentative matches at different places, and how many of them agree on one homography. */ matches: number;
            inliers: number;
            /** Further points of the landmark that the image shows, at different places, and how many of them look as taught. */
            checked: number;
            agreeing: number;
            /** log10 of the number of such agreements by a model of chance: independent points, the whole map compared. Accepted from -5 downwards. It orders evidence and is no rate of wrong names: real pictures have more in common than chance gives. */
            log10_chance: number;
            /** 25 values: the landmark divided into 5 by 5 equal parts, as it was taught, upright. Rows from its top, in each row from its left: value 5 * row + column. */
            agreement: components["schemas"]["PartAgreement"][];
        };
        /** A point of a quad that is like a point of a landmark. */
        PointMatch: {
            /** Place in the quad's icon: (0, 0) is its top-left corner, (1, 1) its bottom-right one; a little outside is possible. */
            seen: components["schemas"]["Pair"];
            /** Place in the landmark's icon, likewise. */ taught: components["schemas"]["Pair"];
            /** Whether it agrees with the others on where the landmark is. */ agrees: boolean;
        };
        /** Pose on the floor. */
        Pose2: {
            x_m: number;
            y_m: number;
            theta_rad: number;
        };
        /** Pose on the floor with covariance over (x, y, theta), 9 numbers. */
        Pose2Covariance: {
            pose: components["schemas"]["Pose2"] | null;
            covariance: number[];
        };
        /** Rigid transform: unit quaternion and translation. */
        Pose3: {
            qx: number;
            qy: number;
            qz: number;
            qw: number;
            x_m: number;
            y_m: number;
            z_m: number;
        };
        /** A pose in the map. */
        PoseBody: {
            /** Metres, in the map. */ x_m: number;
            /** Metres, in the map. */ y_m: number;
            /** Heading in the map. */ theta_rad: number;
            covariance?: components["schemas"]["Covariance"] | null;
        };
        /** Where a person says that a robot is. */
        PoseByHand: {
            /** Metres, in the robot's map. */ x_m: number;
            /** Metres, in the robot's map. */ y_m: number;
            /** Heading in the map, -2 pi to 2 pi. */ theta_rad: number;
            /** Standard deviation of each coordinate; 0.5 by default, 0.01 to 10. */ sigma_m?: number;
            /** Standard deviation of the heading; 0.35 by default, 0.01 to 3.15. */ sigma_rad?: number;
        };
        /** A place where a robot may be. */
        PoseHypothesisBody: {
            /** Its share of the belief, 0 to 1; all of them together leave some for everywhere else. */
            probability: number;
            /** Metres, in the map. */ x_m: number;
            /** Metres, in the map. */ y_m: number;
            /** Heading in the map. */ theta_rad: number;
            /** Over (x, y, theta), row-major. */ covariance: components["schemas"]["Covariance"];
        };
        /** A number that makes recognised landmarks fit a pose if it alone is changed. */
        PoseRefusalCause: {
            quantity: components["schemas"]["FixQuantity"];
            /** Of SIZE: the landmark. */ landmark: string;
            /** The value that was stated, and the one that fits the image, with its standard deviation. Of MOUNTING: about the largest error that is accepted, and the error of the best pose. */
            expected: number;
            measured: number;
            sigma: number;
            /** m, rad or px. */ unit: string;
        };
        /** By how much recognised landmarks fit no pose of an upright robot, and why. */
        PoseRefusalDetail: {
            /** Weighted squared re-projection error of the best pose, and the largest that is accepted. */
            chi2: number;
            limit: number;
            /** The likeliest first. Those that the frame cannot tell apart are all there: a landmark of another size at another distance looks the same at another height, unless other landmarks or a known pose decide. */
            causes: components["schemas"]["PoseRefusalCause"][];
            /** The same for a person. */ sentence: string;
        };
        /** How far a fused pose is trusted, by the landmarks that were named without it (globally). Those that were named by it (guided) say nothing of it. */
        PoseTrust: "unspecified" | "unsupported" | "supported" | "stale" | "contradicted";
        /** The pose of the robot that was known without a picture, and the pose by the picture alone. */
        PriorCheck: {
            /** Whose pose it is. */ source: components["schemas"]["PriorSource"];
            /** The pose without the picture, map frame, with covariance. */
            prior: components["schemas"]["Pose2Covariance"];
            seen?: components["schemas"]["Pose2Covariance"] | null;
            /** Squared Mahalanobis distance of the two, under the sum of their covariances. */
            distance2?: number | null;
            /** The largest distance that a robot's prior lets pass. */ limit: number;
            /** The pose was refused for it: `refusal` is `gate_prior`. */ refused: boolean;
        };
        /** Whose pose a picture was compared with. */ PriorSource: "robot" | "server";
        /** An error as sent. */
        Problem: {
            /** `/problems/{code}`. */ type: string;
            /** The status in words. */ title: string;
            /** The HTTP status. */ status: number;
            /** Stable name of the error, for programs. */ code: string;
            /** The input at fault: a path into the JSON body, a part of the form, a parameter. */
            field?: string | null;
            /** A sentence for a person. */ detail: string;
        } & {
            [key: string]: unknown;
        };
        QuadAnswer: {
            /** As detected; for a unique landmark its own top-left comes first. */
            corners: components["schemas"]["Point"][];
            kind: components["schemas"]["QuadKind"];
            score: number;
            verdict: components["schemas"]["Verdict"];
            /** Set only for UNIQUE; what a known pose adds is `guided_landmark`. */ landmark: string;
            candidates: components["schemas"]["Candidate"][];
            /** The paper's measure of how alone the answer stands, and the one normalised by ln(N+1); 1: one possibility is left, a landmark or none of the map. */
            entropy_m: number;
            entropy_norm: number;
            /** Chance that the named landmark is right, 0 to 1, learnt from data; 0 unless UNIQUE. */
            confidence: number;
            pose: components["schemas"]["LandmarkPose"] | null;
            second_pose: components["schemas"]["LandmarkPose"] | null;
            /** The two solutions cannot be told apart by image error alone. */ pose_ambiguous: boolean;
            /** Why no pose followed from a unique landmark: empty, no_intrinsics, no_size, degenerate, reprojection (the corners fit no pose of a landmark of this size), border_unclear (two borders fit about equally well). */
            pose_refusal: string;
            points: components["schemas"]["PointEvidence"] | null;
            /** The landmark whose points are there while a connected part of it shows something else: perhaps altered, or another thing with the same parts. The verdict is AMBIGUOUS, and no pose follows. Empty unless in doubt for this reason. */
            doubtful_landmark: string;
            /** How it was named: GLOBAL with `landmark`, GUIDED with `guided_landmark`; unspecified where it was not. */
            sighting: components["schemas"]["Sighting"];
            /** The landmark that the quad is by the pose known before the frame, where the picture alone leaves several. The verdict stays what the picture alone says; corners and pose are those of this landmark. Empty unless GUIDED. */
            guided_landmark: string;
            /** Probability that the quad is none of the map's landmarks: 1 where none was accepted, the share of one more possibility where the only accepted one is in doubt, else 0. */
            probability_none: number;
        };
        QuadKind: "unspecified" | "full" | "three_sided" | "expected" | "texture";
        /** The points of a quad that are like points of a landmark. */
        QuadMatches: {
            /** The landmark that is named, else the nearest candidate, by its name at that time. */ landmark: string;
            /** At most 100, those that agree first. */ matches: components["schemas"]["PointMatch"][];
        };
        /** How far the server can do its work. */
        Readiness: {
            /** `ready`, or `degraded`: everything runs, but one of `counts` is not 0, the disk has no room, the server has no part in its router, another server has one of its maps, the last scheduled backup failed, or the check of the database did. */
            status: string;
            /** How many there are of what is wrong, for whoever asks. */
            counts?: components["schemas"]["ReadinessCounts"];
            /** Maps whose stored version cannot be made ready, with the reason: an earlier version is used, or none since the server started. A later change of the map tries again. Only maps of the token that asks: none without one. */
            maps_not_in_use: {
                [key: string]: string;
            };
            /** Views, tracks and underlays whose stored picture is damaged, at most 100, of maps of the token that asks: none without one. The picture is not used; the same photograph, uploaded again, mends it. */
            damaged_pictures?: string[];
            /** Why the server has no part in the router that it is to join: no connection, or a name that another server has. Told to whoever sees all maps. */
            router?: string | null;
            /** Maps that another server has, too, with the reason: robots are refused on them here. Only maps of the token that asks. */
            maps_not_served?: {
                [key: string]: string;
            };
            database_check?: components["schemas"]["DatabaseCheckBody"] | null;
            /** The newest backup, and why the last attempt failed. A token for all maps is told the name and the reason. */
            backup?: components["schemas"]["BackupHealth"];
            /** For how many seconds each part that has work, or is probed, has not gone on. Beyond a few the server is not ready. Empty for whoever does not see all maps. */
            parts_still_s?: {
                [key: string]: number;
            };
            storage?: components["schemas"]["StorageHealth"] | null;
            /** Panics caught since the start, by where: what they met was refused or dropped, everything else went on. Each is in the log. Anything but 0 is a fault of the program. */
            panics: {
                [key: string]: number;
            };
        };
        /** How many things are wrong, named or not. */
        ReadinessCounts: {
            /** Maps whose stored version is not in use. */ maps_not_in_use: number;
            /** Views, tracks and underlays whose stored picture is damaged. */ damaged_pictures: number;
        };
        /** A recording as it stands. */
        RecordingStatusBody: {
            /** Name of the map. */ map: string;
            /** Whose run. */ robot: string;
            /** False once it is full, or the robot's software was started again, or it went to another map, or its odometry jumped: what was recorded until then can be learnt from. */
            active: boolean;
            /** Why it is active no longer. */ reason?: string | null;
            /** Way driven by odometry, metres. */ distance_m: number;
            span_ns?: components["schemas"]["Span"] | null;
            /** Readings of odometry that were kept. */ odometry: number;
            /** Fixes by landmarks. */ landmarks: number;
            /** Fixes by the laser. */ laser: number;
        };
        /** A run that was learnt from. */
        ReferenceRunBody: {
            /** Its number, counting up over all maps. */ id: number;
            /** Whose run. */ robot: string;
            /** ms since the Unix epoch. */ created_ms: number;
            /** Way of which the path was known, metres. */ distance_m: number;
            /** Square metres by heading that it tells of. */ cells: number;
            /** What it showed, all of it together. */ statistics: components["schemas"]["ModalityStatsBody"][];
        };
        /** Runs of a map that were learnt from. */
        ReferenceRuns: {
            /** Oldest first; at most 200. */ runs: components["schemas"]["ReferenceRunBody"][];
        };
        /** Where the robot really was. */
        ReferenceTrajectoryBody: {
            /** Time (ns of the robot's clock, as in its messages), x and y in metres on the map, heading in radians; times rise, 2 to 200 000 (up to 112 bytes each). Nothing is learnt between two that are more than a second apart. */
            poses: [
                number,
                number,
                number,
                number
            ][];
            /** Standard deviation of its positions, metres; 0.01 if absent. */ sigma_m?: number | null;
            /** Of its headings, radians; 0.005 if absent. */ sigma_rad?: number | null;
        };
        /** Why messages of a robot were refused. */
        RefusalReason: {
            /** A stable word. */ code: string;
            /** The field at fault of the last one, or the topic of ROS. */ field: string;
            /** A sentence for a person about the last one. */ detail: string;
            /** What to do; empty where the sentence says it. */ advice: string;
            /** How many. */ count: number;
            /** Since the last one. */ ago_ms: number;
        };
        /** Who did not take a photograph. */ RefusedBy: "upload" | "lesson";
        /** A photograph that was not taken for a landmark, or not in its last lesson. */
        RefusedView: {
            /** Its number, never used again. */ id: number;
            /** ms since the Unix epoch. */ refused_ms: number;
            /** Who did not take it. */ by: components["schemas"]["RefusedBy"];
            /** A code: of the refusal of the upload, `duplicate`, `near_duplicate`, `beyond_limit` or `picture_unreadable`. */
            reason: string;
            /** Why: one sentence for a person. */ sentence: string;
            /** What to do: one sentence for a person. */ advice: string;
            /** The view that it repeats, or that the lesson left out; null where that is gone. */ view?: number | null;
            /** Path of a small picture of it; null where it could not be decoded. */ icon?: string | null;
        };
        /** Why a message was refused: a stable code, the field at fault and a sentence for a person. */
        Rejection: {
            code: string;
            field: string;
            detail: string;
        };
        /** How far a robot's relocalisation has come. */
        RelocalisationStatus: {
            /** False for a robot that knows where it is, or has seen nothing to search with: all else is empty then. */
            relocalising: boolean;
            /** The map it searches. */ map?: string | null;
            /** Version of that map. */ map_version?: number | null;
            /** Most probable first, eight at most. */ hypotheses: components["schemas"]["PoseHypothesisBody"][];
            /** Of the belief over the whole map, nats: 0 when one cell of 0.2 m and 10 degrees has it all. */
            entropy_nats: number;
            /** Sightings that it rests on. */ sightings: number;
            /** The landmarks by which the first hypothesis explains them. */ landmarks: string[];
            /** What is missing before the first one becomes the robot's pose; empty if nothing is. */
            missing: components["schemas"]["MissingConditionBody"][];
            /** The first one must be more probable than this. */ min_probability: number;
        };
        /** What robots on the map would be told otherwise if the draft were published: their last frames, answered by map and draft. */
        Replay: {
            /** Frames that were answered by both. */ frames: number;
            /** Of those, the ones with equal answers. */ unchanged: number;
            /** Counts of each robot, by name. */ robots: components["schemas"]["RobotReplay"][];
            /** The frames with different answers, newest first in turn of their cameras. */
            changes: components["schemas"]["ReplayChange"][];
        };
        /** A frame with different answers. */
        ReplayChange: {
            /** Who sent it. */ robot: string;
            /** By which camera. */ camera: string;
            /** Robot's clock at capture, ms since the Unix epoch. */ captured_ms: number;
            /** Landmarks that the map names alone. */ lost: string[];
            /** Landmarks that the draft names alone. */ gained: string[];
            /** The robot's pose. */ pose: components["schemas"]["ReplayedPose"];
            /** Between the two poses, m; null unless it is `moved`. */ distance_m?: number | null;
            /** Between the two headings, rad, 0 to pi; null unless it is `moved`. */ angle_rad?: number | null;
        };
        /** How the pose in an answer differs. */ ReplayedPose: "same" | "gained" | "lost" | "moved";
        /** A robot. */
        Robot: {
            /** `[a-z0-9_-]{1,64}`, unique. */ name: string;
            /** The map it stands on. */ map: string;
            /** Its software is connected, or sent a message within the last 3 s. */ alive: boolean;
            /** The start of its software that speaks for it; absent if it is not connected. */ epoch?: number | null;
            conflict?: components["schemas"]["EpochConflictBody"] | null;
            pose?: components["schemas"]["RobotPose"] | null;
            activity?: components["schemas"]["RobotActivity"] | null;
        };
        /** What a robot has done since the server started. */
        RobotActivity: {
            /** Frames that were searched for landmarks and answered. */ answered: number;
            /** What was used and what was refused, by kind; a kind of which nothing came is absent. */
            inputs: components["schemas"]["RobotInput"][];
            /** Since the last message, used or refused; absent where only connections were refused. */
            last_message_ms?: number | null;
            /** Since the last frame in which a landmark was named; absent if there was none. */
            last_recognised_ms?: number | null;
            /** Answered frames in a second, over the last ten whole seconds, or all since its first message. */
            frames_per_s: number;
        };
        /** Where a robot stands. */
        RobotAssignment: {
            /** Name of the map. */ map: string;
        };
        /** A certificate of a robot, without its key. */
        RobotCertificate: {
            /** 16 hexadecimal digits. */ serial: string;
            /** Whose it is. */ robot: string;
            /** SHA-256 of the certificate (DER), hexadecimal. */ sha256: string;
            /** Milliseconds since the Unix epoch. */ issued_ms: number;
            /** Not valid from then on. */ expires_ms: number;
            /** Not valid since then; null if it was not revoked. */ revoked_ms?: number | null;
        };
        /** What became of one kind of a robot's messages. */
        RobotInput: {
            /** `frame`, `odometry`, `scan`; of ROS 2 also `camera_info` and `transform`; `connection`: its links to the server. */
            input: string;
            /** How many were used. */ used: number;
            /** How many were refused, or lack what others need. */ refused: number;
            /** How many of them since the last that was used: where it rises, none is used any more. */
            refused_in_a_row: number;
            /** Why, the last reason first. */ reasons: components["schemas"]["RefusalReason"][];
        };
        /** A fused pose on the robot's map. */
        RobotPose: {
            /** Metres, in the map. */ x_m: number;
            /** Metres, in the map. */ y_m: number;
            /** Heading in the map. */ theta_rad: number;
            /** Over (x, y, theta), row-major. */ covariance: components["schemas"]["Covariance"];
            /** Since the capture of the newest odometry or fix that supports it; at most 2000. */ age_ms: number;
            /** How far it is trusted, as it was last published. Read as unspecified where a server does not say. */
            trust: components["schemas"]["PoseTrust"];
        };
        /** What the draft changes for one robot, in frames. */
        RobotReplay: {
            /** Its name. */ robot: string;
            /** Frames of it. */ frames: number;
            /** With equal answers. */ unchanged: number;
            /** In which landmarks are not named any more. */ lost: number;
            /** In which landmarks are named that were not. */ gained: number;
            /** With a pose by the draft alone. */ pose_gained: number;
            /** With a pose by the map alone. */ pose_lost: number;
            /** With another pose. */ pose_moved: number;
            /** Longest way between the two poses of a frame, m. */ longest_move_m: number;
        };
        /** What a principal may do. Each role may do all that those before it may. */
        Role: "viewer" | "robot" | "teacher" | "operator" | "admin";
        /** A way back. */
        Rollback: {
            /** The commit whose state the map gets. */ to: number;
        };
        /** What a roll back did. */
        RollbackOutcome: {
            /** False if the map was so already; then no commit was made. */ changed: boolean;
            /** The newest commit. */ commit: components["schemas"]["Commit"];
        };
        /** What became of the messages of a robot of ROS 2 since the start of the server. */
        Ros2Status: {
            /** Whether the settings of the server name the robot; if not, all else is empty. */ configured: boolean;
            /** Messages received, by topic. */
            received: {
                [key: string]: number;
            };
            /** Messages sent, by topic. */
            sent: {
                [key: string]: number;
            };
            /** Messages that were not used, or only in part, by topic and reason, such as `no_transform`; the log has the details. The topic is empty for what belongs to none. */
            reasons: {
                [key: string]: {
                    [key: string]: number;
                };
            };
        };
        /** A part of a route within one place. */
        RouteLeg: {
            /** The place, `hall/3`. */ place: string;
            /** Index of the passage at its end; `null` for the last leg, which ends at the place's centre. */
            passage?: number | null;
            /** With the passage after it. */ length_m: number;
            /** Its corners: x, y in metres, in the map of the place. */ path: components["schemas"]["Pair"][];
            next_landmark?: components["schemas"]["NextLandmarkBody"] | null;
        };
        /** A map of a server. */
        ServedMap: {
            /** Its name. */ name: string;
            /** Whether robots are answered on it. */ is_served: boolean;
        };
        /** A server. */
        ServerBody: {
            /** Its name. */ name: string;
            /** Its maps, without drafts, by name. */ maps: components["schemas"]["ServedMap"][];
            /** How many robots are registered with it. */ robots: number;
        };
        /** A numbered event. */
        ServerEvent: components["schemas"]["ServerEventBody"] & {
            /** Its id, for `Last-Event-ID`. */ id: string;
            /** ms since the Unix epoch. */ at_ms: number;
        };
        /** What has happened. In JSON, `kind` is the name of the variant. */
        ServerEventBody: {
            kind: "ready";
        } | {
            kind: "reset";
        } | {
            /** The map. */ map: string;
            /** Its version; null if it is gone. */ version?: number | null;
            kind: "map_changed";
        } | {
            /** Its map. */ map: string;
            /** Its name. */ landmark: string;
            /** What became of it. */ change: components["schemas"]["LandmarkChange"];
            kind: "landmark_changed";
        } | {
            /** Their map. */ map: string;
            /** How many. */ count: number;
            kind: "landmarks_changed";
        } | {
            /** Its map. */ map: string;
            /** Its number. */ job: number;
            /** Where it stands. */ state: components["schemas"]["JobState"];
            kind: "job";
        } | {
            /** The map it stands on; null for a robot that is not registered. */ map?: string | null;
            /** The robot. */ robot: string;
            /** Whether it is there. */ present: boolean;
            kind: "presence";
        } | {
            /** Its map. */ map: string;
            /** Its number. */ gathering: number;
            /** What became of it. */ change: components["schemas"]["GatheringChange"];
            kind: "gathering";
        } | {
            /** Its name. */ backup: string;
            /** How far it is. */ state: components["schemas"]["BackupState"];
            kind: "backup";
        } | {
            kind: "tokens_changed";
        };
        /** This server and those that it shares a router with. */
        Servers: {
            /** Name of this server. */ server: string;
            /** Endpoints of the router that it joins; empty: it is the router itself. */ router: string[];
            /** There is a connection to the router. */ is_connected: boolean;
            /** All servers that live, this one among them, by name. */ servers: components["schemas"]["ServerBody"][];
            /** Maps that several servers have, with the servers: at most one of them serves it. */
            contested_maps: {
                [key: string]: string[];
            };
            /** Robots that are registered with several servers: their messages must name the map. */
            contested_robots: {
                [key: string]: string[];
            };
            /** Announcements that were not taken because they were too many. */ ignored: number;
        };
        /** How a landmark was named. */ Sighting: "unspecified" | "global" | "guided";
        /** Places and passages of the maps of a site. */
        SiteTopologyBody: {
            /** The versions of the maps it rests on, by map. */ maps: components["schemas"]["TopologyMap"][];
            /** By map, then by number. */ places: components["schemas"]["TopologyPlace"][];
            /** Doorways by map, then links between maps. */ passages: components["schemas"]["TopologyPassage"][];
            route?: components["schemas"]["TopologyRoute"] | null;
        };
        /** Width and height of a landmark. */
        Size: {
            /** 0.01 to 100. */ width_m: number;
            /** 0.01 to 100. */ height_m: number;
        };
        /** Size and place of a landmark, as far as they are known. */
        SizeAndPlace: {
            size?: components["schemas"]["Size"] | null;
            place?: components["schemas"]["Place"] | null;
        };
        /** Two times in nanoseconds since the Unix epoch: from, to. */
        Span: [
            number,
            number
        ];
        StageTime: {
            stage: string;
            ms: number;
        };
        /** Whose runs an advice rests on. */ StatsScopeBody: "cell" | "neighbourhood" | "area" | "map";
        /** The disk of the data directory at the last look, some seconds ago at most. */
        StorageHealth: {
            /** Bytes that the server's user can fill; 0 where that is not known. */ total_bytes: number;
            /** Of these, free. */ free_bytes: number;
            /** Bytes of the database file that deletions have freed: new data take them first. */
            reusable_bytes: number;
            /** Used share, in percent, rounded down. */ used_percent: number;
            /** The setting `limits.disk_percent`: from here on nothing is added. */ limit_percent: number;
            /** Why nothing is added at present, and what to do. Robots are served all the same. */
            refused?: string | null;
        };
        /** A stored answer with everything that was said. */
        StoredAnswer: {
            /** In brief. */ summary: components["schemas"]["StoredAnswerSummary"];
            /** `Answer` of protos/waymark/v1/waymark.proto as JSON: quads with candidates, distances and thresholds, poses. */
            answer: components["schemas"]["Answer"];
            /** The pictures of its quads, in the order of `answer.quads`. */
            quads: components["schemas"]["StoredQuad"][];
            prior_check?: components["schemas"]["PriorCheck"] | null;
        };
        /** A stored answer in brief. */
        StoredAnswerSummary: {
            /** Its number, never used again. */ id: number;
            /** The map that the frame was compared with. */ map: string;
            /** The robot that sent the frame. */ robot: string;
            /** The camera that took it. */ camera: string;
            /** ms since the Unix epoch. */ stored_ms: number;
            /** What came of the frame. */ status: components["schemas"]["AnswerStatus"];
            /** Whether it gave a pose of the robot by the picture alone. */ has_pose: boolean;
            /** Why there is no pose: the code of the frame's rejection; where no landmark was named, the gate that refused the nearest candidate; else the gate that refused the pose. */
            refusal?: string | null;
            /** The landmarks that it names, by their names at that time. */ landmarks: string[];
            /** The other landmarks that quads were compared with. */ candidates: string[];
        };
        /** The pictures that belong to a quad of a stored answer. */
        StoredQuad: {
            /** Path of its icon; absent for quads that are too small, partly outside of the picture, or beyond the first eight. */
            icon?: string | null;
            /** The landmarks it was compared with, in the order of the answer's candidates. */
            landmarks: components["schemas"]["LandmarkIcon"][];
            matched?: components["schemas"]["QuadMatches"] | null;
        };
        /** A threshold with its evidence. A distance is accepted only when it is strictly below. */
        ThresholdBody: {
            /** In the unit of the distance; 0 accepts nothing. */ threshold: number;
            /** Share of other distances below it. */ false_positive_rate: number;
            /** Share of own distances at or above it. */ false_negative_rate: number;
            /** Own distances that it was fitted to. */ positives: number;
            /** Distances to others that it was fitted to. */ negatives: number;
            /** What limits it. */ limited_by: components["schemas"]["ThresholdLimit"];
        };
        /** What limits a threshold. */ ThresholdLimit: "cost" | "nearest_negative" | "absolute_cap";
        /** Costs that thresholds of the correlation and the Hausdorff distance weigh. */
        ThresholdWeights: {
            /** Of a wrong acceptance. */ lambda: number;
            /** Of a refused own view. */ mu: number;
        };
        /** A token without its secret. */
        Token: {
            /** Its number; never given again. */ id: number;
            /** Who or what it is for. */ name: string;
            /** What it may do. */ role: components["schemas"]["Role"];
            /** Maps that it is for, by name; null for all maps and what is above maps. Deleted maps are left out. */
            maps?: string[] | null;
            /** Milliseconds since the Unix epoch. */ created_ms: number;
            /** Not valid from then on; null for never. */ expires_ms?: number | null;
            /** Not valid since then; null if it was not revoked. */ revoked_ms?: number | null;
        };
        /** A map of a site. */
        TopologyMap: {
            /** Its name. */ map: string;
            /** Its version. */ version: number;
        };
        /** A doorway between two places, or a link between two maps. */
        TopologyPassage: {
            /** Its two ends. */ ends: components["schemas"]["PassageEnd"][];
            /** Free width, at most 2 m; `null` for a link. */ width_m?: number | null;
            /** From centre to centre of its places. */ length_m: number;
            /** What is seen from its first end, deepest inside its visibility area first; at most 32. */
            landmarks: string[];
        };
        /** Free floor that no doorway divides. */
        TopologyPlace: {
            /** Map and number, `hall/3`. Numbers are those of this version of the map. */ place: string;
            /** The map. */ map: string;
            /** The point of it nearest to its centre of gravity, metres, in the map. */ x_m: number;
            /** Of that point. */ y_m: number;
            /** Free floor. */ area_m2: number;
            /** What is seen from it, from most of it first; at most 32. */
            landmarks: components["schemas"]["PlaceLandmark"][];
        };
        /** A route from passage to passage. */
        TopologyRoute: {
            /** Sum of its legs. */ length_m: number;
            /** In order, at least one. */ legs: components["schemas"]["RouteLeg"][];
        };
        /** All tracks of a gathering that wait for a decision. */
        TrackList: {
            /** By number; those that somebody has decided on are not among them. */
            tracks: components["schemas"]["TrackSummary"][];
        };
        /** A track: an object that a robot drove past, for a person to decide on. */
        TrackSummary: {
            /** Its number in the gathering. */ number: number;
            /** The landmark whose views these are; null for a thing that is none yet. */ landmark?: string | null;
            /** Frames in which it was followed. */ sightings: number;
            /** Of these, such in which it was taken for a landmark of the map, or nearly. */ known: number;
            /** Numbers of its views; `views/{number}/icon` is the picture. */ views: number[];
            /** Views beside these that do not agree on its place: another border of it was found, or something else. They are left out. */
            inconsistent_views: number;
            /** The view that stands best for all. */ best_view?: number | null;
            /** Smallest and largest side of the quad in the picture. */ side_px: components["schemas"]["Pair"];
            /** How far apart the views are (the gate `visibility_confidence`). */ v_c: number;
            place?: components["schemas"]["EstimatedPlace"] | null;
            /** Why that is not known. */ not_placed?: string | null;
            /** Whether a lesson of these views would pass every gate, look-alikes apart, and nothing else speaks against it. */
            passes: boolean;
            /** What speaks against it. */ failed_gates: components["schemas"]["FailedGate"][];
            /** Other tracks that look alike or are at the same place: perhaps the same thing twice, or two of one kind. */
            similar_tracks: number[];
        };
        /** A stored training view. */
        TrainingView: {
            /** Its number, never used again. */ id: number;
            /** The landmark's corners in the picture: top-left, top-right, bottom-right, bottom-left, in pixels. */
            corners: components["schemas"]["Corners"];
            /** Of the picture, as a viewer shows it. */ width_px: number;
            /** Of the picture, as a viewer shows it. */ height_px: number;
            /** `png` or `jpeg`. */ image_kind: string;
            /** ms since the Unix epoch. */ created_ms: number;
            outcome?: components["schemas"]["UploadOutcomeBody"] | null;
            placing?: components["schemas"]["PlacementReportBody"] | null;
        };
        /** Where a robot was lately, by source; oldest first, at most 2000 of each. */
        TrajectoriesBody: {
            /** Fused poses. */ pose: components["schemas"]["Pose2"][];
            /** Odometry alone, laid on the map at the robot's first known pose. */
            odometry: components["schemas"]["Pose2"][];
            /** The truth, where a simulator tells it. */ truth: components["schemas"]["Pose2"][];
        };
        /** How one map lies in another. */
        TransformResponse: {
            /** The maps on the way, both ends included; those that the asker may not see are left out. */
            via: string[];
            /** Maps coordinates of the first to the other. */ to_from_map: components["schemas"]["TransformedPose"];
            /** Height of the first one's floor above the other's. */ level_m: number;
            pose?: components["schemas"]["TransformedPose"] | null;
        };
        /** A pose with its covariance over (x, y, theta), row-major. */
        TransformedPose: {
            /** Metres, in the other map. */ x_m: number;
            /** Metres, in the other map. */ y_m: number;
            /** Heading in the other map. */ theta_rad: number;
            /** Over (x, y, theta), row-major. */ covariance: components["schemas"]["Covariance"];
        };
        /** Three numbers: x and y in metres and a heading in radians, or their errors; variances of a line. */
        Triple: [
            number,
            number,
            number
        ];
        /** A picture under a map; `underlay/image` is the picture itself. */
        Underlay: {
            /** Where it lies. */ place: components["schemas"]["UnderlayPlace"];
            /** Of the picture, as a viewer shows it. */ width_px: number;
            /** Of the picture, as a viewer shows it. */ height_px: number;
            /** `png` or `jpeg`. */ image_kind: string;
            /** ms since the Unix epoch. */ created_ms: number;
        };
        /** Where a picture lies in the map. */
        UnderlayPlace: {
            /** Side of a pixel, 0.0001 to 10. */ metres_per_pixel: number;
            /** Lower left corner of the lower left pixel, x. */ x_m: number;
            /** Lower left corner of the lower left pixel, y. */ y_m: number;
            /** Direction of the picture's rows in the map, counter-clockwise from map x. */ theta_rad: number;
        };
        /** A robot that sends messages and is not registered. */
        UnknownRobot: {
            /** The name it uses. */ name: string;
            /** The camera of its last frame; absent if it sent none. */ camera?: string | null;
            /** Its refused messages. */ messages: number;
            /** Since the first of them. */ first_ms: number;
            /** Since the last of them. */ last_ms: number;
        };
        /** Robots that send messages and are not registered. */
        UnknownRobots: {
            /** By name; at most 64, those that were heard last. */ robots: components["schemas"]["UnknownRobot"][];
        };
        /** What became of an upload. */ UploadOutcomeBody: "new" | "duplicate" | "near_duplicate";
        /** One uploaded view. */
        UploadedView: {
            /** Top-left, top-right, bottom-right, bottom-left, in pixels as seen. */
            corners: components["schemas"]["Corners"];
        };
        /** Views of one flat rectangle. */
        UploadedViews: {
            /** Of the images. */ width_px: number;
            /** Of the images. */ height_px: number;
            /** Of the rectangle; only its ratio matters for the camera. */ size_width_m: number;
            /** See `size_width_m`. */ size_height_m: number;
            /** At least two, better five to ten, from at least three sides that differ by more than 15 degrees. */
            views: components["schemas"]["UploadedView"][];
        };
        Verdict: "unspecified" | "unknown" | "unique" | "ambiguous";
        /** What runs here. */
        Version: {
            /** `waymark`. */ name: string;
            /** Of the program. */ version: string;
            /** Of the HTTP interface. */ api: string;
            /** Of the protocol over zenoh. */ protocol: string;
            /** Name of this server among those of a router. */ server?: string;
        };
        /** The floor area from which a landmark is seen: a GeoJSON `Feature` in metres of the map, not degrees. */
        VisibilityAreaBody: {
            /** `Feature`. */ type: string;
            /** The polygons. */ geometry: components["schemas"]["MultiPolygon"];
            /** The landmark, and figures of the area. */ properties: components["schemas"]["VisibilityAreaProperties"];
        };
        /** Figures of a visibility area. */
        VisibilityAreaProperties: {
            /** Name of the landmark. */ landmark: string;
            /** Square metres. */ area_m2: number;
            centroid_m?: components["schemas"]["Pair"] | null;
            /** Furthest possible distance from the landmark. */ reach_m: number;
        };
        /** A camera, and what counts as seen by it. Every number may be absent. */
        VisibilitySettingsBody: {
            /** Focal length, pixels: 10 to 20 000; usually 512. */ focal_px?: number | null;
            /** Width of the image, pixels: 16 to 20 000; usually 640. */ width_px?: number | null;
            /** Height of the image, pixels: 16 to 20 000; usually 480. */ height_px?: number | null;
            /** Height of the camera above the floor: 0 to 10 m; usually 1.2. */ camera_height_m?: number | null;
            /** Lowest tilt of the camera, up positive, within 1.55; usually -0.35. The same as the highest for one that is fixed. */
            tilt_low_rad?: number | null;
            /** Highest tilt; usually 0.35. Signs under ceilings are seen only by cameras that look up. */
            tilt_high_rad?: number | null;
            /** Rightmost pan, left positive, from -pi; usually -1.7. */ pan_low_rad?: number | null;
            /** Leftmost pan, to pi; usually 1.7. */ pan_high_rad?: number | null;
            /** Most oblique view against a landmark's normal: 0.01 to 1.48; usually 1.309, 75 degrees. */
            max_incidence_rad?: number | null;
            /** Shortest side of a landmark in the image, pixels: 1 to 20 000; usually 75. */
            min_side_px?: number | null;
            /** Largest share of the image that a landmark may take: 0.01 to 1; usually 0.9. */
            max_fill?: number | null;
            /** How far before its wall a landmark is taken to hang, so that its own wall does not hide it: 0.001 to 0.5 m; usually 0.05. */
            standoff_m?: number | null;
        };
        /** A landmark that may be seen. */
        VisibleLandmark: {
            /** Name of the landmark. */ landmark: string;
            /** Probability that it is seen when the camera is turned to it. */ probability: number;
            /** Distance to the boundary of its area, positive inside. */ margin_m: number;
        };
        /** Where the robot is. */
        VisibleRequest: {
            /** Pose of the robot. */ pose: components["schemas"]["PoseBody"];
            /** Another camera than the map's. */ visibility_settings?: components["schemas"]["VisibilitySettingsBody"];
        };
        /** What may be seen. */
        VisibleResponse: {
            /** Of this version of the map. */ map_version: number;
            /** Most probable first. */ landmarks: components["schemas"]["VisibleLandmark"][];
        };
        /** A straight piece of wall, the free side on the left of a to b. */
        WallBody: {
            /** First end: x, y in metres. */ a: components["schemas"]["Pair"];
            /** Second end: x, y in metres. */ b: components["schemas"]["Pair"];
            covariance?: components["schemas"]["Triple"] | null;
        };
        /** The walls of a map. */
        WallsBody: {
            /** In the order given. */ segments: components["schemas"]["WallBody"][];
        };
        /** How walls differ. */
        WallsDifference: {
            /** Number of segments before. */ before: number;
            /** Number of segments after. */ after: number;
            /** Segments that are new. */ added: number;
            /** Segments that are gone. */ removed: number;
            bounds_m?: components["schemas"]["Bounds"] | null;
        };
        /** Who asks, as the server sees it. */
        Whoami: {
            /** Name of the token; `local` for that of the server's own machine. */ name: string;
            /** What may be done. */ role: components["schemas"]["Role"];
            /** Maps that it is for; null for all maps and what is above maps. */ maps?: string[] | null;
            /** Number of the token; null for the local one. */ token?: number | null;
            /** Not valid from then on, milliseconds since the Unix epoch; null for never. */
            expires_ms?: number | null;
        };
    };
}

type Schemas = components["schemas"];

/** By method and path below /api/v1. */
export interface Operations {
  "GET /answers": { query: { limit?: number; cursor?: string; map?: string; robot?: string; camera?: string; status?: Schemas["AnswerStatus"]; refusal?: string; landmark?: string; since_ms?: number; until_ms?: number }; answer: Schemas["Page_StoredAnswerSummary"] };
  "GET /answers/{answer}": { answer: Schemas["StoredAnswer"] };
  "GET /answers/{answer}/quads/{quad}/icon": { answer: undefined };
  "GET /audit": { query: { limit?: number; cursor?: string; actor?: string; target?: string; since_ms?: number; before_ms?: number }; answer: Schemas["Page_AuditEntry"] };
  "GET /audit/check": { query: { seq?: number; sha256?: string }; answer: Schemas["AuditCheck"] };
  "GET /backups": { query: { limit?: number; cursor?: string }; answer: Schemas["Page_Backup"] };
  "POST /backups": { answer: Schemas["Backup"] };
  "GET /backups/{backup}": { answer: Schemas["Backup"] };
  "DELETE /backups/{backup}": { answer: undefined };
  "GET /backups/{backup}/file": { answer: undefined };
  "POST /bundles": { query: { name?: string; without_link?: boolean }; answer: Schemas["Map"] };
  "GET /events": { query: { map?: string; kind?: (Schemas["EventKind"])[]; last_event_id?: string }; answer: undefined };
  "GET /healthz": { answer: Schemas["Health"] };
  "GET /jobs": { query: { limit?: number; cursor?: string; state?: Schemas["JobState"]; map?: string }; answer: Schemas["Page_Job"] };
  "GET /jobs/{job}": { answer: Schemas["Job"] };
  "DELETE /jobs/{job}": { answer: Schemas["Job"] };
  "GET /jobs/{job}/events": { answer: undefined };
  "GET /maps": { query: { limit?: number; cursor?: string; name?: string; sort?: Schemas["ListOrder"] }; answer: Schemas["Page_Map"] };
  "POST /maps": { body: Schemas["NewMap"]; answer: Schemas["Map"] };
  "GET /maps/{map}": { answer: Schemas["Map"] };
  "DELETE /maps/{map}": { answer: undefined };
  "PATCH /maps/{map}": { body: Schemas["MapPatch"]; answer: Schemas["Map"] };
  "POST /maps/{map}/bulk/create-landmarks": { body: Schemas["NewLandmarks"]; answer: Schemas["BulkOutcome"] };
  "POST /maps/{map}/bulk/delete-landmarks": { body: Schemas["LandmarkDeletions"]; answer: Schemas["BulkOutcome"] };
  "GET /maps/{map}/bundle": { answer: undefined };
  "GET /maps/{map}/commits": { query: { limit?: number; cursor?: string }; answer: Schemas["Page_Commit"] };
  "GET /maps/{map}/commits/{commit}": { answer: Schemas["Commit"] };
  "POST /maps/{map}/commits/{commit}/undo": { answer: Schemas["RollbackOutcome"] };
  "POST /maps/{map}/copies": { body: Schemas["NewCopy"]; answer: Schemas["Map"] };
  "POST /maps/{map}/coverage": { body: Schemas["CoverageRequest"]; answer: Schemas["CoverageResponse"] };
  "GET /maps/{map}/difference": { query: { from: number; to?: number; limit?: number; cursor?: string }; answer: Schemas["Difference"] };
  "GET /maps/{map}/drafts": { answer: Schemas["Page_Draft"] };
  "POST /maps/{map}/drafts": { body: Schemas["NewDraft"]; answer: Schemas["Draft"] };
  "DELETE /maps/{map}/drafts/{draft}": { answer: undefined };
  "GET /maps/{map}/drafts/{draft}/difference": { query: { limit?: number; cursor?: string }; answer: Schemas["DraftDifference"] };
  "POST /maps/{map}/drafts/{draft}/publish": { answer: Schemas["RollbackOutcome"] };
  "POST /maps/{map}/drafts/{draft}/replay": { query: { frames?: number }; answer: Schemas["Replay"] };
  "GET /maps/{map}/duplicates": { query: { limit?: number; cursor?: string; landmark?: string; in_use?: boolean }; answer: Schemas["Page_DuplicatePair"] };
  "GET /maps/{map}/gatherings": { query: { limit?: number; cursor?: string }; answer: Schemas["Page_Gathering"] };
  "POST /maps/{map}/gatherings": { body: Schemas["NewGatheringBody"]; answer: Schemas["Gathering"] };
  "GET /maps/{map}/gatherings/{gathering}": { answer: Schemas["Gathering"] };
  "DELETE /maps/{map}/gatherings/{gathering}": { answer: undefined };
  "POST /maps/{map}/gatherings/{gathering}/accept": { body: Schemas["AcceptRequest"]; answer: Schemas["AcceptanceBody"] };
  "POST /maps/{map}/gatherings/{gathering}/stop": { answer: Schemas["Gathering"] };
  "GET /maps/{map}/gatherings/{gathering}/tracks": { answer: Schemas["TrackList"] };
  "DELETE /maps/{map}/gatherings/{gathering}/tracks/{track}": { answer: undefined };
  "GET /maps/{map}/gatherings/{gathering}/tracks/{track}/views/{view}/icon": { answer: undefined };
  "POST /maps/{map}/gaze": { body: Schemas["GazeQueryBody"]; answer: Schemas["GazeRankingBody"] };
  "GET /maps/{map}/landmarks": { query: { limit?: number; cursor?: string; name?: string; sort?: Schemas["ListOrder"]; status?: Schemas["LandmarkStatus"]; health?: Schemas["LandmarkHealthBody"]; has_place?: boolean }; answer: Schemas["Page_Landmark"] };
  "POST /maps/{map}/landmarks": { body: Schemas["NewLandmark"]; answer: Schemas["Landmark"] };
  "GET /maps/{map}/landmarks/{landmark}": { answer: Schemas["Landmark"] };
  "DELETE /maps/{map}/landmarks/{landmark}": { answer: undefined };
  "PATCH /maps/{map}/landmarks/{landmark}": { body: Schemas["LandmarkPatch"]; answer: Schemas["Landmark"] };
  "GET /maps/{map}/landmarks/{landmark}/distances": { answer: Schemas["LandmarkDistances"] };
  "GET /maps/{map}/landmarks/{landmark}/evidence": { answer: Schemas["LandmarkEvidence"] };
  "GET /maps/{map}/landmarks/{landmark}/icon": { query: { which?: Schemas["ModelPicture"] }; answer: undefined };
  "POST /maps/{map}/landmarks/{landmark}/learn": { body: Schemas["LandmarkLesson"] | null; answer: Schemas["Job"] };
  "POST /maps/{map}/landmarks/{landmark}/merge": { body: Schemas["LandmarkMerge"]; answer: Schemas["Landmark"] };
  "GET /maps/{map}/landmarks/{landmark}/model": { query: { harris?: boolean }; answer: Schemas["LandmarkModelDetail"] };
  "GET /maps/{map}/landmarks/{landmark}/refused-views": { answer: Schemas["Page_RefusedView"] };
  "GET /maps/{map}/landmarks/{landmark}/refused-views/{refused}/icon": { answer: undefined };
  "GET /maps/{map}/landmarks/{landmark}/views": { query: { limit?: number; cursor?: string; sort?: Schemas["NumberOrder"]; has_capture?: boolean; since_ms?: number; until_ms?: number }; answer: Schemas["Page_TrainingView"] };
  "POST /maps/{map}/landmarks/{landmark}/views": { answer: Schemas["TrainingView"] };
  "DELETE /maps/{map}/landmarks/{landmark}/views/{view}": { answer: undefined };
  "GET /maps/{map}/landmarks/{landmark}/views/{view}/icon": { answer: undefined };
  "GET /maps/{map}/landmarks/{landmark}/views/{view}/image": { answer: undefined };
  "GET /maps/{map}/landmarks/{landmark}/visibility": { query: { focal_px?: number; width_px?: number; height_px?: number; camera_height_m?: number; tilt_low_rad?: number; tilt_high_rad?: number; pan_low_rad?: number; pan_high_rad?: number; max_incidence_rad?: number; min_side_px?: number; max_fill?: number; standoff_m?: number }; answer: Schemas["VisibilityAreaBody"] };
  "POST /maps/{map}/learn": { body: Schemas["MapLesson"] | null; answer: Schemas["Job"] };
  "GET /maps/{map}/live": { answer: undefined };
  "POST /maps/{map}/localise": { answer: Schemas["LocaliseResult"] };
  "GET /maps/{map}/mapping": { answer: Schemas["MappingProgressBody"] };
  "POST /maps/{map}/mapping": { body: Schemas["NewMapping"]; answer: Schemas["MappingProgressBody"] };
  "DELETE /maps/{map}/mapping": { answer: undefined };
  "POST /maps/{map}/mapping/finish": { query: { hold?: boolean; accept?: boolean }; answer: Schemas["MappingProgressBody"] };
  "GET /maps/{map}/modalities": { answer: Schemas["ModalityMapBody"] };
  "PUT /maps/{map}/modalities": { body: Schemas["ModalityMapPatch"]; answer: Schemas["ModalityMapBody"] };
  "GET /maps/{map}/modalities/at": { query: { x_m: number; y_m: number; theta_rad?: number }; answer: Schemas["AreaStatsBody"] };
  "POST /maps/{map}/recognise": { answer: Schemas["Answer"] };
  "GET /maps/{map}/reference-runs": { answer: Schemas["ReferenceRuns"] };
  "DELETE /maps/{map}/reference-runs/{run}": { answer: undefined };
  "POST /maps/{map}/rollback": { body: Schemas["Rollback"]; answer: Schemas["RollbackOutcome"] };
  "GET /maps/{map}/transform": { query: { to: string; x_m?: number; y_m?: number; theta_rad?: number }; answer: Schemas["TransformResponse"] };
  "GET /maps/{map}/underlay": { answer: Schemas["Underlay"] };
  "PUT /maps/{map}/underlay": { answer: Schemas["Underlay"] };
  "DELETE /maps/{map}/underlay": { answer: undefined };
  "GET /maps/{map}/underlay/image": { answer: undefined };
  "GET /maps/{map}/visibility-settings": { answer: Schemas["VisibilitySettingsBody"] };
  "PUT /maps/{map}/visibility-settings": { body: Schemas["VisibilitySettingsBody"]; answer: Schemas["VisibilitySettingsBody"] };
  "POST /maps/{map}/visible": { body: Schemas["VisibleRequest"]; answer: Schemas["VisibleResponse"] };
  "GET /maps/{map}/walls": { answer: Schemas["WallsBody"] };
  "PUT /maps/{map}/walls": { body: Schemas["WallsBody"]; answer: Schemas["WallsBody"] };
  "POST /maps/{map}/walls/read": { query: { kind: string; metres_per_unit?: number }; answer: Schemas["FileWalls"] };
  "GET /metrics": { answer: undefined };
  "GET /readyz": { answer: Schemas["Readiness"] };
  "GET /robots": { query: { limit?: number; cursor?: string; name?: string; sort?: Schemas["ListOrder"] }; answer: Schemas["Page_Robot"] };
  "GET /robots/{robot}": { answer: Schemas["Robot"] };
  "PUT /robots/{robot}": { body: Schemas["RobotAssignment"]; answer: Schemas["Robot"] };
  "DELETE /robots/{robot}": { answer: undefined };
  "GET /robots/{robot}/cameras": { answer: Schemas["Cameras"] };
  "GET /robots/{robot}/cameras/{camera}/answer": { answer: Schemas["Answer"] };
  "POST /robots/{robot}/cameras/{camera}/calibrate": { body: Schemas["CalibrationRequest"]; answer: Schemas["CalibrationReport"] };
  "GET /robots/{robot}/cameras/{camera}/frame": { answer: undefined };
  "GET /robots/{robot}/certificates": { query: { limit?: number; cursor?: string }; answer: Schemas["Page_RobotCertificate"] };
  "POST /robots/{robot}/certificates": { body: Schemas["CertificateRequest"]; answer: Schemas["EnrolledRobot"] };
  "DELETE /robots/{robot}/certificates/{serial}": { answer: undefined };
  "GET /robots/{robot}/corrections": { answer: Schemas["CorrectionsBody"] };
  "PUT /robots/{robot}/pose": { body: Schemas["PoseByHand"]; answer: Schemas["RobotPose"] };
  "GET /robots/{robot}/recording": { answer: Schemas["RecordingStatusBody"] };
  "POST /robots/{robot}/recording": { answer: Schemas["RecordingStatusBody"] };
  "DELETE /robots/{robot}/recording": { answer: undefined };
  "POST /robots/{robot}/recording/reference": { body: Schemas["ReferenceTrajectoryBody"]; answer: Schemas["ReferenceRunBody"] };
  "GET /robots/{robot}/relocalisation": { answer: Schemas["RelocalisationStatus"] };
  "GET /robots/{robot}/ros2": { answer: Schemas["Ros2Status"] };
  "GET /robots/{robot}/trajectories": { answer: Schemas["TrajectoriesBody"] };
  "GET /servers": { answer: Schemas["Servers"] };
  "POST /session/links": { answer: Schemas["PageLink"] };
  "GET /sites/{site}/topology": { query: { from?: string; to?: string }; answer: Schemas["SiteTopologyBody"] };
  "GET /tokens": { query: { limit?: number; cursor?: string }; answer: Schemas["Page_Token"] };
  "POST /tokens": { body: Schemas["NewToken"]; answer: Schemas["CreatedToken"] };
  "DELETE /tokens/{token}": { answer: undefined };
  "GET /unknown-robots": { answer: Schemas["UnknownRobots"] };
  "GET /version": { answer: Schemas["Version"] };
  "GET /whoami": { answer: Schemas["Whoami"] };
}
