-- Maps as versions. Each transaction that changes a map is a commit with the rows as they were before it, so that every kept
-- commit can be gone back to. Triggers write it: no writer can forget it, and it stands or falls with its change. Health and
-- findings are not in it: robots change them by themselves. A landmark that is deleted keeps those that it had.

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

INSERT INTO commits (map_id, open, created_ms, operation)
SELECT id, 0, CAST(unixepoch('subsec') * 1000 AS INTEGER), 'upgrade' FROM maps ORDER BY id;

-- Who asked for a job, and why.
ALTER TABLE jobs ADD COLUMN author TEXT NOT NULL DEFAULT 'server' CHECK (length(author) BETWEEN 1 AND 64);
ALTER TABLE jobs ADD COLUMN why TEXT CHECK (length(why) BETWEEN 1 AND 200);

-- Rows as they were before a commit. `present` = 0: there was none, and the other columns are NULL.

CREATE TABLE past_maps (
    commit_id INTEGER NOT NULL REFERENCES commits (id) ON DELETE CASCADE,
    id INTEGER NOT NULL,
    present INTEGER NOT NULL CHECK (present IN (0, 1)),
    name TEXT,
    site TEXT,
    building TEXT,
    floor TEXT,
    parent_id INTEGER,
    parent_from_map BLOB,
    fusion TEXT,
    areas TEXT,
    sight TEXT,
    UNIQUE (commit_id, id)
) STRICT;
CREATE INDEX past_maps_by_row ON past_maps (id, commit_id);
CREATE TABLE past_landmarks (
    commit_id INTEGER NOT NULL REFERENCES commits (id) ON DELETE CASCADE,
    id INTEGER NOT NULL,
    present INTEGER NOT NULL CHECK (present IN (0, 1)),
    name TEXT,
    width_m REAL,
    height_m REAL,
    x_m REAL,
    y_m REAL,
    z_m REAL,
    theta_rad REAL,
    roll_rad REAL,
    tilt_rad REAL,
    place_covariance BLOB,
    size_from_views INTEGER,
    health TEXT,
    finding TEXT,
    created_ms INTEGER,
    revision INTEGER,
    changed_ms INTEGER,
    UNIQUE (commit_id, id)
) STRICT;
CREATE INDEX past_landmarks_by_row ON past_landmarks (id, commit_id);

CREATE TABLE past_views (
    commit_id INTEGER NOT NULL REFERENCES commits (id) ON DELETE CASCADE,
    id INTEGER NOT NULL,
    present INTEGER NOT NULL CHECK (present IN (0, 1)),
    landmark_id INTEGER,
    image_sha256 BLOB REFERENCES pictures (sha256),
    image_kind TEXT,
    width_px INTEGER,
    height_px INTEGER,
    corners_px BLOB,
    created_ms INTEGER,
    icon_side INTEGER,
    icon_scale REAL,
    capture TEXT,
    icon BLOB,
    UNIQUE (commit_id, id)
) STRICT;
CREATE INDEX past_views_by_row ON past_views (id, commit_id);
CREATE INDEX past_views_by_picture ON past_views (image_sha256);

CREATE TABLE past_strangers (
    commit_id INTEGER NOT NULL REFERENCES commits (id) ON DELETE CASCADE,
    id INTEGER NOT NULL,
    present INTEGER NOT NULL CHECK (present IN (0, 1)),
    image_sha256 BLOB,
    corners_px BLOB,
    icon_side INTEGER,
    icon_scale REAL,
    icon BLOB,
    UNIQUE (commit_id, id)
) STRICT;
CREATE INDEX past_strangers_by_row ON past_strangers (id, commit_id);

CREATE TABLE past_models (
    commit_id INTEGER NOT NULL REFERENCES commits (id) ON DELETE CASCADE,
    landmark_id INTEGER NOT NULL,
    present INTEGER NOT NULL CHECK (present IN (0, 1)),
    sha256 BLOB REFERENCES model_contents (sha256),
    params_hash BLOB,
    active INTEGER,
    reasons TEXT,
    facts TEXT,
    views INTEGER,
    generated_views INTEGER,
    learnt_ms INTEGER,
    points_asked INTEGER,
    looks_like TEXT,
    UNIQUE (commit_id, landmark_id)
) STRICT;
CREATE INDEX past_models_by_row ON past_models (landmark_id, commit_id);
CREATE INDEX past_models_by_content ON past_models (sha256);

CREATE TABLE past_runs (
    commit_id INTEGER NOT NULL REFERENCES commits (id) ON DELETE CASCADE,
    id INTEGER NOT NULL,
    present INTEGER NOT NULL CHECK (present IN (0, 1)),
    robot TEXT,
    created_ms INTEGER,
    way_m REAL,
    cells TEXT,
    UNIQUE (commit_id, id)
) STRICT;
CREATE INDEX past_runs_by_row ON past_runs (id, commit_id);

CREATE TABLE past_underlays (
    commit_id INTEGER NOT NULL REFERENCES commits (id) ON DELETE CASCADE,
    map_id INTEGER NOT NULL,
    present INTEGER NOT NULL CHECK (present IN (0, 1)),
    image_sha256 BLOB REFERENCES pictures (sha256),
    image_kind TEXT,
    width_px INTEGER,
    height_px INTEGER,
    metres_per_pixel REAL,
    x_m REAL,
    y_m REAL,
    theta_rad REAL,
    created_ms INTEGER,
    UNIQUE (commit_id, map_id)
) STRICT;
CREATE INDEX past_underlays_by_row ON past_underlays (map_id, commit_id);
CREATE INDEX past_underlays_by_picture ON past_underlays (image_sha256);

CREATE TABLE past_walls (
    commit_id INTEGER NOT NULL REFERENCES commits (id) ON DELETE CASCADE,
    ordinal INTEGER NOT NULL,
    ax_m REAL NOT NULL,
    ay_m REAL NOT NULL,
    bx_m REAL NOT NULL,
    by_m REAL NOT NULL,
    PRIMARY KEY (commit_id, ordinal)
) STRICT, WITHOUT ROWID;
