-- What robots find out about a landmark: moved or missing. The last finding is kept as JSON so that a person can decide;
-- a column of words, not a table, because only the present standing is acted on.
ALTER TABLE landmarks ADD COLUMN standing TEXT NOT NULL DEFAULT 'sound'
    CHECK (standing IN ('sound', 'flagged', 'quarantined'));
ALTER TABLE landmarks ADD COLUMN finding TEXT;
