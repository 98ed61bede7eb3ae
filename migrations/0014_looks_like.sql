-- Not in use, because it looks like a landmark that is: JSON with that landmark's number, its name then, and the likeness.
ALTER TABLE models ADD COLUMN looks_like TEXT CHECK (length(looks_like) <= 1024);
