-- A job was queued that gives this model, stored before landmarks had points, its points. It is not queued a second time,
-- whatever becomes of the job.
ALTER TABLE models ADD COLUMN points_asked INTEGER NOT NULL DEFAULT 0 CHECK (points_asked IN (0, 1));
