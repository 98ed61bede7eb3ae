"""The audit log: who changed what."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class AuditEntry:
    """A change. `token` is the number of a token, `None` for the local one and the server; `time_ms` since 1970."""

    seq: int
    time_ms: int
    actor: str
    token: int | None
    action: str
    target: str
    request: str | None
    sha256: str


@dataclass(frozen=True, slots=True)
class AuditHead:
    """The newest entry. Noted elsewhere, it proves later that nothing before it was changed."""

    seq: int
    sha256: str


@dataclass(frozen=True, slots=True)
class AuditCheck:
    """The audit log as it was found. `fault` is the first thing that is wrong, `None` where it is as it was written."""

    entries: int
    forgotten: int
    head: AuditHead
    fault: str | None
