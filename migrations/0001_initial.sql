-- The first schema. All tables are STRICT: a value of the wrong type is an error here, not a surprise at the next read.
-- Times are ms since the Unix epoch by the server's clock; they are shown, never used for order.

-- Integer keys stay inside the server; people and robots use names. AUTOINCREMENT, so that a number that stood in an
-- answer or a log never comes to mean something else.
CREATE TABLE maps (
    id         INTEGER PRIMARY KEY AUTOINCREMENT,
    name       TEXT    NOT NULL UNIQUE CHECK (length(name) BETWEEN 1 AND 64),
    -- Counts up with every change that an answer could depend on; every answer quotes it.
    version    INTEGER NOT NULL DEFAULT 1 CHECK (version >= 1),
    distance   TEXT    NOT NULL CHECK (distance IN ('both', 'correlation', 'hausdorff')),
    created_ms INTEGER NOT NULL
) STRICT;

CREATE TABLE landmarks (
    id         INTEGER PRIMARY KEY AUTOINCREMENT,
    map_id     INTEGER NOT NULL REFERENCES maps (id) ON DELETE CASCADE,
    name       TEXT    NOT NULL CHECK (length(name) BETWEEN 1 AND 64),
    -- Size and place are measured separately and often later than the appearance; each is whole or absent.
    width_m    REAL,
    height_m   REAL,
    x_m        REAL,
    y_m        REAL,
    z_m        REAL,
    theta_rad  REAL,
    created_ms INTEGER NOT NULL,
    CHECK ((width_m IS NULL) = (height_m IS NULL)),
    CHECK ((x_m IS NULL) = (y_m IS NULL) AND (x_m IS NULL) = (z_m IS NULL) AND (x_m IS NULL) = (theta_rad IS NULL)),
    -- Also the index that pages through a map's landmarks by name.
    UNIQUE (map_id, name)
) STRICT;

-- A view keeps the picture as it came, not only the icon: when the icon or the generated views are computed
-- differently one day, everything can be learnt again without walking through the building with a camera.
CREATE TABLE views (
    id           INTEGER PRIMARY KEY AUTOINCREMENT,
    landmark_id  INTEGER NOT NULL REFERENCES landmarks (id) ON DELETE CASCADE,
    -- Names the image; with the corners it makes a repeated upload the same view instead of a second one.
    image_sha256 BLOB    NOT NULL CHECK (length(image_sha256) = 32),
    image_kind   TEXT    NOT NULL CHECK (image_kind IN ('png', 'jpeg')),
    -- Bounded a second time here: no code path may fill the disk with one row.
    image        BLOB    NOT NULL CHECK (length(image) BETWEEN 1 AND 67108864),
    width_px     INTEGER NOT NULL,
    height_px    INTEGER NOT NULL,
    -- Eight little-endian f64 (u, v of TL, TR, BR, BL): exact, unlike decimal text.
    corners_px   BLOB    NOT NULL CHECK (length(corners_px) = 64),
    -- Side of the icon and its grey levels, one byte each, as learning rounds them: learning a whole map again
    -- decodes no image.
    icon_side    INTEGER NOT NULL CHECK (icon_side BETWEEN 1 AND 1024),
    icon         BLOB    NOT NULL CHECK (length(icon) = icon_side * icon_side),
    icon_scale   REAL    NOT NULL,
    created_ms   INTEGER NOT NULL,
    UNIQUE (landmark_id, image_sha256, corners_px)
) STRICT;

-- Quads seen in uploaded pictures that are not the landmark taught: what the building has besides landmarks. They
-- are the strangers that thresholds must keep out. Tied to the map, because they outlive the view.
CREATE TABLE strangers (
    id           INTEGER PRIMARY KEY AUTOINCREMENT,
    map_id       INTEGER NOT NULL REFERENCES maps (id) ON DELETE CASCADE,
    -- To leave out what later turns out to be a landmark in the very same picture.
    image_sha256 BLOB    NOT NULL CHECK (length(image_sha256) = 32),
    corners_px   BLOB    NOT NULL CHECK (length(corners_px) = 64),
    icon_side    INTEGER NOT NULL CHECK (icon_side BETWEEN 1 AND 1024),
    icon         BLOB    NOT NULL CHECK (length(icon) = icon_side * icon_side),
    icon_scale   REAL    NOT NULL,
    UNIQUE (map_id, image_sha256, corners_px)
) STRICT;

-- One model per landmark; learning replaces it whole. The digest finds a damaged blob, the hash of the distance
-- parameters finds a threshold that no longer means anything: both are named and never matched.
CREATE TABLE models (
    landmark_id     INTEGER PRIMARY KEY REFERENCES landmarks (id) ON DELETE CASCADE,
    model           BLOB    NOT NULL,
    sha256          BLOB    NOT NULL CHECK (length(sha256) = 32),
    -- 8 bytes little-endian: a u64 does not fit SQLite's signed integer.
    params_hash     BLOB    NOT NULL CHECK (length(params_hash) = 8),
    active          INTEGER NOT NULL CHECK (active IN (0, 1)),
    -- JSON list of what keeps a candidate from being active.
    reasons         TEXT    NOT NULL,
    -- JSON object for people: thresholds and figures of the learning. Lists are shown without opening any model.
    facts           TEXT    NOT NULL,
    views           INTEGER NOT NULL,
    generated_views INTEGER NOT NULL,
    learnt_ms       INTEGER NOT NULL
) STRICT;

-- Walls as laser segments; replaced as a whole, read as a whole, so plain rows in their order.
CREATE TABLE laser_segments (
    map_id  INTEGER NOT NULL REFERENCES maps (id) ON DELETE CASCADE,
    ordinal INTEGER NOT NULL,
    ax_m    REAL    NOT NULL,
    ay_m    REAL    NOT NULL,
    bx_m    REAL    NOT NULL,
    by_m    REAL    NOT NULL,
    PRIMARY KEY (map_id, ordinal)
) STRICT, WITHOUT ROWID;

-- A robot stands on exactly one map. RESTRICT: a map cannot be pulled from under a robot.
CREATE TABLE robots (
    name       TEXT    PRIMARY KEY CHECK (length(name) BETWEEN 1 AND 64),
    map_id     INTEGER NOT NULL REFERENCES maps (id) ON DELETE RESTRICT,
    created_ms INTEGER NOT NULL
) STRICT;

CREATE INDEX robots_by_map ON robots (map_id);

-- Jobs are rows because a 202 is a promise: what was accepted is still there after a crash and is run again. Progress
-- is not stored, it would be a write per step. The map's name is copied so that a job outlives its map.
CREATE TABLE jobs (
    id         INTEGER PRIMARY KEY AUTOINCREMENT,
    kind       TEXT    NOT NULL CHECK (kind IN ('learn')),
    map        TEXT    NOT NULL,
    request    TEXT    NOT NULL,
    state      TEXT    NOT NULL CHECK (state IN ('queued', 'running', 'done', 'failed', 'cancelled')),
    message    TEXT    NOT NULL DEFAULT '',
    result     TEXT,
    created_ms INTEGER NOT NULL,
    ended_ms   INTEGER
) STRICT;

CREATE INDEX jobs_by_state ON jobs (state, id);
