-- Maps. All tables are STRICT: a value of the wrong type is an error here, not a surprise at the next read. Times are ms since
-- the Unix epoch by the server's clock; they are shown, never used for order.

-- Integer keys stay inside the server; people and robots use names. AUTOINCREMENT, so that a number that stood in an
-- answer or a log never comes to mean something else.
CREATE TABLE maps (
    id                INTEGER PRIMARY KEY AUTOINCREMENT,
    name              TEXT    NOT NULL UNIQUE CHECK (length(name) BETWEEN 1 AND 64),
    -- Counts up with every change that an answer could depend on; every answer quotes it.
    version           INTEGER NOT NULL DEFAULT 1 CHECK (version >= 1),
    -- Which detector and decision; NULL: as the server's settings say.
    preset            TEXT    CHECK (preset IN ('default', 'paper')),
    distance          TEXT    NOT NULL CHECK (distance IN ('both', 'correlation', 'hausdorff')),
    -- JSON: weights and gates of its own, with the reason; NULL: those of the server.
    learning          TEXT    CHECK (length(learning) <= 1024),
    created_ms        INTEGER NOT NULL,
    -- Revisions (see 0008_history.sql): of the map and of all that is in it, when that changed last, and of the floor plan.
    revision          INTEGER NOT NULL DEFAULT 1 CHECK (revision >= 1),
    changed_ms        INTEGER NOT NULL DEFAULT 0,
    underlay_revision INTEGER NOT NULL DEFAULT 1 CHECK (underlay_revision >= 1),
    -- Counts up with every change of the walls: what was computed from them before a write is compared by it inside the write.
    walls_version     INTEGER NOT NULL DEFAULT 1 CHECK (walls_version >= 1),
    -- Where it belongs, for people.
    site              TEXT    CHECK (length(site) BETWEEN 1 AND 64),
    building          TEXT    CHECK (length(building) BETWEEN 1 AND 64),
    floor             TEXT    CHECK (length(floor) BETWEEN 1 AND 64),
    -- The map in whose frame this one lies. No action: a map that others lie in is not deleted.
    parent_id         INTEGER REFERENCES maps (id),
    -- x, y, theta, level, then the covariance of the first three row by row: 13 little-endian f64, exact, read as a whole.
    parent_from_map   BLOB    CHECK (length(parent_from_map) = 104 AND (parent_id IS NULL) = (parent_from_map IS NULL)),
    -- What is fused.
    fusion            TEXT    NOT NULL DEFAULT 'all' CHECK (fusion IN ('all', 'near_best', 'best')),
    -- JSON: name and corners of each area that somebody named.
    areas             TEXT    NOT NULL DEFAULT '[]' CHECK (length(areas) <= 262144),
    -- The camera that looks for a map's landmarks, and what counts as seen: JSON of `map::visibility::VisibilitySettings`,
    -- checked when it came. NULL: the usual robot's.
    sight             TEXT    CHECK (length(sight) <= 2048),
    -- A draft is a map of its own, made of another one to be taught and edited beside it, and published to it as one commit.
    draft_of          INTEGER REFERENCES maps (id),
    -- The commit of the map that the draft began with.
    draft_from        INTEGER CHECK ((draft_from IS NULL) = (draft_of IS NULL))
) STRICT;

CREATE INDEX maps_by_parent ON maps (parent_id);
CREATE INDEX drafts_by_map ON maps (draft_of) WHERE draft_of IS NOT NULL;

-- Which landmark of the draft is which of the map.
CREATE TABLE draft_landmarks (
    draft_id    INTEGER NOT NULL REFERENCES maps (id) ON DELETE CASCADE,
    landmark_id INTEGER NOT NULL,
    of_landmark INTEGER NOT NULL,
    PRIMARY KEY (draft_id, landmark_id)
) STRICT, WITHOUT ROWID;

-- What map and draft were when the draft began: digests of their rows, each with its own numbers in it.
CREATE TABLE draft_rows (
    draft_id INTEGER NOT NULL REFERENCES maps (id) ON DELETE CASCADE,
    -- What the row is, in numbers of the map: `model 12`.
    row      TEXT    NOT NULL,
    in_map   BLOB    NOT NULL CHECK (length(in_map) = 32),
    in_draft BLOB    NOT NULL CHECK (length(in_draft) = 32),
    PRIMARY KEY (draft_id, row)
) STRICT, WITHOUT ROWID;
