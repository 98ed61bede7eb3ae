-- The camera that looks for a map's landmarks, and what counts as seen: JSON of `map::visibility::Sight`, checked when it
-- came. NULL: the usual robot's.
ALTER TABLE maps ADD COLUMN sight TEXT CHECK (length(sight) <= 2048);
