-- Who may do what, and who did it.

-- Tokens of people, programs and robots for the HTTP interface. Of a token only the digest of its secret is stored: who
-- reads this table cannot use it. AUTOINCREMENT, so that the number of a forgotten token never means another one.
CREATE TABLE tokens (
    id         INTEGER PRIMARY KEY AUTOINCREMENT,
    name       TEXT    NOT NULL CHECK (length(name) BETWEEN 1 AND 64),
    role       TEXT    NOT NULL CHECK (role IN ('viewer', 'robot', 'teacher', 'operator', 'admin')),
    -- For all maps; 0: for those in `token_maps`.
    everywhere INTEGER NOT NULL CHECK (everywhere IN (0, 1)),
    sha256     BLOB    NOT NULL CHECK (length(sha256) = 32),
    created_ms INTEGER NOT NULL,
    expires_ms INTEGER,
    revoked_ms INTEGER
) STRICT;

-- Maps that a token is for, by their numbers: a new map under the name of a deleted one is another map.
CREATE TABLE token_maps (
    token_id INTEGER NOT NULL REFERENCES tokens (id) ON DELETE CASCADE,
    map_id   INTEGER NOT NULL REFERENCES maps (id) ON DELETE CASCADE,
    PRIMARY KEY (token_id, map_id)
) STRICT, WITHOUT ROWID;
-- A map that is deleted finds its tokens.
CREATE INDEX token_maps_by_map ON token_maps (map_id);

-- Sessions of the pages, so that they outlive a restart of the server. Of a cookie only the digest is stored. A bounded
-- number (MAX_SESSIONS of server/src/identity/sessions.rs). In no history: they are no part of a map.
CREATE TABLE page_sessions (
    sha256   BLOB    PRIMARY KEY CHECK (length(sha256) = 32),
    -- The token that opened it; NULL for the local one of the data directory.
    token_id INTEGER REFERENCES tokens (id) ON DELETE CASCADE,
    ends_ms  INTEGER NOT NULL
) STRICT, WITHOUT ROWID;
-- A token that is deleted finds its sessions.
CREATE INDEX page_sessions_by_token ON page_sessions (token_id);

-- Who changed what, when. Each entry is stored in the transaction of its change and carries the digest of the one before, so
-- that one that is changed, left out or put in between breaks the chain.
CREATE TABLE audit (
    -- 1, 2, 3, ... without gaps.
    seq     INTEGER PRIMARY KEY CHECK (seq > 0),
    time_ms INTEGER NOT NULL,
    -- Name of the token; `server` for what it does by itself.
    actor   TEXT    NOT NULL CHECK (length(actor) BETWEEN 1 AND 64),
    -- Number of the token; NULL for the local one and for the server.
    token   INTEGER,
    -- Method and path of the operation, as in the authorisation table, or what the server did.
    action  TEXT    NOT NULL CHECK (length(action) BETWEEN 1 AND 128),
    -- What it was done to: the path of the request.
    target  TEXT    NOT NULL CHECK (length(target) <= 512),
    -- Id of the request, as in the log and in its answer.
    request TEXT    CHECK (length(request) <= 64),
    -- The reason that was given.
    why     TEXT    CHECK (length(why) BETWEEN 1 AND 200),
    -- Over the digest before and every other column.
    sha256  BLOB    NOT NULL CHECK (length(sha256) = 32)
) STRICT;

-- The last entry that was forgotten for want of room; 0 and zeros before the first.
CREATE TABLE audit_start (
    id     INTEGER PRIMARY KEY CHECK (id = 1),
    seq    INTEGER NOT NULL CHECK (seq >= 0),
    sha256 BLOB    NOT NULL CHECK (length(sha256) = 32)
) STRICT;
INSERT INTO audit_start (id, seq, sha256) VALUES (1, 0, zeroblob(32));

CREATE INDEX audit_by_actor ON audit (actor, seq);

CREATE TRIGGER audit_is_not_changed BEFORE UPDATE ON audit
BEGIN
    SELECT RAISE(ABORT, 'entries of the audit log are not changed');
END;

-- Only the oldest is forgotten, once it is noted as the start.
CREATE TRIGGER audit_is_not_removed BEFORE DELETE ON audit
WHEN OLD.seq <> (SELECT seq FROM audit_start) OR OLD.sha256 <> (SELECT sha256 FROM audit_start)
BEGIN
    SELECT RAISE(ABORT, 'entries of the audit log are not removed');
END;
