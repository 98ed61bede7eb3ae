"""Backups of the server's data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

BackupState = Literal["running", "complete", "failed", "damaged"]


@dataclass(frozen=True, slots=True)
class BackupMap:
    """What a backup holds of one map: numbers of rows, and a digest of them all."""

    name: str
    version: int
    landmarks: int
    views: int
    models: int
    walls: int
    sha256: str


@dataclass(frozen=True, slots=True)
class BackupManifest:
    """What a backup holds. `faults` is what was wrong with the data when it was made."""

    created_ms: int
    program: str
    schema: int
    maps: tuple[BackupMap, ...]
    pictures: int
    faults: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Backup:
    """A backup in the server's data directory. Its name is its time in UTC."""

    name: str
    state: BackupState
    created_ms: int
    bytes: int
    reason: str | None = None
    manifest: BackupManifest | None = None


@dataclass(frozen=True, slots=True)
class BackupHealth:
    """The newest backup, and why the last attempt failed. `every_hours` 0: none are scheduled."""

    every_hours: int
    newest: str | None = None
    newest_ms: int | None = None
    failed: str | None = None
