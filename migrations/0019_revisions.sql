-- Revisions: what an editor has seen is compared with what is there (`If-Match`). They count edits and lessons, and nothing
-- that robots do by themselves (health, findings). Triggers count: no writer can forget it.

-- Of the map and of all that is in it.
ALTER TABLE maps ADD COLUMN revision INTEGER NOT NULL DEFAULT 1 CHECK (revision >= 1);
-- Of the picture under it.
ALTER TABLE maps ADD COLUMN underlay_revision INTEGER NOT NULL DEFAULT 1 CHECK (underlay_revision >= 1);
-- Of name, size, place, views and model. A person's word on the health comes with an update of size and place.
ALTER TABLE landmarks ADD COLUMN revision INTEGER NOT NULL DEFAULT 1 CHECK (revision >= 1);

-- When the revision changed last, ms since the Unix epoch: for people, who sort by it.
ALTER TABLE maps ADD COLUMN changed_ms INTEGER NOT NULL DEFAULT 0;
ALTER TABLE landmarks ADD COLUMN changed_ms INTEGER NOT NULL DEFAULT 0;
UPDATE maps SET changed_ms = created_ms;
UPDATE landmarks SET changed_ms = created_ms;

CREATE TRIGGER map_edited AFTER UPDATE OF name, site, building, floor, parent_id, parent_from_map, walls_version, sight, fusion, areas,
    underlay_revision ON maps
BEGIN
    UPDATE maps SET revision = revision + 1, changed_ms = CAST(unixepoch('subsec') * 1000 AS INTEGER) WHERE id = NEW.id;
END;

CREATE TRIGGER underlay_put AFTER INSERT ON underlays
BEGIN UPDATE maps SET underlay_revision = underlay_revision + 1 WHERE id = NEW.map_id; END;

CREATE TRIGGER underlay_replaced AFTER UPDATE ON underlays
BEGIN UPDATE maps SET underlay_revision = underlay_revision + 1 WHERE id = NEW.map_id; END;

CREATE TRIGGER underlay_deleted AFTER DELETE ON underlays
BEGIN UPDATE maps SET underlay_revision = underlay_revision + 1 WHERE id = OLD.map_id; END;

CREATE TRIGGER run_added AFTER INSERT ON runs
BEGIN
    UPDATE maps SET revision = revision + 1, changed_ms = CAST(unixepoch('subsec') * 1000 AS INTEGER) WHERE id = NEW.map_id;
END;

CREATE TRIGGER run_deleted AFTER DELETE ON runs
BEGIN
    UPDATE maps SET revision = revision + 1, changed_ms = CAST(unixepoch('subsec') * 1000 AS INTEGER) WHERE id = OLD.map_id;
END;

CREATE TRIGGER landmark_edited AFTER UPDATE OF name, width_m, height_m, x_m, y_m, z_m, theta_rad, roll_rad, tilt_rad,
    place_covariance, size_from_views ON landmarks
BEGIN
    UPDATE landmarks SET revision = revision + 1, changed_ms = CAST(unixepoch('subsec') * 1000 AS INTEGER) WHERE id = NEW.id;
END;

CREATE TRIGGER view_added AFTER INSERT ON views
BEGIN
    UPDATE landmarks SET revision = revision + 1, changed_ms = CAST(unixepoch('subsec') * 1000 AS INTEGER) WHERE id = NEW.landmark_id;
END;

CREATE TRIGGER view_deleted AFTER DELETE ON views
BEGIN
    UPDATE landmarks SET revision = revision + 1, changed_ms = CAST(unixepoch('subsec') * 1000 AS INTEGER) WHERE id = OLD.landmark_id;
END;

CREATE TRIGGER model_learnt AFTER INSERT ON models
BEGIN
    UPDATE landmarks SET revision = revision + 1, changed_ms = CAST(unixepoch('subsec') * 1000 AS INTEGER) WHERE id = NEW.landmark_id;
END;

CREATE TRIGGER model_changed AFTER UPDATE OF sha256, active, looks_like ON models
WHEN OLD.sha256 <> NEW.sha256 OR OLD.active <> NEW.active OR OLD.looks_like IS NOT NEW.looks_like
BEGIN
    UPDATE landmarks SET revision = revision + 1, changed_ms = CAST(unixepoch('subsec') * 1000 AS INTEGER) WHERE id = NEW.landmark_id;
END;

CREATE TRIGGER landmark_added AFTER INSERT ON landmarks
BEGIN
    UPDATE maps SET revision = revision + 1, changed_ms = CAST(unixepoch('subsec') * 1000 AS INTEGER) WHERE id = NEW.map_id;
END;

CREATE TRIGGER landmark_deleted AFTER DELETE ON landmarks
BEGIN
    UPDATE maps SET revision = revision + 1, changed_ms = CAST(unixepoch('subsec') * 1000 AS INTEGER) WHERE id = OLD.map_id;
END;

CREATE TRIGGER landmark_changed AFTER UPDATE OF revision ON landmarks
BEGIN
    UPDATE maps SET revision = revision + 1, changed_ms = CAST(unixepoch('subsec') * 1000 AS INTEGER) WHERE id = NEW.map_id;
END;
