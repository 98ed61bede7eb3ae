-- What writes commits. The first change of a row in a transaction stores it as it was; what changes nothing is no commit. The
-- conflict clause of a statement also rules in triggers, so they ask whether a row is there. A map that is deleted takes its
-- history along. Rows that go with their landmark find its map by what was just stored of it.

CREATE TRIGGER commit_of_new_map AFTER INSERT ON maps BEGIN
    INSERT INTO commits (map_id) VALUES (NEW.id);
END;

CREATE TRIGGER map_before_change BEFORE UPDATE OF name, site, building, floor, parent_id, parent_from_map, fusion, areas, sight ON maps
WHEN OLD.name IS NOT NEW.name OR OLD.site IS NOT NEW.site OR OLD.building IS NOT NEW.building OR OLD.floor IS NOT
    NEW.floor OR OLD.parent_id IS NOT NEW.parent_id OR OLD.parent_from_map IS NOT NEW.parent_from_map OR OLD.fusion
    IS NOT NEW.fusion OR OLD.areas IS NOT NEW.areas OR OLD.sight IS NOT NEW.sight
BEGIN
    INSERT INTO commits (map_id) SELECT id FROM maps WHERE id = OLD.id
        AND NOT EXISTS (SELECT 1 FROM commits WHERE open = 1 AND map_id = maps.id);
    INSERT INTO past_maps (commit_id, id, present, name, site, building, floor, parent_id, parent_from_map, fusion, areas, sight)
    SELECT c.id, OLD.id, 1, OLD.name, OLD.site, OLD.building, OLD.floor, OLD.parent_id, OLD.parent_from_map, OLD.fusion, OLD.areas,
        OLD.sight
    FROM commits c WHERE c.open = 1 AND c.map_id = OLD.id
        AND NOT EXISTS (SELECT 1 FROM past_maps p WHERE p.commit_id = c.id);
END;

CREATE TRIGGER none_before_landmark AFTER INSERT ON landmarks
BEGIN
    INSERT INTO commits (map_id) SELECT id FROM maps WHERE id = NEW.map_id
        AND NOT EXISTS (SELECT 1 FROM commits WHERE open = 1 AND map_id = maps.id);
    INSERT INTO past_landmarks (commit_id, id, present)
    SELECT c.id, NEW.id, 0
    FROM commits c WHERE c.open = 1 AND c.map_id = NEW.map_id
        AND NOT EXISTS (SELECT 1 FROM past_landmarks p WHERE p.commit_id = c.id AND p.id = NEW.id);
END;

CREATE TRIGGER landmark_before_change BEFORE UPDATE OF name, width_m, height_m, x_m, y_m, z_m, theta_rad, roll_rad, tilt_rad, place_covariance, size_from_views ON landmarks
WHEN OLD.name IS NOT NEW.name OR OLD.width_m IS NOT NEW.width_m OR OLD.height_m IS NOT NEW.height_m OR OLD.x_m IS NOT
    NEW.x_m OR OLD.y_m IS NOT NEW.y_m OR OLD.z_m IS NOT NEW.z_m OR OLD.theta_rad IS NOT NEW.theta_rad OR
    OLD.roll_rad IS NOT NEW.roll_rad OR OLD.tilt_rad IS NOT NEW.tilt_rad OR OLD.place_covariance IS NOT
    NEW.place_covariance OR OLD.size_from_views IS NOT NEW.size_from_views
BEGIN
    INSERT INTO commits (map_id) SELECT id FROM maps WHERE id = OLD.map_id
        AND NOT EXISTS (SELECT 1 FROM commits WHERE open = 1 AND map_id = maps.id);
    INSERT INTO past_landmarks (commit_id, id, present, name, width_m, height_m, x_m, y_m, z_m, theta_rad, roll_rad, tilt_rad,
        place_covariance, size_from_views, health, finding, created_ms, revision, changed_ms)
    SELECT c.id, OLD.id, 1, OLD.name, OLD.width_m, OLD.height_m, OLD.x_m, OLD.y_m, OLD.z_m, OLD.theta_rad, OLD.roll_rad,
        OLD.tilt_rad, OLD.place_covariance, OLD.size_from_views, OLD.health, OLD.finding, OLD.created_ms,
        OLD.revision, OLD.changed_ms
    FROM commits c WHERE c.open = 1 AND c.map_id = OLD.map_id
        AND NOT EXISTS (SELECT 1 FROM past_landmarks p WHERE p.commit_id = c.id AND p.id = OLD.id);
