-- What stored answers rest on: the pose before the frame with the result of its gate, and matched points. Answers of earlier
-- builds have none of it.
ALTER TABLE stored_answers ADD COLUMN prior_check TEXT CHECK (length(prior_check) <= 4096);

-- The landmark that an icon's points were compared with, by its name then, and the matches: nine bytes each, two places of two
-- 16-bit numbers (1/10000 of a side, little-endian) and whether it agrees.
ALTER TABLE stored_answer_icons ADD COLUMN matched TEXT CHECK (length(matched) <= 64);
ALTER TABLE stored_answer_icons ADD COLUMN matches BLOB CHECK (length(matches) <= 900);
