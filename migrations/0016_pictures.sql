-- Pictures are stored once, by content, in a table of their own. Their kind and size stay with what refers to them, so that
-- lists, icons and lessons open no page of this table, and the check at the start leaves it out.
CREATE TABLE pictures (
    sha256 BLOB NOT NULL PRIMARY KEY CHECK (length(sha256) = 32),
    bytes  BLOB NOT NULL CHECK (length(bytes) BETWEEN 1 AND 67108864)
) STRICT;

-- Pictures whose bytes are not those of their digest any more. They are not used and not deleted; the same picture,
-- uploaded again, mends them.
CREATE TABLE damaged_pictures (
    sha256   BLOB    NOT NULL PRIMARY KEY CHECK (length(sha256) = 32),
    reason   TEXT    NOT NULL CHECK (length(reason) <= 1024),
    found_ms INTEGER NOT NULL
) STRICT;

INSERT INTO pictures (sha256, bytes) SELECT image_sha256, image FROM views WHERE true ON CONFLICT DO NOTHING;
INSERT INTO pictures (sha256, bytes) SELECT image_sha256, image FROM track_views WHERE true ON CONFLICT DO NOTHING;

-- What is large comes last: a row is read from its beginning.
CREATE TABLE new_views (
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
    icon_side    INTEGER NOT NULL CHECK (icon_side BETWEEN 1 AND 1024),
    icon_scale   REAL    NOT NULL,
    capture      TEXT CHECK (length(capture) <= 8192),
    icon         BLOB    NOT NULL CHECK (length(icon) = icon_side * icon_side),
    UNIQUE (landmark_id, image_sha256, corners_px)
) STRICT;
INSERT INTO new_views (id, landmark_id, image_sha256, image_kind, width_px, height_px, corners_px, created_ms, icon_side,
    icon_scale, capture, icon)
SELECT id, landmark_id, image_sha256, image_kind, width_px, height_px, corners_px, created_ms, icon_side, icon_scale, capture,
    icon
FROM views ORDER BY id;
-- Numbers of deleted views are not used again.
DELETE FROM sqlite_sequence WHERE name = 'new_views';
INSERT INTO sqlite_sequence (name, seq) SELECT 'new_views', seq FROM sqlite_sequence WHERE name = 'views';
DROP TABLE views;
ALTER TABLE new_views RENAME TO views;
CREATE INDEX views_by_picture ON views (image_sha256);

CREATE TABLE new_track_views (
    id           INTEGER PRIMARY KEY AUTOINCREMENT,
    gathering_id INTEGER NOT NULL,
    track        INTEGER NOT NULL,
    image_sha256 BLOB    NOT NULL REFERENCES pictures (sha256) CHECK (length(image_sha256) = 32),
    image_kind   TEXT    NOT NULL CHECK (image_kind IN ('png', 'jpeg')),
    width_px     INTEGER NOT NULL,
    height_px    INTEGER NOT NULL,
    corners_px   BLOB    NOT NULL CHECK (length(corners_px) = 64),
    created_ms   INTEGER NOT NULL,
    icon_side    INTEGER NOT NULL CHECK (icon_side BETWEEN 1 AND 1024),
    icon_scale   REAL    NOT NULL,
    capture      TEXT CHECK (length(capture) <= 8192),
    icon         BLOB    NOT NULL CHECK (length(icon) = icon_side * icon_side),
    FOREIGN KEY (gathering_id, track) REFERENCES tracks (gathering_id, number) ON DELETE CASCADE,
    UNIQUE (gathering_id, track, image_sha256, corners_px)
) STRICT;
INSERT INTO new_track_views (id, gathering_id, track, image_sha256, image_kind, width_px, height_px, corners_px, created_ms,
    icon_side, icon_scale, capture, icon)
SELECT id, gathering_id, track, image_sha256, image_kind, width_px, height_px, corners_px, created_ms, icon_side, icon_scale,
    capture, icon
FROM track_views ORDER BY id;
DELETE FROM sqlite_sequence WHERE name = 'new_track_views';
INSERT INTO sqlite_sequence (name, seq) SELECT 'new_track_views', seq FROM sqlite_sequence WHERE name = 'track_views';
DROP TABLE track_views;
ALTER TABLE new_track_views RENAME TO track_views;
CREATE INDEX track_views_by_picture ON track_views (image_sha256);