END;

CREATE TRIGGER landmark_before_removal BEFORE DELETE ON landmarks
BEGIN
    INSERT INTO commits (map_id) SELECT id FROM maps WHERE id = OLD.map_id
        AND NOT EXISTS (SELECT 1 FROM commits WHERE open = 1 AND map_id = maps.id);
    INSERT INTO past_landmarks (commit_id, id, present, name, width_m, height_m, x_m, y_m, z_m, theta_rad, roll_rad, tilt_rad,
        place_covariance, size_from_views, health, finding, created_ms, revision, changed_ms)
    SELECT c.id, OLD.id, 1, OLD.name, OLD.width_m, OLD.height_m, OLD.x_m, OLD.y_m, OLD.z_m, OLD.theta_rad, OLD.roll_rad,
        OLD.tilt_rad, OLD.place_covariance, OLD.size_from_views, OLD.health, OLD.finding, OLD.created_ms,
        OLD.revision, OLD.changed_ms
    FROM commits c WHERE c.open = 1 AND c.map_id = OLD.map_id
        AND NOT EXISTS (SELECT 1 FROM past_landmarks p WHERE p.commit_id = c.id AND p.id = OLD.id);
END;

CREATE TRIGGER none_before_view AFTER INSERT ON views
BEGIN
    INSERT INTO commits (map_id) SELECT id FROM maps WHERE id = coalesce((SELECT map_id FROM landmarks WHERE id = NEW.landmark_id),
    (SELECT c.map_id FROM commits c JOIN past_landmarks p ON p.commit_id = c.id WHERE c.open = 1 AND p.id = NEW.landmark_id))
        AND NOT EXISTS (SELECT 1 FROM commits WHERE open = 1 AND map_id = maps.id);
    INSERT INTO past_views (commit_id, id, present, landmark_id)
    SELECT c.id, NEW.id, 0, NEW.landmark_id
    FROM commits c WHERE c.open = 1 AND c.map_id = coalesce((SELECT map_id FROM landmarks WHERE id = NEW.landmark_id),
    (SELECT c.map_id FROM commits c JOIN past_landmarks p ON p.commit_id = c.id WHERE c.open = 1 AND p.id = NEW.landmark_id))
        AND NOT EXISTS (SELECT 1 FROM past_views p WHERE p.commit_id = c.id AND p.id = NEW.id);
END;

CREATE TRIGGER view_before_change BEFORE UPDATE OF landmark_id, image_sha256, image_kind, width_px, height_px, corners_px, created_ms, icon_side, icon_scale,
    capture, icon ON views
WHEN OLD.landmark_id IS NOT NEW.landmark_id OR OLD.image_sha256 IS NOT NEW.image_sha256 OR OLD.image_kind IS NOT
    NEW.image_kind OR OLD.width_px IS NOT NEW.width_px OR OLD.height_px IS NOT NEW.height_px OR OLD.corners_px IS
    NOT NEW.corners_px OR OLD.created_ms IS NOT NEW.created_ms OR OLD.icon_side IS NOT NEW.icon_side OR
    OLD.icon_scale IS NOT NEW.icon_scale OR OLD.capture IS NOT NEW.capture OR OLD.icon IS NOT NEW.icon
BEGIN
    INSERT INTO commits (map_id) SELECT id FROM maps WHERE id = coalesce((SELECT map_id FROM landmarks WHERE id = OLD.landmark_id),
    (SELECT c.map_id FROM commits c JOIN past_landmarks p ON p.commit_id = c.id WHERE c.open = 1 AND p.id = OLD.landmark_id))
        AND NOT EXISTS (SELECT 1 FROM commits WHERE open = 1 AND map_id = maps.id);
    INSERT INTO past_views (commit_id, id, present, landmark_id, image_sha256, image_kind, width_px, height_px, corners_px, created_ms,
        icon_side, icon_scale, capture, icon)
    SELECT c.id, OLD.id, 1, OLD.landmark_id, OLD.image_sha256, OLD.image_kind, OLD.width_px, OLD.height_px,
        OLD.corners_px, OLD.created_ms, OLD.icon_side, OLD.icon_scale, OLD.capture, OLD.icon
    FROM commits c WHERE c.open = 1 AND c.map_id = coalesce((SELECT map_id FROM landmarks WHERE id = OLD.landmark_id),
    (SELECT c.map_id FROM commits c JOIN past_landmarks p ON p.commit_id = c.id WHERE c.open = 1 AND p.id = OLD.landmark_id))
        AND NOT EXISTS (SELECT 1 FROM past_views p WHERE p.commit_id = c.id AND p.id = OLD.id);
