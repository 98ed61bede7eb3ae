"""Streams of events: from lines to dataclasses. Nothing here waits."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any, get_args

from waymark._values import from_json
from waymark.api import (
    EventKind,
    LiveAnswer,
    LiveEvent,
    LiveMapChange,
    LiveMissed,
    LiveOdometry,
    LivePose,
    LivePresence,
    LiveTruth,
    ServerEvent,
)
from waymark.errors import Unexpected

# Largest event, in bytes.
MAX_EVENT_BYTES = 4 << 20

_EVENTS: dict[str, Any] = {
    "answer": LiveAnswer,
    "pose": LivePose,
    "odometry": LiveOdometry,
    "truth": LiveTruth,
    "presence": LivePresence,
    "map_changed": LiveMapChange,
    "missed": LiveMissed,
}


def live_event(name: str, data: str) -> LiveEvent | None:
    """An event of a map; `None` for one that a newer server may send and is not known here."""
    kind = _EVENTS.get(name)
    if kind is None:
        return None
    value = json.loads(data)
    if kind is LiveMissed:
        return LiveMissed(int(value))
    event: LiveEvent = from_json(kind, value)
    return event


def server_event(name: str, value: Any) -> ServerEvent | None:
    """An event of the server; `None` for the first of a connection, and for one that only a newer server sends."""
    return from_json(ServerEvent, value) if name == "reset" or name in get_args(EventKind) else None


class EventParser:
    """Cuts a stream of lines into events: name and data."""

    def __init__(self) -> None:
        self._names: list[str] = []
        self._data: list[str] = []
        self._bytes = 0

    def push(self, line: str) -> Iterator[tuple[str, str]]:
        """Takes a line without its end; yields the event that it ends. Comments are skipped."""
        if line:
            self._bytes += len(line)
            if self._bytes > MAX_EVENT_BYTES:
                raise Unexpected(f"an event of more than {MAX_EVENT_BYTES} bytes")
            field, _, value = line.partition(":")
            value = value.removeprefix(" ")
            if field == "event":
                self._names.append(value)
            elif field == "data":
                self._data.append(value)
            return
        names, data = self._names, self._data
        self._names, self._data, self._bytes = [], [], 0
        if names or data:
            yield (names[-1] if names else "message", "\n".join(data))
