"""The servers that a robot meets, where several share a router. In: their liveliness tokens, and what they send. Out:
which server a map follows, and events when the robot's server goes and comes back.

A server that is its own router announces nothing; then nothing here changes what a client does.
"""

from __future__ import annotations

import threading
from collections.abc import Callable

from waymark.errors import ServerGone
from waymark.wire import ServerEvent

# Most tokens that are known, and most maps whose server is.
_MAX_KNOWN = 4096
# Longest time until a wait notices that the server is gone, in seconds.
LOOK_EVERY_S = 0.25


class Servers:
    """What a robot knows of the servers. Methods may be called from any thread."""

    def __init__(self, tell: Callable[[ServerEvent], None]) -> None:
        self._tell = tell
        self._lock = threading.RLock()
        # The map that messages name; empty for none.
        self._map = ""
        # Server, kind and name.
        self._tokens: set[tuple[str, str, str]] = set()
        # The server that had this last: a map, or the robot itself under "".
        self._last: dict[str, str] = {}
        self._followed: dict[str, str] = {}
        self._gone: str | None = None
        # The server of which it was told last that it is gone, until one is back.
        self._told: str | None = None

    @property
    def map(self) -> str:
        """The map that messages name; empty for none."""
        return self._map

    def enter(self, map: str) -> None:
        """Messages name this map from now on."""
        with self._lock:
            self._map = map
            self._changed()

    def hear(self, key: str, is_there: bool) -> None:
        """A token `.../server/{server}/{kind}/{name}` came or went."""
        server, kind, of = key.rsplit("/", 3)[1:]
        with self._lock:
            if not is_there:
                self._tokens.discard((server, kind, of))
            elif len(self._tokens) < _MAX_KNOWN:
                self._tokens.add((server, kind, of))
                what = {"serves": of, "robot": ""}.get(kind)
                if what is not None:
                    self._last[what] = server
            self._changed()

    def _present(self) -> str | None:
        def is_wanted(kind: str, of: str) -> bool:
            return kind == "serves" and of == self._map if self._map else kind == "robot"

        return min((server for server, kind, of in self._tokens if is_wanted(kind, of)), default=None)

    def _lives(self, server: str) -> bool:
        return any(of == server and kind == "alive" for of, kind, _ in self._tokens)

    def _changed(self) -> None:
        present, last = self._present(), self._last.get(self._map)
        gone = last if present is None and last is not None and not self._lives(last) else None
        self._gone = gone
        if gone is not None and gone != self._told:
            self._told = gone
            self._tell(ServerEvent("gone", gone, self._map))
        # A server that lives is back when it has what the robot needs.
        elif present is not None and self._told is not None:
            self._told = None
            self._tell(ServerEvent("back", present, self._map))

    def raise_if_gone(self) -> None:
        """Raises `ServerGone` while the robot's server is gone."""
        gone = self._gone
        if gone is not None:
            what = f", which serves map {self._map}" if self._map else ""
            raise ServerGone(f"server {gone} is gone{what}", field="map" if self._map else "")

    def takes(self, map: str, server: str) -> bool:
        """Whether what a server says of a map is taken: of one at a time, as long as that serves it."""
        if not server:
            return True
        with self._lock:
            followed = self._followed.get(map)
            if followed is not None and followed != server and (followed, "serves", map) in self._tokens:
                return False
            if len(self._followed) >= _MAX_KNOWN:
                self._followed.clear()
            self._followed[map] = server
            return True