END;

CREATE TRIGGER view_before_removal BEFORE DELETE ON views
BEGIN
    INSERT INTO commits (map_id) SELECT id FROM maps WHERE id = coalesce((SELECT map_id FROM landmarks WHERE id = OLD.landmark_id),
    (SELECT c.map_id FROM commits c JOIN past_landmarks p ON p.commit_id = c.id WHERE c.open = 1 AND p.id = OLD.landmark_id))
        AND NOT EXISTS (SELECT 1 FROM commits WHERE open = 1 AND map_id = maps.id);
    INSERT INTO past_views (commit_id, id, present, landmark_id, image_sha256, image_kind, width_px, height_px, corners_px, created_ms,
        icon_side, icon_scale, capture, icon)
    SELECT c.id, OLD.id, 1, OLD.landmark_id, OLD.image_sha256, OLD.image_kind, OLD.width_px, OLD.height_px,
        OLD.corners_px, OLD.created_ms, OLD.icon_side, OLD.icon_scale, OLD.capture, OLD.icon
    FROM commits c WHERE c.open = 1 AND c.map_id = coalesce((SELECT map_id FROM landmarks WHERE id = OLD.landmark_id),
    (SELECT c.map_id FROM commits c JOIN past_landmarks p ON p.commit_id = c.id WHERE c.open = 1 AND p.id = OLD.landmark_id))
        AND NOT EXISTS (SELECT 1 FROM past_views p WHERE p.commit_id = c.id AND p.id = OLD.id);
END;

CREATE TRIGGER none_before_stranger AFTER INSERT ON strangers
BEGIN
    INSERT INTO commits (map_id) SELECT id FROM maps WHERE id = NEW.map_id
        AND NOT EXISTS (SELECT 1 FROM commits WHERE open = 1 AND map_id = maps.id);
    INSERT INTO past_strangers (commit_id, id, present)
    SELECT c.id, NEW.id, 0
    FROM commits c WHERE c.open = 1 AND c.map_id = NEW.map_id
        AND NOT EXISTS (SELECT 1 FROM past_strangers p WHERE p.commit_id = c.id AND p.id = NEW.id);
END;

CREATE TRIGGER stranger_before_change BEFORE UPDATE OF image_sha256, corners_px, icon_side, icon_scale, icon ON strangers
WHEN OLD.image_sha256 IS NOT NEW.image_sha256 OR OLD.corners_px IS NOT NEW.corners_px OR OLD.icon_side IS NOT
    NEW.icon_side OR OLD.icon_scale IS NOT NEW.icon_scale OR OLD.icon IS NOT NEW.icon
BEGIN
    INSERT INTO commits (map_id) SELECT id FROM maps WHERE id = OLD.map_id
        AND NOT EXISTS (SELECT 1 FROM commits WHERE open = 1 AND map_id = maps.id);
    INSERT INTO past_strangers (commit_id, id, present, image_sha256, corners_px, icon_side, icon_scale, icon)
    SELECT c.id, OLD.id, 1, OLD.image_sha256, OLD.corners_px, OLD.icon_side, OLD.icon_scale, OLD.icon
    FROM commits c WHERE c.open = 1 AND c.map_id = OLD.map_id
        AND NOT EXISTS (SELECT 1 FROM past_strangers p WHERE p.commit_id = c.id AND p.id = OLD.id);
END;

