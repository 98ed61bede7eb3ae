"""What changes on the server."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

EventKind = Literal[
    "map_changed",
    "landmark_changed",
    "landmarks_changed",
    "job",
    "presence",
    "gathering",
    "backup",
    "tokens_changed",
]


@dataclass(frozen=True, slots=True)
class ServerEvent:
    """An event with its id, which `events(last_event_id=...)` goes on after. What is not of its kind is `None`.

    `reset`: events are missing before this one; read anew what is shown. `map_changed`: `map`, and `version`, or `None`
    if the map is gone. `landmark_changed`: `map`, `landmark`, and `change` (added, changed, removed).
    `landmarks_changed`: `map` and their `count`. `job`: `map`, `job`, `state`. `presence`: `map`, `robot`, `present`.
    `gathering`: `map`, `gathering`, and `change` (begun, ended, decided, deleted). `backup`: `backup` and `state`.
    """

    id: str
    at_ms: int
    kind: EventKind | Literal["reset"]
    map: str | None = None
    version: int | None = None
    landmark: str | None = None
    change: str | None = None
    count: int | None = None
    job: int | None = None
    gathering: int | None = None
    state: str | None = None
    robot: str | None = None
    present: bool | None = None
    backup: str | None = None
