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