CREATE TRIGGER stranger_before_removal BEFORE DELETE ON strangers
BEGIN
    INSERT INTO commits (map_id) SELECT id FROM maps WHERE id = OLD.map_id
        AND NOT EXISTS (SELECT 1 FROM commits WHERE open = 1 AND map_id = maps.id);
    INSERT INTO past_strangers (commit_id, id, present, image_sha256, corners_px, icon_side, icon_scale, icon)
    SELECT c.id, OLD.id, 1, OLD.image_sha256, OLD.corners_px, OLD.icon_side, OLD.icon_scale, OLD.icon
    FROM commits c WHERE c.open = 1 AND c.map_id = OLD.map_id
        AND NOT EXISTS (SELECT 1 FROM past_strangers p WHERE p.commit_id = c.id AND p.id = OLD.id);
END;

CREATE TRIGGER none_before_model AFTER INSERT ON models
BEGIN
    INSERT INTO commits (map_id) SELECT id FROM maps WHERE id = coalesce((SELECT map_id FROM landmarks WHERE id = NEW.landmark_id),
    (SELECT c.map_id FROM commits c JOIN past_landmarks p ON p.commit_id = c.id WHERE c.open = 1 AND p.id = NEW.landmark_id))
        AND NOT EXISTS (SELECT 1 FROM commits WHERE open = 1 AND map_id = maps.id);
    INSERT INTO past_models (commit_id, landmark_id, present)
    SELECT c.id, NEW.landmark_id, 0
    FROM commits c WHERE c.open = 1 AND c.map_id = coalesce((SELECT map_id FROM landmarks WHERE id = NEW.landmark_id),
    (SELECT c.map_id FROM commits c JOIN past_landmarks p ON p.commit_id = c.id WHERE c.open = 1 AND p.id = NEW.landmark_id))
        AND NOT EXISTS (SELECT 1 FROM past_models p WHERE p.commit_id = c.id AND p.landmark_id = NEW.landmark_id);
END;

CREATE TRIGGER model_before_change BEFORE UPDATE OF sha256, params_hash, active, reasons, facts, views, generated_views, learnt_ms, looks_like ON models
WHEN OLD.sha256 IS NOT NEW.sha256 OR OLD.params_hash IS NOT NEW.params_hash OR OLD.active IS NOT NEW.active OR
    OLD.reasons IS NOT NEW.reasons OR OLD.facts IS NOT NEW.facts OR OLD.views IS NOT NEW.views OR
    OLD.generated_views IS NOT NEW.generated_views OR OLD.learnt_ms IS NOT NEW.learnt_ms OR OLD.looks_like IS NOT
    NEW.looks_like
BEGIN
    INSERT INTO commits (map_id) SELECT id FROM maps WHERE id = coalesce((SELECT map_id FROM landmarks WHERE id = OLD.landmark_id),
    (SELECT c.map_id FROM commits c JOIN past_landmarks p ON p.commit_id = c.id WHERE c.open = 1 AND p.id = OLD.landmark_id))
        AND NOT EXISTS (SELECT 1 FROM commits WHERE open = 1 AND map_id = maps.id);
    INSERT INTO past_models (commit_id, landmark_id, present, sha256, params_hash, active, reasons, facts, views, generated_views,
        learnt_ms, points_asked, looks_like)
    SELECT c.id, OLD.landmark_id, 1, OLD.sha256, OLD.params_hash, OLD.active, OLD.reasons, OLD.facts, OLD.views,
        OLD.generated_views, OLD.learnt_ms, OLD.points_asked, OLD.looks_like
    FROM commits c WHERE c.open = 1 AND c.map_id = coalesce((SELECT map_id FROM landmarks WHERE id = OLD.landmark_id),
    (SELECT c.map_id FROM commits c JOIN past_landmarks p ON p.commit_id = c.id WHERE c.open = 1 AND p.id = OLD.landmark_id))
        AND NOT EXISTS (SELECT 1 FROM past_models p WHERE p.commit_id = c.id AND p.landmark_id = OLD.landmark_id);
END;

