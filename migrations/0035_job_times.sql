-- When a job began to run: with created_ms and ended_ms, how long it waited and how long it worked.
ALTER TABLE jobs ADD COLUMN started_ms INTEGER;
