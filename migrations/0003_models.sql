-- What was learnt of landmarks. Models are stored once, by content, as pictures are: what is kept of earlier versions of a map
-- refers to them and copies none.
CREATE TABLE model_contents (
    sha256 BLOB NOT NULL PRIMARY KEY CHECK (length(sha256) = 32),
    bytes  BLOB NOT NULL
) STRICT;

-- One model per landmark; learning replaces it whole. The digest finds damaged bytes, the hash of the distance parameters
-- finds a threshold of other parameters: both are named and never matched.
CREATE TABLE models (
    landmark_id     INTEGER PRIMARY KEY REFERENCES landmarks (id) ON DELETE CASCADE,
    sha256          BLOB    NOT NULL REFERENCES model_contents (sha256) CHECK (length(sha256) = 32),
    -- 8 bytes little-endian: a u64 does not fit SQLite's signed integer.
    params_hash     BLOB    NOT NULL CHECK (length(params_hash) = 8),
    active          INTEGER NOT NULL CHECK (active IN (0, 1)),
    -- JSON list of what keeps a candidate from being active.
    reasons         TEXT    NOT NULL,
    -- JSON object for people: thresholds and figures of the learning. Lists are shown without opening any model.
    facts           TEXT    NOT NULL,
    views           INTEGER NOT NULL,
    generated_views INTEGER NOT NULL,
    learnt_ms       INTEGER NOT NULL,
    -- Not in use, because it looks like a landmark that is: JSON with that landmark's number, its name then, and the likeness.
    looks_like      TEXT    CHECK (length(looks_like) <= 1024)
) STRICT;

CREATE INDEX models_by_content ON models (sha256);
