-- Runs whose path is known, and what they have shown of odometry, laser and landmarks; areas that somebody named; what is
-- fused.

ALTER TABLE maps ADD COLUMN fusion TEXT NOT NULL DEFAULT 'all' CHECK (fusion IN ('all', 'fuse', 'single'));
-- JSON: name and corners of each.
ALTER TABLE maps ADD COLUMN areas TEXT NOT NULL DEFAULT '[]' CHECK (length(areas) <= 262144);

-- The robot's name is copied: what it showed outlives it. Sums by cell, so that a run can be taken away again.
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
