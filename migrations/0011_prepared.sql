-- Counts up with every change of the walls: what was computed from them before a write is compared by it inside the write.
ALTER TABLE maps ADD COLUMN walls_version INTEGER NOT NULL DEFAULT 1 CHECK (walls_version >= 1);
-- How often the job was begun. One that ends the process each time is given up after a few.
ALTER TABLE jobs ADD COLUMN attempts INTEGER NOT NULL DEFAULT 0 CHECK (attempts >= 0);
