"""Tokens and certificates: who may do what."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

# Each may do all that those before it may.
Role = Literal["viewer", "robot", "teacher", "operator", "admin"]


@dataclass(frozen=True, slots=True)
class Token:
    """A token without its secret. `maps` is `None` for all maps; times are milliseconds since the Unix epoch."""

    id: int
    name: str
    role: Role
    maps: tuple[str, ...] | None
    created_ms: int
    expires_ms: int | None
    revoked_ms: int | None


@dataclass(frozen=True, slots=True)
class CreatedToken:
    """A new token; its text is shown this once."""

    text: str = field(repr=False)
    token: Token


@dataclass(frozen=True, slots=True)
class RobotCertificate:
    """A certificate of a robot. `sha256` is of the certificate (DER), hexadecimal; times are ms since 1970."""

    serial: str
    robot: str
    sha256: str
    issued_ms: int
    expires_ms: int
    revoked_ms: int | None


@dataclass(frozen=True, slots=True)
class EnrolledRobot:
    """A new certificate, with what a robot needs to connect. `authority_pem` is `None` where the server's certificate
    is a file of the operator's own; `zenoh` is the endpoint as the server listens."""

    certificate_pem: str
    authority_pem: str | None
    zenoh: str
    names: tuple[str, ...]
    fleet: str
    certificate: RobotCertificate


@dataclass(frozen=True, slots=True)
class Whoami:
    """Who asks, as the server sees it. `token` is the number of the token, `None` for the local one."""

    name: str
    role: Role
    maps: tuple[str, ...] | None
    token: int | None
    expires_ms: int | None


@dataclass(frozen=True, slots=True)
class PageLink:
    """A link that opens the page once: path and query, to be put after the server's address."""

    path: str = field(repr=False)
    valid_s: int
