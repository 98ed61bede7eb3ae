-- Walls, floor plan and reference runs of a map.

-- Walls as laser segments; replaced as a whole, read as a whole, so plain rows in their order.
CREATE TABLE laser_segments (
    map_id     INTEGER NOT NULL REFERENCES maps (id) ON DELETE CASCADE,
    ordinal    INTEGER NOT NULL,
    ax_m       REAL    NOT NULL,
    ay_m       REAL    NOT NULL,
    bx_m       REAL    NOT NULL,
    by_m       REAL    NOT NULL,
    -- What is known of a wall besides its ends: covariance of its direction and its offset to the free side, about its middle
    -- (rad^2, rad m, m^2), as three little-endian numbers of 8 bytes. NULL: measured by hand.
    covariance BLOB    CHECK (length(covariance) = 24),
    PRIMARY KEY (map_id, ordinal)
) STRICT, WITHOUT ROWID;

-- The picture that a map was imported from, shown under it. At most one; it goes with its map.
CREATE TABLE underlays (
    map_id           INTEGER PRIMARY KEY REFERENCES maps (id) ON DELETE CASCADE,
    image_sha256     BLOB    NOT NULL REFERENCES pictures (sha256) CHECK (length(image_sha256) = 32),
    image_kind       TEXT    NOT NULL CHECK (image_kind IN ('png', 'jpeg')),
    width_px         INTEGER NOT NULL CHECK (width_px >= 1),
    height_px        INTEGER NOT NULL CHECK (height_px >= 1),
    metres_per_pixel REAL    NOT NULL CHECK (metres_per_pixel > 0),
    -- map_from_picture: the lower left corner of the lower left pixel, x to the right, y up.
    x_m              REAL    NOT NULL,
    y_m              REAL    NOT NULL,
    theta_rad        REAL    NOT NULL,
    created_ms       INTEGER NOT NULL
) STRICT;

CREATE INDEX underlays_by_picture ON underlays (image_sha256);

-- Runs whose path is known, and what they have shown of odometry, laser and landmarks. The robot's name is copied: what it
-- showed outlives it. Sums by cell, so that a run can be taken away again.
CREATE TABLE runs (
    id         INTEGER PRIMARY KEY AUTOINCREMENT,
    map_id     INTEGER NOT NULL REFERENCES maps (id) ON DELETE CASCADE,
    robot      TEXT    NOT NULL CHECK (length(robot) BETWEEN 1 AND 64),
    created_ms INTEGER NOT NULL,
    way_m      REAL    NOT NULL CHECK (way_m >= 0),
    -- JSON: pairs of cell and evidence.
    cells      TEXT    NOT NULL CHECK (length(cells) <= 16777216)
) STRICT;

CREATE INDEX runs_by_map ON runs (map_id, id);
