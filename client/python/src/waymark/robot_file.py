"""The file that `waymark robot enrol` writes: where a robot connects, and what it shows there."""

from __future__ import annotations

import json
import os
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from waymark.errors import CertificateExpired, InvalidInput

# Names the file for programs that are not told.
ROBOT_FILE_VARIABLE = "WAYMARK_ROBOT_FILE"
# Largest file that is read, in bytes.
_MAX_BYTES = 64 << 10


@dataclass(frozen=True, slots=True)
class RobotFile:
    """A robot's endpoint, names, and PEM files. `expires_ms` is when its certificate ends, ms since the Unix epoch."""

    endpoint: str
    fleet: str
    robot: str
    certificate: Path
    key: Path
    authority: Path | None = None
    expires_ms: int | None = None

    @classmethod
    def read(cls, path: str | os.PathLike[str] | None = None) -> RobotFile:
        """Reads the file, or the one that the variable WAYMARK_ROBOT_FILE names."""
        given = path if path is not None else os.environ.get(ROBOT_FILE_VARIABLE)
        if given is None:
            raise InvalidInput(f"no file is given, and {ROBOT_FILE_VARIABLE} is not set", field="path")
        file = Path(given)
        try:
            if file.stat().st_size > _MAX_BYTES:
                raise ValueError(f"it has more than {_MAX_BYTES} bytes")
            read: dict[str, Any] = json.loads(file.read_text())
            authority = read.get("authority")
            return cls(
                endpoint=str(read["endpoint"]),
                fleet=str(read["fleet"]),
                robot=str(read["robot"]),
                certificate=file.parent / read["certificate"],
                key=file.parent / read["key"],
                authority=None if authority is None else file.parent / authority,
                expires_ms=read.get("expires_ms"),
            )
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            raise InvalidInput(f"{file} is not a file of `waymark robot enrol`: {error!r}", field="path") from error

    def check(self) -> None:
        """Raises `CertificateExpired` if the certificate has ended by this machine's clock."""
        if self.expires_ms is not None and self.expires_ms <= time.time() * 1000:
            raise CertificateExpired(f"{self.certificate}: the certificate of robot {self.robot} has expired")

    def settings(self) -> dict[str, Any]:
        """As zenoh's settings want it."""
        tls: dict[str, Any] = {
            "enable_mtls": True,
            "connect_certificate": str(self.certificate),
            "connect_private_key": str(self.key),
            "verify_name_on_connect": True,
        }
        if self.authority is not None:
            tls["root_ca_certificate"] = str(self.authority)
        return tls