CREATE TRIGGER model_before_removal BEFORE DELETE ON models
BEGIN
    INSERT INTO commits (map_id) SELECT id FROM maps WHERE id = coalesce((SELECT map_id FROM landmarks WHERE id = OLD.landmark_id),
    (SELECT c.map_id FROM commits c JOIN past_landmarks p ON p.commit_id = c.id WHERE c.open = 1 AND p.id = OLD.landmark_id))
        AND NOT EXISTS (SELECT 1 FROM commits WHERE open = 1 AND map_id = maps.id);
    INSERT INTO past_models (commit_id, landmark_id, present, sha256, params_hash, active, reasons, facts, views, generated_views,
        learnt_ms, points_asked, looks_like)
    SELECT c.id, OLD.landmark_id, 1, OLD.sha256, OLD.params_hash, OLD.active, OLD.reasons, OLD.facts, OLD.views,
        OLD.generated_views, OLD.learnt_ms, OLD.points_asked, OLD.looks_like
    FROM commits c WHERE c.open = 1 AND c.map_id = coalesce((SELECT map_id FROM landmarks WHERE id = OLD.landmark_id),
    (SELECT c.map_id FROM commits c JOIN past_landmarks p ON p.commit_id = c.id WHERE c.open = 1 AND p.id = OLD.landmark_id))
        AND NOT EXISTS (SELECT 1 FROM past_models p WHERE p.commit_id = c.id AND p.landmark_id = OLD.landmark_id);
END;

CREATE TRIGGER none_before_run AFTER INSERT ON runs
BEGIN
    INSERT INTO commits (map_id) SELECT id FROM maps WHERE id = NEW.map_id
        AND NOT EXISTS (SELECT 1 FROM commits WHERE open = 1 AND map_id = maps.id);
    INSERT INTO past_runs (commit_id, id, present)
    SELECT c.id, NEW.id, 0
    FROM commits c WHERE c.open = 1 AND c.map_id = NEW.map_id
        AND NOT EXISTS (SELECT 1 FROM past_runs p WHERE p.commit_id = c.id AND p.id = NEW.id);
END;

CREATE TRIGGER run_before_change BEFORE UPDATE OF robot, created_ms, way_m, cells ON runs
WHEN OLD.robot IS NOT NEW.robot OR OLD.created_ms IS NOT NEW.created_ms OR OLD.way_m IS NOT NEW.way_m OR OLD.cells IS
    NOT NEW.cells
BEGIN
    INSERT INTO commits (map_id) SELECT id FROM maps WHERE id = OLD.map_id
        AND NOT EXISTS (SELECT 1 FROM commits WHERE open = 1 AND map_id = maps.id);
    INSERT INTO past_runs (commit_id, id, present, robot, created_ms, way_m, cells)
    SELECT c.id, OLD.id, 1, OLD.robot, OLD.created_ms, OLD.way_m, OLD.cells
    FROM commits c WHERE c.open = 1 AND c.map_id = OLD.map_id
        AND NOT EXISTS (SELECT 1 FROM past_runs p WHERE p.commit_id = c.id AND p.id = OLD.id);
END;

CREATE TRIGGER run_before_removal BEFORE DELETE ON runs
BEGIN
    INSERT INTO commits (map_id) SELECT id FROM maps WHERE id = OLD.map_id
        AND NOT EXISTS (SELECT 1 FROM commits WHERE open = 1 AND map_id = maps.id);
    INSERT INTO past_runs (commit_id, id, present, robot, created_ms, way_m, cells)
    SELECT c.id, OLD.id, 1, OLD.robot, OLD.created_ms, OLD.way_m, OLD.cells
    FROM commits c WHERE c.open = 1 AND c.map_id = OLD.map_id
        AND NOT EXISTS (SELECT 1 FROM past_runs p WHERE p.commit_id = c.id AND p.id = OLD.id);
END;

CREATE TRIGGER none_before_underlay AFTER INSERT ON underlays
BEGIN
    INSERT INTO commits (map_id) SELECT id FROM maps WHERE id = NEW.map_id
        AND NOT EXISTS (SELECT 1 FROM commits WHERE open = 1 AND map_id = maps.id);
    INSERT INTO past_underlays (commit_id, map_id, present)
    SELECT c.id, NEW.map_id, 0
    FROM commits c WHERE c.open = 1 AND c.map_id = NEW.map_id
        AND NOT EXISTS (SELECT 1 FROM past_underlays p WHERE p.commit_id = c.id AND p.map_id = NEW.map_id);
END;

