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
