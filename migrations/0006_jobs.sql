-- Jobs, and answers to creations that may be repeated.

-- Jobs are rows because a 202 is a promise: what was accepted is still there after a crash and is run again. Progress
-- is not stored, it would be a write per step. The map's name is copied so that a job outlives its map.
CREATE TABLE jobs (
    id         INTEGER PRIMARY KEY AUTOINCREMENT,
    kind       TEXT    NOT NULL CHECK (kind IN ('learn')),
    map        TEXT    NOT NULL,
    request    TEXT    NOT NULL,
    state      TEXT    NOT NULL CHECK (state IN ('queued', 'running', 'done', 'failed', 'cancelled')),
    -- How often it was begun. One that ends the process each time is given up after a few.
    attempts   INTEGER NOT NULL DEFAULT 0 CHECK (attempts >= 0),
    -- Who asked for it, and why.
    author     TEXT    NOT NULL DEFAULT 'server' CHECK (length(author) BETWEEN 1 AND 64),
    why        TEXT    CHECK (length(why) BETWEEN 1 AND 200),
    message    TEXT    NOT NULL DEFAULT '',
    result     TEXT,
    created_ms INTEGER NOT NULL,
    -- When it began to run: with the others, how long it waited and how long it worked.
    started_ms INTEGER,
    ended_ms   INTEGER
) STRICT;

CREATE INDEX jobs_by_state ON jobs (state, id);

-- Answers to creations that came with a key (`Idempotency-Key`), each stored in the transaction of its change. A repeat within
-- a day gets the answer and changes nothing. AUTOINCREMENT: the oldest are those with the least numbers.
CREATE TABLE kept_answers (
    id             INTEGER PRIMARY KEY AUTOINCREMENT,
    -- Number of the token that asked, a blank, and its key: nobody gets an answer to somebody else.
    key            TEXT    NOT NULL UNIQUE CHECK (length(key) BETWEEN 1 AND 160),
    -- Of method, path and body: the same key with another request is refused.
    request_sha256 BLOB    NOT NULL CHECK (length(request_sha256) = 32),
    status         INTEGER NOT NULL CHECK (status BETWEEN 200 AND 299),
    -- JSON, as it was sent.
    body           TEXT    NOT NULL,
    created_ms     INTEGER NOT NULL
) STRICT;

CREATE INDEX kept_answers_by_age ON kept_answers (created_ms);
