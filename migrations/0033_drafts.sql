-- A draft is a map of its own, made of another one to be taught and edited beside it, and published to it as one commit.
ALTER TABLE maps ADD COLUMN draft_of INTEGER REFERENCES maps (id);
-- The commit of the map that the draft began with.
ALTER TABLE maps ADD COLUMN draft_from INTEGER CHECK ((draft_from IS NULL) = (draft_of IS NULL));
CREATE INDEX drafts_by_map ON maps (draft_of) WHERE draft_of IS NOT NULL;

-- Which landmark of the draft is which of the map.
CREATE TABLE draft_landmarks (
    draft_id    INTEGER NOT NULL REFERENCES maps (id) ON DELETE CASCADE,
    landmark_id INTEGER NOT NULL,
    of_landmark INTEGER NOT NULL,
    PRIMARY KEY (draft_id, landmark_id)
) STRICT, WITHOUT ROWID;

-- What map and draft were when the draft began: digests of their rows, each with its own numbers in it.
CREATE TABLE draft_rows (
    draft_id INTEGER NOT NULL REFERENCES maps (id) ON DELETE CASCADE,
    -- What the row is, in numbers of the map: `model 12`.
    row      TEXT    NOT NULL,
    in_map   BLOB    NOT NULL CHECK (length(in_map) = 32),
    in_draft BLOB    NOT NULL CHECK (length(in_draft) = 32),
    PRIMARY KEY (draft_id, row)
) STRICT, WITHOUT ROWID;
