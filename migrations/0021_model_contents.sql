-- Models are stored once, by content, as pictures are: what is kept of earlier versions refers to them and copies none.
CREATE TABLE model_contents (
    sha256 BLOB NOT NULL PRIMARY KEY CHECK (length(sha256) = 32),
    bytes  BLOB NOT NULL
) STRICT;

INSERT INTO model_contents (sha256, bytes) SELECT sha256, model FROM models WHERE true ON CONFLICT DO NOTHING;

-- One model per landmark; learning replaces it whole. The digest finds damaged bytes, the hash of the distance parameters
-- finds a threshold that no longer means anything: both are named and never matched.
CREATE TABLE new_models (
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
    -- A job was queued that gives this model its points.
    points_asked    INTEGER NOT NULL DEFAULT 0 CHECK (points_asked IN (0, 1)),
    -- Not in use, because it looks like a landmark that is: JSON with that landmark's number, its name then, and the likeness.
    looks_like      TEXT    CHECK (length(looks_like) <= 1024)
) STRICT;
INSERT INTO new_models (landmark_id, sha256, params_hash, active, reasons, facts, views, generated_views, learnt_ms, points_asked,
    looks_like)
SELECT landmark_id, sha256, params_hash, active, reasons, facts, views, generated_views, learnt_ms, points_asked, looks_like
FROM models;
DROP TABLE models;
ALTER TABLE new_models RENAME TO models;
CREATE INDEX models_by_content ON models (sha256);

CREATE TRIGGER model_learnt AFTER INSERT ON models
BEGIN
    UPDATE landmarks SET revision = revision + 1, changed_ms = CAST(unixepoch('subsec') * 1000 AS INTEGER) WHERE id = NEW.landmark_id;
END;

CREATE TRIGGER model_changed AFTER UPDATE OF sha256, active, looks_like ON models
WHEN OLD.sha256 <> NEW.sha256 OR OLD.active <> NEW.active OR OLD.looks_like IS NOT NEW.looks_like
BEGIN
    UPDATE landmarks SET revision = revision + 1, changed_ms = CAST(unixepoch('subsec') * 1000 AS INTEGER) WHERE id = NEW.landmark_id;
END;
