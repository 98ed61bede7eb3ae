-- Revisions and history. Triggers write both: no writer can forget it, and it stands or falls with its change. The server makes
-- the rest at its start, from the columns of the tables (server/src/store/derived_schema.rs): tables of past rows and the
-- triggers that fill them, count edits of maps and landmarks, and delete contents that nothing refers to.

-- Revisions: what an editor has seen is compared with what is there (`If-Match`). They count edits and lessons, and nothing
-- that robots do by themselves (health, findings).
CREATE TRIGGER underlay_put AFTER INSERT ON underlays
BEGIN UPDATE maps SET underlay_revision = underlay_revision + 1 WHERE id = NEW.map_id; END;

CREATE TRIGGER underlay_replaced AFTER UPDATE ON underlays
BEGIN UPDATE maps SET underlay_revision = underlay_revision + 1 WHERE id = NEW.map_id; END;

CREATE TRIGGER underlay_deleted AFTER DELETE ON underlays
BEGIN UPDATE maps SET underlay_revision = underlay_revision + 1 WHERE id = OLD.map_id; END;

CREATE TRIGGER run_added AFTER INSERT ON runs
BEGIN
    UPDATE maps SET revision = revision + 1, changed_ms = CAST(unixepoch('subsec') * 1000 AS INTEGER) WHERE id = NEW.map_id;
END;

CREATE TRIGGER run_deleted AFTER DELETE ON runs
BEGIN
    UPDATE maps SET revision = revision + 1, changed_ms = CAST(unixepoch('subsec') * 1000 AS INTEGER) WHERE id = OLD.map_id;
END;

CREATE TRIGGER view_added AFTER INSERT ON views
BEGIN
    UPDATE landmarks SET revision = revision + 1, changed_ms = CAST(unixepoch('subsec') * 1000 AS INTEGER) WHERE id = NEW.landmark_id;
END;

CREATE TRIGGER view_deleted AFTER DELETE ON views
BEGIN
    UPDATE landmarks SET revision = revision + 1, changed_ms = CAST(unixepoch('subsec') * 1000 AS INTEGER) WHERE id = OLD.landmark_id;
END;

CREATE TRIGGER model_learnt AFTER INSERT ON models
BEGIN
    UPDATE landmarks SET revision = revision + 1, changed_ms = CAST(unixepoch('subsec') * 1000 AS INTEGER) WHERE id = NEW.landmark_id;
END;

CREATE TRIGGER model_changed AFTER UPDATE OF sha256, active, looks_like ON models
WHEN OLD.sha256 <> NEW.sha256 OR OLD.active <> NEW.active OR OLD.looks_like IS DISTINCT FROM NEW.looks_like
BEGIN
    UPDATE landmarks SET revision = revision + 1, changed_ms = CAST(unixepoch('subsec') * 1000 AS INTEGER) WHERE id = NEW.landmark_id;
END;

CREATE TRIGGER landmark_added AFTER INSERT ON landmarks
BEGIN
    UPDATE maps SET revision = revision + 1, changed_ms = CAST(unixepoch('subsec') * 1000 AS INTEGER) WHERE id = NEW.map_id;
END;

CREATE TRIGGER landmark_deleted AFTER DELETE ON landmarks
BEGIN
    UPDATE maps SET revision = revision + 1, changed_ms = CAST(unixepoch('subsec') * 1000 AS INTEGER) WHERE id = OLD.map_id;
END;

CREATE TRIGGER landmark_changed AFTER UPDATE OF revision ON landmarks
BEGIN
    UPDATE maps SET revision = revision + 1, changed_ms = CAST(unixepoch('subsec') * 1000 AS INTEGER) WHERE id = NEW.map_id;
END;

-- Maps as versions. Each transaction that changes a map is a commit with the rows as they were before it, so that every kept
-- commit can be gone back to. Health and findings are not in it: robots change them by themselves. A landmark that is deleted
-- keeps those that it had. A map that is deleted takes its history along.

-- Numbers rise in time and are never used again. A commit is open until the writer has closed it, in the same transaction.
CREATE TABLE commits (
    id         INTEGER PRIMARY KEY AUTOINCREMENT,
    map_id     INTEGER NOT NULL REFERENCES maps (id) ON DELETE CASCADE,
    -- The commit before it, which may be forgotten.
    parent_id  INTEGER,
    open       INTEGER NOT NULL DEFAULT 1 CHECK (open IN (0, 1)),
    created_ms INTEGER NOT NULL DEFAULT 0,
    -- Name of the token; of a job, that of who asked for it.
    author     TEXT    NOT NULL DEFAULT 'server' CHECK (length(author) BETWEEN 1 AND 64),
    job        INTEGER,
    -- Method and path of the request, or kind of the job.
    operation  TEXT    NOT NULL DEFAULT '' CHECK (length(operation) <= 128),
    why        TEXT    CHECK (length(why) BETWEEN 1 AND 200),
    -- JSON: counts of what changed.
    summary    TEXT    NOT NULL DEFAULT '{}' CHECK (length(summary) <= 8192),
    -- What is stored only because of this commit, about.
    bytes      INTEGER NOT NULL DEFAULT 0 CHECK (bytes >= 0),
    -- The walls before it are in `past_walls`, which may be none.
    walls      INTEGER NOT NULL DEFAULT 0 CHECK (walls IN (0, 1))
) STRICT;

CREATE UNIQUE INDEX open_commit ON commits (map_id) WHERE open = 1;
CREATE INDEX commits_by_map ON commits (map_id, id);

CREATE TRIGGER commit_of_new_map AFTER INSERT ON maps
BEGIN INSERT INTO commits (map_id) VALUES (NEW.id); END;

-- The walls as they were before a commit.
CREATE TABLE past_walls (
    commit_id  INTEGER NOT NULL REFERENCES commits (id) ON DELETE CASCADE,
    ordinal    INTEGER NOT NULL,
    ax_m       REAL    NOT NULL,
    ay_m       REAL    NOT NULL,
    bx_m       REAL    NOT NULL,
    by_m       REAL    NOT NULL,
    covariance BLOB    CHECK (length(covariance) = 24),
    PRIMARY KEY (commit_id, ordinal)
) STRICT, WITHOUT ROWID;
