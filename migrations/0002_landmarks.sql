-- Landmarks with their views and models, and the pictures that all refer to.

-- Pictures are stored once, by content, in a table of their own. Their kind and size stay with what refers to them, so that
-- lists, icons and lessons open no page of this table, and the check at the start leaves it out.
CREATE TABLE pictures (
    sha256 BLOB NOT NULL PRIMARY KEY CHECK (length(sha256) = 32),
    -- Bounded a second time here: no code path may fill the disk with one row.
    bytes  BLOB NOT NULL CHECK (length(bytes) BETWEEN 1 AND 67108864)
) STRICT;

-- Pictures whose bytes are not those of their digest. They are not used and not deleted; the same picture, uploaded again,
-- mends them.
CREATE TABLE damaged_pictures (
    sha256   BLOB    NOT NULL PRIMARY KEY CHECK (length(sha256) = 32),
    reason   TEXT    NOT NULL CHECK (length(reason) <= 1024),
    found_ms INTEGER NOT NULL
) STRICT;

CREATE TABLE landmarks (
    id               INTEGER PRIMARY KEY AUTOINCREMENT,
    map_id           INTEGER NOT NULL REFERENCES maps (id) ON DELETE CASCADE,
    name             TEXT    NOT NULL CHECK (length(name) BETWEEN 1 AND 64),
    -- Size and place are measured separately and often later than the appearance; each is whole or absent.
    width_m          REAL,
    height_m         REAL,
    x_m              REAL,
    y_m              REAL,
    z_m              REAL,
    theta_rad        REAL,
    -- Turn about the outward normal, and of the normal downwards (pi/2 under a ceiling); NULL is 0.
    roll_rad         REAL,
    tilt_rad         REAL,
    -- 36 little-endian f64, row by row, over (x, y, theta, z, width, height): exact, and read as a whole. NULL: the place was
    -- given by hand, and is as sure as a tape.
    place_covariance BLOB    CHECK (length(place_covariance) = 288),
    -- The size was found with the place, and is found again with it; a size by hand stays.
    size_from_views  INTEGER CHECK (size_from_views IN (0, 1)),
    -- What robots find out about it: moved or missing. The last finding is kept as JSON so that a person can decide; a column,
    -- not a table, because only the present health is acted on.
    health           TEXT    NOT NULL DEFAULT 'sound' CHECK (health IN ('sound', 'flagged', 'quarantined')),
    finding          TEXT,
    -- JSON: weights and gates of its own, with the reason; NULL: those of the map.
    learning         TEXT    CHECK (length(learning) <= 1024),
    created_ms       INTEGER NOT NULL,
    -- Of name, size, place, views, learning and model. A person's word on the health comes with an update of size and place.
    revision         INTEGER NOT NULL DEFAULT 1 CHECK (revision >= 1),
    changed_ms       INTEGER NOT NULL DEFAULT 0,
    CHECK ((width_m IS NULL) = (height_m IS NULL)),
    CHECK ((x_m IS NULL) = (y_m IS NULL) AND (x_m IS NULL) = (z_m IS NULL) AND (x_m IS NULL) = (theta_rad IS NULL)),
    -- Also the index that pages through a map's landmarks by name.
    UNIQUE (map_id, name)
) STRICT;

-- A view keeps the picture as it came, not only the icon: when the icon or the generated views are computed
-- differently one day, everything can be learnt again without walking through the building with a camera. What is large comes
-- last: a row is read from its beginning.
CREATE TABLE views (
    id           INTEGER PRIMARY KEY AUTOINCREMENT,
    landmark_id  INTEGER NOT NULL REFERENCES landmarks (id) ON DELETE CASCADE,
    -- With the corners it makes a repeated upload the same view instead of a second one.
    image_sha256 BLOB    NOT NULL REFERENCES pictures (sha256) CHECK (length(image_sha256) = 32),
    image_kind   TEXT    NOT NULL CHECK (image_kind IN ('png', 'jpeg')),
    width_px     INTEGER NOT NULL,
    height_px    INTEGER NOT NULL,
    -- Eight little-endian f64 (u, v of TL, TR, BR, BL): exact, unlike decimal text.
    corners_px   BLOB    NOT NULL CHECK (length(corners_px) = 64),
    created_ms   INTEGER NOT NULL,
    -- Side of the icon and its grey levels, one byte each, as learning rounds them: learning a whole map again decodes no image.
    icon_side    INTEGER NOT NULL CHECK (icon_side BETWEEN 1 AND 1024),
    icon_scale   REAL    NOT NULL,
    -- JSON: intrinsics, where the robot stood and where the camera sat when the picture was taken; checked when it came.
    capture      TEXT    CHECK (length(capture) <= 8192),
    icon         BLOB    NOT NULL CHECK (length(icon) = icon_side * icon_side),
    UNIQUE (landmark_id, image_sha256, corners_px)
) STRICT;

CREATE INDEX views_by_picture ON views (image_sha256);

-- Quads seen in uploaded pictures that are not the landmark taught: what the building has besides landmarks. They
-- are the strangers that thresholds must keep out. Tied to the map, because they outlive the view.
CREATE TABLE strangers (
    id           INTEGER PRIMARY KEY AUTOINCREMENT,
    map_id       INTEGER NOT NULL REFERENCES maps (id) ON DELETE CASCADE,
    -- To leave out what later turns out to be a landmark in the very same picture.
    image_sha256 BLOB    NOT NULL CHECK (length(image_sha256) = 32),
    corners_px   BLOB    NOT NULL CHECK (length(corners_px) = 64),
    icon_side    INTEGER NOT NULL CHECK (icon_side BETWEEN 1 AND 1024),
    icon_scale   REAL    NOT NULL,
    icon         BLOB    NOT NULL CHECK (length(icon) = icon_side * icon_side),
    UNIQUE (map_id, image_sha256, corners_px)
) STRICT;

-- Photographs that were not taken for a landmark, or not in its last lesson, and why. The newest of a bounded number for each
-- landmark (MAX_REFUSED of server/src/store/refused_views.rs). In no history: it is no part of the map.
CREATE TABLE refused_views (
    id          INTEGER PRIMARY KEY AUTOINCREMENT,
    landmark_id INTEGER NOT NULL REFERENCES landmarks (id) ON DELETE CASCADE,
    refused_ms  INTEGER NOT NULL,
    refused_by  TEXT    NOT NULL CHECK (refused_by IN ('upload', 'lesson')),
    -- A code, as the refusal of the upload has it.
    reason      TEXT    NOT NULL CHECK (length(reason) <= 64),
    -- The view that it repeats, or that the lesson left out. No reference: it may be deleted.
    view_id     INTEGER,
    -- A small grey picture of it, if it could be decoded.
    width_px    INTEGER CHECK (width_px BETWEEN 1 AND 256),
    height_px   INTEGER CHECK (height_px BETWEEN 1 AND 256),
    grey        BLOB    CHECK (length(grey) = width_px * height_px)
) STRICT;

CREATE INDEX refused_views_by_landmark ON refused_views (landmark_id, id);

-- Visibility areas of landmarks: computed, not given, so they are in no history. One is used while `inputs_sha256` is the
-- digest of everything that it depends on; a row that is missing or of other inputs is computed again.
CREATE TABLE visibility_areas (
    landmark_id   INTEGER PRIMARY KEY REFERENCES landmarks (id) ON DELETE CASCADE,
    inputs_sha256 BLOB    NOT NULL CHECK (length(inputs_sha256) = 32),
    area          BLOB    NOT NULL CHECK (length(area) <= 262144)
) STRICT;
