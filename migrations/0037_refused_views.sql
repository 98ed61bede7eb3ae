-- Photographs that were not taken for a landmark, or not in its last lesson, and why. The newest of a bounded number for each
-- landmark (MAX_REFUSED of server/src/store/refused_views.rs). In no history: it is no part of the map.
CREATE TABLE refused_views (
    id          INTEGER PRIMARY KEY AUTOINCREMENT,
    landmark_id INTEGER NOT NULL REFERENCES landmarks (id) ON DELETE CASCADE,
    refused_ms  INTEGER NOT NULL,
    -- 'upload' or 'lesson'.
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