CREATE TRIGGER underlay_before_change BEFORE UPDATE OF image_sha256, image_kind, width_px, height_px, metres_per_pixel, x_m, y_m, theta_rad, created_ms ON underlays
WHEN OLD.image IS NULL AND (OLD.image_sha256 IS NOT NEW.image_sha256 OR OLD.image_kind IS NOT NEW.image_kind OR OLD.width_px IS NOT
    NEW.width_px OR OLD.height_px IS NOT NEW.height_px OR OLD.metres_per_pixel IS NOT NEW.metres_per_pixel OR
    OLD.x_m IS NOT NEW.x_m OR OLD.y_m IS NOT NEW.y_m OR OLD.theta_rad IS NOT NEW.theta_rad OR OLD.created_ms IS NOT
    NEW.created_ms)
BEGIN
    INSERT INTO commits (map_id) SELECT id FROM maps WHERE id = OLD.map_id
        AND NOT EXISTS (SELECT 1 FROM commits WHERE open = 1 AND map_id = maps.id);
    INSERT INTO past_underlays (commit_id, map_id, present, image_sha256, image_kind, width_px, height_px, metres_per_pixel, x_m, y_m,
        theta_rad, created_ms)
    SELECT c.id, OLD.map_id, 1, OLD.image_sha256, OLD.image_kind, OLD.width_px, OLD.height_px, OLD.metres_per_pixel,
        OLD.x_m, OLD.y_m, OLD.theta_rad, OLD.created_ms
    FROM commits c WHERE c.open = 1 AND c.map_id = OLD.map_id
        AND NOT EXISTS (SELECT 1 FROM past_underlays p WHERE p.commit_id = c.id AND p.map_id = OLD.map_id);
END;

CREATE TRIGGER underlay_before_removal BEFORE DELETE ON underlays
WHEN OLD.image IS NULL
BEGIN
    INSERT INTO commits (map_id) SELECT id FROM maps WHERE id = OLD.map_id
        AND NOT EXISTS (SELECT 1 FROM commits WHERE open = 1 AND map_id = maps.id);
    INSERT INTO past_underlays (commit_id, map_id, present, image_sha256, image_kind, width_px, height_px, metres_per_pixel, x_m, y_m,
        theta_rad, created_ms)
    SELECT c.id, OLD.map_id, 1, OLD.image_sha256, OLD.image_kind, OLD.width_px, OLD.height_px, OLD.metres_per_pixel,
        OLD.x_m, OLD.y_m, OLD.theta_rad, OLD.created_ms
    FROM commits c WHERE c.open = 1 AND c.map_id = OLD.map_id
        AND NOT EXISTS (SELECT 1 FROM past_underlays p WHERE p.commit_id = c.id AND p.map_id = OLD.map_id);
END;

CREATE TRIGGER walls_before_insert BEFORE INSERT ON laser_segments
WHEN EXISTS (SELECT 1 FROM maps WHERE id = NEW.map_id)
    AND NOT EXISTS (SELECT 1 FROM commits WHERE open = 1 AND map_id = NEW.map_id AND walls = 1)
BEGIN
    INSERT INTO commits (map_id) SELECT id FROM maps WHERE id = NEW.map_id
        AND NOT EXISTS (SELECT 1 FROM commits WHERE open = 1 AND map_id = maps.id);
    INSERT INTO past_walls (commit_id, ordinal, ax_m, ay_m, bx_m, by_m)
    SELECT c.id, s.ordinal, s.ax_m, s.ay_m, s.bx_m, s.by_m FROM commits c JOIN laser_segments s ON s.map_id = c.map_id
    WHERE c.open = 1 AND c.map_id = NEW.map_id;
    UPDATE commits SET walls = 1 WHERE open = 1 AND map_id = NEW.map_id;
END;

CREATE TRIGGER walls_before_update BEFORE UPDATE ON laser_segments
WHEN EXISTS (SELECT 1 FROM maps WHERE id = OLD.map_id)
    AND NOT EXISTS (SELECT 1 FROM commits WHERE open = 1 AND map_id = OLD.map_id AND walls = 1)
