-- Visibility areas of landmarks: computed, not given, so they are in no history. One is used while `inputs_sha256` is the
-- digest of everything that it depends on; a row that is missing or of other inputs is computed again.
CREATE TABLE visibility_areas (
    landmark_id   INTEGER PRIMARY KEY REFERENCES landmarks (id) ON DELETE CASCADE,
    inputs_sha256 BLOB    NOT NULL CHECK (length(inputs_sha256) = 32),
    area          BLOB    NOT NULL CHECK (length(area) <= 262144)
) STRICT;
