-- Robots, what they gather, and what they were answered.

-- A robot stands on exactly one map. RESTRICT: a map cannot be pulled from under a robot.
CREATE TABLE robots (
    name       TEXT    PRIMARY KEY CHECK (length(name) BETWEEN 1 AND 64),
    map_id     INTEGER NOT NULL REFERENCES maps (id) ON DELETE RESTRICT,
    created_ms INTEGER NOT NULL
) STRICT;

CREATE INDEX robots_by_map ON robots (map_id);

-- Certificates that the built-in authority has signed for robots. The serial is random: after a backup is restored, no
-- certificate that was signed since is taken for another one. A deleted robot's rows stay, revoked.
CREATE TABLE robot_certificates (
    serial     TEXT    PRIMARY KEY CHECK (length(serial) = 16),
    robot      TEXT    NOT NULL,
    -- Of the certificate, DER.
    sha256     BLOB    NOT NULL CHECK (length(sha256) = 32),
    issued_ms  INTEGER NOT NULL,
    expires_ms INTEGER NOT NULL,
    revoked_ms INTEGER
) STRICT;

CREATE INDEX robot_certificates_robot ON robot_certificates (robot, issued_ms);

-- Views gathered while a robot drives past: they lie here until a person accepts them or throws them away. Nothing of
-- this is matched; a landmark is made of them only by that decision. The robot's name is copied: what it brought home outlives
-- it.
CREATE TABLE gatherings (
    id          INTEGER PRIMARY KEY AUTOINCREMENT,
    map_id      INTEGER NOT NULL REFERENCES maps (id) ON DELETE CASCADE,
    robot       TEXT    NOT NULL CHECK (length(robot) BETWEEN 1 AND 64),
    -- Only views of this landmark; NULL: of whatever is no landmark yet.
    landmark_id INTEGER REFERENCES landmarks (id) ON DELETE CASCADE,
    -- Also views of every landmark that is recognised.
    known       INTEGER NOT NULL CHECK (known IN (0, 1)),
    open        INTEGER NOT NULL CHECK (open IN (0, 1)),
    -- JSON, of the whole drive; written when it ends.
    counts      TEXT    NOT NULL DEFAULT '{}' CHECK (length(counts) <= 4096),
    created_ms  INTEGER NOT NULL,
    ended_ms    INTEGER
) STRICT;

-- A robot gathers for one purpose at a time.
CREATE UNIQUE INDEX gathering_of_robot ON gatherings (robot) WHERE open = 1;
CREATE INDEX gatherings_by_map ON gatherings (map_id, id);

-- One thing that was followed. A decision keeps the row and removes the views: its number must not come to mean another.
CREATE TABLE tracks (
    gathering_id INTEGER NOT NULL REFERENCES gatherings (id) ON DELETE CASCADE,
    number       INTEGER NOT NULL CHECK (number >= 1),
    landmark_id  INTEGER REFERENCES landmarks (id) ON DELETE CASCADE,
    state        TEXT    NOT NULL DEFAULT 'open' CHECK (state IN ('open', 'accepted', 'discarded')),
    sightings    INTEGER NOT NULL,
    -- Sightings in which it was taken for a landmark of the map, or nearly.
    known        INTEGER NOT NULL,
    PRIMARY KEY (gathering_id, number)
) STRICT, WITHOUT ROWID;

-- As in `views`, and moved there by an acceptance.
CREATE TABLE track_views (
    id           INTEGER PRIMARY KEY AUTOINCREMENT,
    gathering_id INTEGER NOT NULL,
    track        INTEGER NOT NULL,
    image_sha256 BLOB    NOT NULL REFERENCES pictures (sha256) CHECK (length(image_sha256) = 32),
    image_kind   TEXT    NOT NULL CHECK (image_kind IN ('png', 'jpeg')),
    width_px     INTEGER NOT NULL,
    height_px    INTEGER NOT NULL,
    corners_px   BLOB    NOT NULL CHECK (length(corners_px) = 64),
    created_ms   INTEGER NOT NULL,
    icon_side    INTEGER NOT NULL CHECK (icon_side BETWEEN 1 AND 1024),
    icon_scale   REAL    NOT NULL,
    capture      TEXT    CHECK (length(capture) <= 8192),
    icon         BLOB    NOT NULL CHECK (length(icon) = icon_side * icon_side),
    FOREIGN KEY (gathering_id, track) REFERENCES tracks (gathering_id, number) ON DELETE CASCADE,
    UNIQUE (gathering_id, track, image_sha256, corners_px)
) STRICT;

CREATE INDEX track_views_by_picture ON track_views (image_sha256);

-- Answers to frames of robots, to be opened again: why a robot was told what it was told. The newest of a bounded number
-- (`limits.stored_answers`). AUTOINCREMENT: the oldest are those with the least numbers, and no number is used again.
CREATE TABLE stored_answers (
    id          INTEGER PRIMARY KEY AUTOINCREMENT,
    map_id      INTEGER NOT NULL REFERENCES maps (id) ON DELETE CASCADE,
    -- No reference: an answer outlives its robot.
    robot       TEXT    NOT NULL,
    camera      TEXT    NOT NULL,
    stored_ms   INTEGER NOT NULL,
    status      TEXT    NOT NULL CHECK (length(status) <= 32),
    has_pose    INTEGER NOT NULL CHECK (has_pose IN (0, 1)),
    -- Why there is no pose: the code of a gate or of a refusal.
    refusal     TEXT    CHECK (length(refusal) <= 64),
    -- JSON lists of names as they were then: those that the answer names, and those that it compared with.
    landmarks   TEXT    NOT NULL,
    candidates  TEXT    NOT NULL,
    -- The pose before the frame with the result of its gate, JSON; NULL where none was known.
    prior_check TEXT    CHECK (length(prior_check) <= 4096),
    -- `Answer` of protos/waymark/v1/waymark.proto. What is large comes last.
    answer      BLOB    NOT NULL CHECK (length(answer) <= 262144)
) STRICT;

CREATE INDEX stored_answers_by_map ON stored_answers (map_id);

-- The icons of its quads, so that they can be shown beside those of the landmarks.
CREATE TABLE stored_answer_icons (
    answer_id INTEGER NOT NULL REFERENCES stored_answers (id) ON DELETE CASCADE,
    quad      INTEGER NOT NULL,
    -- The landmark that an icon's points were compared with, by its name then, and the matches: nine bytes each, two places of
    -- two 16-bit numbers (1/10000 of a side, little-endian) and whether it agrees.
    matched   TEXT    CHECK (length(matched) <= 64),
    matches   BLOB    CHECK (length(matches) <= 900),
    icon_side INTEGER NOT NULL CHECK (icon_side BETWEEN 1 AND 1024),
    icon      BLOB    NOT NULL CHECK (length(icon) = icon_side * icon_side),
    PRIMARY KEY (answer_id, quad)
) STRICT;
