-- Answers to frames of robots, to be opened again: why a robot was told what it was told. The newest of a bounded number
-- (`limits.stored_answers`). AUTOINCREMENT: the oldest are those with the least numbers, and no number is used again.
CREATE TABLE stored_answers (
    id         INTEGER PRIMARY KEY AUTOINCREMENT,
    map_id     INTEGER NOT NULL REFERENCES maps (id) ON DELETE CASCADE,
    -- No reference: an answer outlives its robot.
    robot      TEXT    NOT NULL,
    camera     TEXT    NOT NULL,
    stored_ms  INTEGER NOT NULL,
    status     TEXT    NOT NULL CHECK (length(status) <= 32),
    has_pose   INTEGER NOT NULL CHECK (has_pose IN (0, 1)),
    -- Why there is no pose: the code of a gate or of a refusal.
    refusal    TEXT    CHECK (length(refusal) <= 64),
    -- JSON lists of names as they were then: those that the answer names, and those that it compared with.
    landmarks  TEXT    NOT NULL,
    candidates TEXT    NOT NULL,
    -- `Answer` of protos/waymark/v1/waymark.proto. What is large comes last.
    answer     BLOB    NOT NULL CHECK (length(answer) <= 262144)
) STRICT;
CREATE INDEX stored_answers_by_map ON stored_answers (map_id);

-- The icons of its quads, so that they can be shown beside those of the landmarks.
CREATE TABLE stored_answer_icons (
    answer_id INTEGER NOT NULL REFERENCES stored_answers (id) ON DELETE CASCADE,
    quad      INTEGER NOT NULL,
    icon_side INTEGER NOT NULL CHECK (icon_side BETWEEN 1 AND 1024),
    icon      BLOB    NOT NULL CHECK (length(icon) = icon_side * icon_side),
    PRIMARY KEY (answer_id, quad)
) STRICT;
