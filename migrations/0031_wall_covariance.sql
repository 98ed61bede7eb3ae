-- What is known of a wall besides its ends: covariance of its direction and its offset to the free side, about its middle
-- (rad^2, rad m, m^2), as three little-endian numbers of 8 bytes. NULL: measured by hand.
ALTER TABLE laser_segments ADD COLUMN covariance BLOB CHECK (length(covariance) = 24);
ALTER TABLE past_walls ADD COLUMN covariance BLOB CHECK (length(covariance) = 24);

DROP TRIGGER walls_before_insert;
CREATE TRIGGER walls_before_insert BEFORE INSERT ON laser_segments
WHEN EXISTS (SELECT 1 FROM maps WHERE id = NEW.map_id)
    AND NOT EXISTS (SELECT 1 FROM commits WHERE open = 1 AND map_id = NEW.map_id AND walls = 1)
BEGIN
    INSERT INTO commits (map_id) SELECT id FROM maps WHERE id = NEW.map_id
        AND NOT EXISTS (SELECT 1 FROM commits WHERE open = 1 AND map_id = maps.id);
    INSERT INTO past_walls (commit_id, ordinal, ax_m, ay_m, bx_m, by_m, covariance)
    SELECT c.id, s.ordinal, s.ax_m, s.ay_m, s.bx_m, s.by_m, s.covariance FROM commits c JOIN laser_segments s ON s.map_id = c.map_id
    WHERE c.open = 1 AND c.map_id = NEW.map_id;
    UPDATE commits SET walls = 1 WHERE open = 1 AND map_id = NEW.map_id;
END;

DROP TRIGGER walls_before_update;
CREATE TRIGGER walls_before_update BEFORE UPDATE ON laser_segments
WHEN EXISTS (SELECT 1 FROM maps WHERE id = OLD.map_id)
    AND NOT EXISTS (SELECT 1 FROM commits WHERE open = 1 AND map_id = OLD.map_id AND walls = 1)
BEGIN
    INSERT INTO commits (map_id) SELECT id FROM maps WHERE id = OLD.map_id
        AND NOT EXISTS (SELECT 1 FROM commits WHERE open = 1 AND map_id = maps.id);
    INSERT INTO past_walls (commit_id, ordinal, ax_m, ay_m, bx_m, by_m, covariance)
    SELECT c.id, s.ordinal, s.ax_m, s.ay_m, s.bx_m, s.by_m, s.covariance FROM commits c JOIN laser_segments s ON s.map_id = c.map_id
    WHERE c.open = 1 AND c.map_id = OLD.map_id;
    UPDATE commits SET walls = 1 WHERE open = 1 AND map_id = OLD.map_id;
END;

DROP TRIGGER walls_before_delete;
CREATE TRIGGER walls_before_delete BEFORE DELETE ON laser_segments
WHEN EXISTS (SELECT 1 FROM maps WHERE id = OLD.map_id)
    AND NOT EXISTS (SELECT 1 FROM commits WHERE open = 1 AND map_id = OLD.map_id AND walls = 1)
BEGIN
    INSERT INTO commits (map_id) SELECT id FROM maps WHERE id = OLD.map_id
        AND NOT EXISTS (SELECT 1 FROM commits WHERE open = 1 AND map_id = maps.id);
    INSERT INTO past_walls (commit_id, ordinal, ax_m, ay_m, bx_m, by_m, covariance)
    SELECT c.id, s.ordinal, s.ax_m, s.ay_m, s.bx_m, s.by_m, s.covariance FROM commits c JOIN laser_segments s ON s.map_id = c.map_id
    WHERE c.open = 1 AND c.map_id = OLD.map_id;
    UPDATE commits SET walls = 1 WHERE open = 1 AND map_id = OLD.map_id;
END;
