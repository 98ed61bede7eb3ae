-- Several maps: where each belongs, for people, and where it lies, for poses.

ALTER TABLE maps ADD COLUMN site TEXT CHECK (length(site) BETWEEN 1 AND 64);
ALTER TABLE maps ADD COLUMN building TEXT CHECK (length(building) BETWEEN 1 AND 64);
ALTER TABLE maps ADD COLUMN floor TEXT CHECK (length(floor) BETWEEN 1 AND 64);
-- The map in whose frame this one lies. No action: a map that others lie in is not deleted.
ALTER TABLE maps ADD COLUMN parent_id INTEGER REFERENCES maps (id);
-- x, y, theta, level, then the covariance of the first three row by row: 13 little-endian f64, exact, read as a whole.
ALTER TABLE maps ADD COLUMN parent_from_map BLOB CHECK (length(parent_from_map) = 104
    AND (parent_id IS NULL) = (parent_from_map IS NULL));

CREATE INDEX maps_by_parent ON maps (parent_id);
