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
