-- Tokens of people, programs and robots for the HTTP interface. Of a token only the digest of its secret is stored: who
-- reads this table cannot use it. AUTOINCREMENT, so that the number of a forgotten token never means another one.
CREATE TABLE tokens (
    id         INTEGER PRIMARY KEY AUTOINCREMENT,
    name       TEXT    NOT NULL CHECK (length(name) BETWEEN 1 AND 64),
    role       TEXT    NOT NULL CHECK (role IN ('viewer', 'robot', 'teacher', 'operator', 'admin')),
    -- NULL: all maps. Otherwise a JSON list of numbers of maps: a new map under the name of a deleted one is another map.
    maps       TEXT    CHECK (maps IS NULL OR json_type(maps) = 'array'),
    sha256     BLOB    NOT NULL CHECK (length(sha256) = 32),
    created_ms INTEGER NOT NULL,
    expires_ms INTEGER,
    revoked_ms INTEGER
) STRICT;
