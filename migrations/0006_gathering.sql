-- Views gathered while a robot drives past: they lie here until a person accepts them or throws them away. Nothing of
-- this is matched; a landmark is made of them only by that decision.

-- The robot's name is copied: what it brought home outlives it.
CREATE TABLE gatherings (
    id          INTEGER PRIMARY KEY AUTOINCREMENT,
    map_id      INTEGER NOT NULL REFERENCES maps (id) ON DELETE CASCADE,
    robot       TEXT    NOT NULL CHECK (length(robot) BETWEEN 1 AND 64),
    -- Only views of this landmark; NULL: of whatever is no landmark yet.
    landmark_id INTEGER REFERENCES landmarks (id) ON DELETE CASCADE,
    -- Also views of every landmark that is recognised.
    known       INTEGER NOT NULL CHECK (known IN (0, 1)),
    open        INTEGER NOT NULL CHECK (open IN (0, 1)),
    -- JSON, of the whole drive; written when it ends.
    counts      TEXT    NOT NULL DEFAULT '{}' CHECK (length(counts) <= 4096),
    created_ms  INTEGER NOT NULL,
    ended_ms    INTEGER
) STRICT;

-- A robot gathers for one purpose at a time.
CREATE UNIQUE INDEX gathering_of_robot ON gatherings (robot) WHERE open = 1;
CREATE INDEX gatherings_by_map ON gatherings (map_id, id);

-- One thing that was followed. A decision keeps the row and removes the views: its number must not come to mean another.
CREATE TABLE tracks (
    gathering_id INTEGER NOT NULL REFERENCES gatherings (id) ON DELETE CASCADE,
    number       INTEGER NOT NULL CHECK (number >= 1),
    landmark_id  INTEGER REFERENCES landmarks (id) ON DELETE CASCADE,
    state        TEXT    NOT NULL DEFAULT 'open' CHECK (state IN ('open', 'accepted', 'discarded')),
    sightings    INTEGER NOT NULL,
    -- Sightings in which it was taken for a landmark of the map, or nearly.
    known        INTEGER NOT NULL,
    PRIMARY KEY (gathering_id, number)
) STRICT, WITHOUT ROWID;

-- As in `views`, and moved there by an acceptance.
CREATE TABLE track_views (
    id           INTEGER PRIMARY KEY AUTOINCREMENT,
    gathering_id INTEGER NOT NULL,
    track        INTEGER NOT NULL,
    image_sha256 BLOB    NOT NULL CHECK (length(image_sha256) = 32),
    image_kind   TEXT    NOT NULL CHECK (image_kind IN ('png', 'jpeg')),
    image        BLOB    NOT NULL CHECK (length(image) BETWEEN 1 AND 67108864),
    width_px     INTEGER NOT NULL,
    height_px    INTEGER NOT NULL,
    corners_px   BLOB    NOT NULL CHECK (length(corners_px) = 64),
    icon_side    INTEGER NOT NULL CHECK (icon_side BETWEEN 1 AND 1024),
    icon         BLOB    NOT NULL CHECK (length(icon) = icon_side * icon_side),
    icon_scale   REAL    NOT NULL,
    created_ms   INTEGER NOT NULL,
    capture      TEXT CHECK (length(capture) <= 8192),
    FOREIGN KEY (gathering_id, track) REFERENCES tracks (gathering_id, number) ON DELETE CASCADE,
    UNIQUE (gathering_id, track, image_sha256, corners_px)
) STRICT;