-- SQLite computes no SHA-256: a picture stored before stays in `image` until the server has moved it, right after this step.
CREATE TABLE new_underlays (
    map_id           INTEGER PRIMARY KEY REFERENCES maps (id) ON DELETE CASCADE,
    image_sha256     BLOB    REFERENCES pictures (sha256) CHECK (length(image_sha256) = 32),
    image_kind       TEXT    NOT NULL CHECK (image_kind IN ('png', 'jpeg')),
    width_px         INTEGER NOT NULL CHECK (width_px >= 1),
    height_px        INTEGER NOT NULL CHECK (height_px >= 1),
    metres_per_pixel REAL    NOT NULL CHECK (metres_per_pixel > 0),
    -- map_from_picture: the lower left corner of the lower left pixel, x to the right, y up.
    x_m              REAL    NOT NULL,
    y_m              REAL    NOT NULL,
    theta_rad        REAL    NOT NULL,
    created_ms       INTEGER NOT NULL,
    image            BLOB    CHECK (length(image) BETWEEN 1 AND 67108864),
    CHECK ((image IS NULL) <> (image_sha256 IS NULL))
) STRICT;
INSERT INTO new_underlays (map_id, image_kind, width_px, height_px, metres_per_pixel, x_m, y_m, theta_rad, created_ms, image)
SELECT map_id, image_kind, width_px, height_px, metres_per_pixel, x_m, y_m, theta_rad, created_ms, image FROM underlays;
DROP TABLE underlays;
ALTER TABLE new_underlays RENAME TO underlays;
CREATE INDEX underlays_by_picture ON underlays (image_sha256);

-- A picture goes with the last row that refers to it, also where a cascade deletes that row.
CREATE TRIGGER picture_after_view AFTER DELETE ON views BEGIN
    DELETE FROM pictures WHERE sha256 = old.image_sha256
        AND NOT EXISTS (SELECT 1 FROM views WHERE image_sha256 = old.image_sha256)
        AND NOT EXISTS (SELECT 1 FROM track_views WHERE image_sha256 = old.image_sha256)
        AND NOT EXISTS (SELECT 1 FROM underlays WHERE image_sha256 = old.image_sha256)
        AND NOT EXISTS (SELECT 1 FROM damaged_pictures WHERE sha256 = old.image_sha256);
END;
CREATE TRIGGER picture_after_track_view AFTER DELETE ON track_views BEGIN
    DELETE FROM pictures WHERE sha256 = old.image_sha256
        AND NOT EXISTS (SELECT 1 FROM views WHERE image_sha256 = old.image_sha256)
        AND NOT EXISTS (SELECT 1 FROM track_views WHERE image_sha256 = old.image_sha256)
        AND NOT EXISTS (SELECT 1 FROM underlays WHERE image_sha256 = old.image_sha256)
        AND NOT EXISTS (SELECT 1 FROM damaged_pictures WHERE sha256 = old.image_sha256);
END;
CREATE TRIGGER picture_after_underlay AFTER DELETE ON underlays BEGIN
    DELETE FROM pictures WHERE sha256 = old.image_sha256
        AND NOT EXISTS (SELECT 1 FROM views WHERE image_sha256 = old.image_sha256)
        AND NOT EXISTS (SELECT 1 FROM track_views WHERE image_sha256 = old.image_sha256)
        AND NOT EXISTS (SELECT 1 FROM underlays WHERE image_sha256 = old.image_sha256)
        AND NOT EXISTS (SELECT 1 FROM damaged_pictures WHERE sha256 = old.image_sha256);
END;
CREATE TRIGGER picture_after_replaced_underlay AFTER UPDATE OF image_sha256 ON underlays
WHEN old.image_sha256 IS NOT new.image_sha256 BEGIN
    DELETE FROM pictures WHERE sha256 = old.image_sha256
        AND NOT EXISTS (SELECT 1 FROM views WHERE image_sha256 = old.image_sha256)
        AND NOT EXISTS (SELECT 1 FROM track_views WHERE image_sha256 = old.image_sha256)
        AND NOT EXISTS (SELECT 1 FROM underlays WHERE image_sha256 = old.image_sha256)
        AND NOT EXISTS (SELECT 1 FROM damaged_pictures WHERE sha256 = old.image_sha256);
END;