BEGIN
    INSERT INTO commits (map_id) SELECT id FROM maps WHERE id = OLD.map_id
        AND NOT EXISTS (SELECT 1 FROM commits WHERE open = 1 AND map_id = maps.id);
    INSERT INTO past_walls (commit_id, ordinal, ax_m, ay_m, bx_m, by_m)
    SELECT c.id, s.ordinal, s.ax_m, s.ay_m, s.bx_m, s.by_m FROM commits c JOIN laser_segments s ON s.map_id = c.map_id
    WHERE c.open = 1 AND c.map_id = OLD.map_id;
    UPDATE commits SET walls = 1 WHERE open = 1 AND map_id = OLD.map_id;
END;

CREATE TRIGGER walls_before_delete BEFORE DELETE ON laser_segments
WHEN EXISTS (SELECT 1 FROM maps WHERE id = OLD.map_id)
    AND NOT EXISTS (SELECT 1 FROM commits WHERE open = 1 AND map_id = OLD.map_id AND walls = 1)
BEGIN
    INSERT INTO commits (map_id) SELECT id FROM maps WHERE id = OLD.map_id
        AND NOT EXISTS (SELECT 1 FROM commits WHERE open = 1 AND map_id = maps.id);
    INSERT INTO past_walls (commit_id, ordinal, ax_m, ay_m, bx_m, by_m)
    SELECT c.id, s.ordinal, s.ax_m, s.ay_m, s.bx_m, s.by_m FROM commits c JOIN laser_segments s ON s.map_id = c.map_id
    WHERE c.open = 1 AND c.map_id = OLD.map_id;
    UPDATE commits SET walls = 1 WHERE open = 1 AND map_id = OLD.map_id;
END;

-- Contents go with the last row that refers to them, live or kept.
DROP TRIGGER picture_after_view;
DROP TRIGGER picture_after_track_view;
DROP TRIGGER picture_after_underlay;
DROP TRIGGER picture_after_replaced_underlay;

CREATE TRIGGER picture_after_view AFTER DELETE ON views
BEGIN
    DELETE FROM pictures WHERE sha256 = OLD.image_sha256
        AND NOT EXISTS (SELECT 1 FROM views WHERE image_sha256 = OLD.image_sha256)
        AND NOT EXISTS (SELECT 1 FROM track_views WHERE image_sha256 = OLD.image_sha256)
        AND NOT EXISTS (SELECT 1 FROM underlays WHERE image_sha256 = OLD.image_sha256)
        AND NOT EXISTS (SELECT 1 FROM past_views WHERE image_sha256 = OLD.image_sha256)
        AND NOT EXISTS (SELECT 1 FROM past_underlays WHERE image_sha256 = OLD.image_sha256)
        AND NOT EXISTS (SELECT 1 FROM damaged_pictures WHERE sha256 = OLD.image_sha256);
END;

CREATE TRIGGER picture_after_track_view AFTER DELETE ON track_views
BEGIN
    DELETE FROM pictures WHERE sha256 = OLD.image_sha256
        AND NOT EXISTS (SELECT 1 FROM views WHERE image_sha256 = OLD.image_sha256)
        AND NOT EXISTS (SELECT 1 FROM track_views WHERE image_sha256 = OLD.image_sha256)
        AND NOT EXISTS (SELECT 1 FROM underlays WHERE image_sha256 = OLD.image_sha256)
        AND NOT EXISTS (SELECT 1 FROM past_views WHERE image_sha256 = OLD.image_sha256)
        AND NOT EXISTS (SELECT 1 FROM past_underlays WHERE image_sha256 = OLD.image_sha256)
        AND NOT EXISTS (SELECT 1 FROM damaged_pictures WHERE sha256 = OLD.image_sha256);
END;

CREATE TRIGGER picture_after_underlay AFTER DELETE ON underlays
BEGIN
    DELETE FROM pictures WHERE sha256 = OLD.image_sha256
        AND NOT EXISTS (SELECT 1 FROM views WHERE image_sha256 = OLD.image_sha256)
        AND NOT EXISTS (SELECT 1 FROM track_views WHERE image_sha256 = OLD.image_sha256)
        AND NOT EXISTS (SELECT 1 FROM underlays WHERE image_sha256 = OLD.image_sha256)
        AND NOT EXISTS (SELECT 1 FROM past_views WHERE image_sha256 = OLD.image_sha256)
        AND NOT EXISTS (SELECT 1 FROM past_underlays WHERE image_sha256 = OLD.image_sha256)
        AND NOT EXISTS (SELECT 1 FROM damaged_pictures WHERE sha256 = OLD.image_sha256);
