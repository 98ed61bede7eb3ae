-- The picture that a map was imported from, shown under it. At most one; it goes with its map.
CREATE TABLE underlays (
    map_id           INTEGER PRIMARY KEY REFERENCES maps (id) ON DELETE CASCADE,
    image            BLOB    NOT NULL CHECK (length(image) BETWEEN 1 AND 67108864),
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