END;

CREATE TRIGGER picture_after_replaced_underlay AFTER UPDATE OF image_sha256 ON underlays
WHEN OLD.image_sha256 IS NOT NEW.image_sha256
BEGIN
    DELETE FROM pictures WHERE sha256 = OLD.image_sha256
        AND NOT EXISTS (SELECT 1 FROM views WHERE image_sha256 = OLD.image_sha256)
        AND NOT EXISTS (SELECT 1 FROM track_views WHERE image_sha256 = OLD.image_sha256)
        AND NOT EXISTS (SELECT 1 FROM underlays WHERE image_sha256 = OLD.image_sha256)
        AND NOT EXISTS (SELECT 1 FROM past_views WHERE image_sha256 = OLD.image_sha256)
        AND NOT EXISTS (SELECT 1 FROM past_underlays WHERE image_sha256 = OLD.image_sha256)
        AND NOT EXISTS (SELECT 1 FROM damaged_pictures WHERE sha256 = OLD.image_sha256);
END;

CREATE TRIGGER picture_after_past_view AFTER DELETE ON past_views
WHEN OLD.present = 1
BEGIN
    DELETE FROM pictures WHERE sha256 = OLD.image_sha256
        AND NOT EXISTS (SELECT 1 FROM views WHERE image_sha256 = OLD.image_sha256)
        AND NOT EXISTS (SELECT 1 FROM track_views WHERE image_sha256 = OLD.image_sha256)
        AND NOT EXISTS (SELECT 1 FROM underlays WHERE image_sha256 = OLD.image_sha256)
        AND NOT EXISTS (SELECT 1 FROM past_views WHERE image_sha256 = OLD.image_sha256)
        AND NOT EXISTS (SELECT 1 FROM past_underlays WHERE image_sha256 = OLD.image_sha256)
        AND NOT EXISTS (SELECT 1 FROM damaged_pictures WHERE sha256 = OLD.image_sha256);
END;

CREATE TRIGGER picture_after_past_underlay AFTER DELETE ON past_underlays
WHEN OLD.present = 1
BEGIN
    DELETE FROM pictures WHERE sha256 = OLD.image_sha256
        AND NOT EXISTS (SELECT 1 FROM views WHERE image_sha256 = OLD.image_sha256)
        AND NOT EXISTS (SELECT 1 FROM track_views WHERE image_sha256 = OLD.image_sha256)
        AND NOT EXISTS (SELECT 1 FROM underlays WHERE image_sha256 = OLD.image_sha256)
        AND NOT EXISTS (SELECT 1 FROM past_views WHERE image_sha256 = OLD.image_sha256)
        AND NOT EXISTS (SELECT 1 FROM past_underlays WHERE image_sha256 = OLD.image_sha256)
        AND NOT EXISTS (SELECT 1 FROM damaged_pictures WHERE sha256 = OLD.image_sha256);
END;

CREATE TRIGGER content_after_model AFTER DELETE ON models
BEGIN
    DELETE FROM model_contents WHERE sha256 = OLD.sha256
        AND NOT EXISTS (SELECT 1 FROM models WHERE sha256 = OLD.sha256)
        AND NOT EXISTS (SELECT 1 FROM past_models WHERE sha256 = OLD.sha256);
END;

CREATE TRIGGER content_after_replaced_model AFTER UPDATE OF sha256 ON models
WHEN OLD.sha256 <> NEW.sha256
BEGIN
    DELETE FROM model_contents WHERE sha256 = OLD.sha256
        AND NOT EXISTS (SELECT 1 FROM models WHERE sha256 = OLD.sha256)
        AND NOT EXISTS (SELECT 1 FROM past_models WHERE sha256 = OLD.sha256);
END;

CREATE TRIGGER content_after_past_model AFTER DELETE ON past_models
WHEN OLD.present = 1
BEGIN
    DELETE FROM model_contents WHERE sha256 = OLD.sha256
        AND NOT EXISTS (SELECT 1 FROM models WHERE sha256 = OLD.sha256)
        AND NOT EXISTS (SELECT 1 FROM past_models WHERE sha256 = OLD.sha256);
END;
