# Made by tools/generate.py from _async/client.py. Do not edit.
"""The teacher's and the administrator's side, over HTTP: one method for each operation of the API."""

from __future__ import annotations

from waymark._sync.answers import Answers
from waymark._sync.audit import Audit
from waymark._sync.events import EventStreams
from waymark._sync.landmarks import Landmarks
from waymark._sync.maps import Maps
from waymark._sync.robots import Robots
from waymark._sync.tokens import Tokens


class MapClient(Maps, Landmarks, Answers, EventStreams, Robots, Tokens, Audit):
    """A client of the server's HTTP interface, `http://127.0.0.1:8080` by default. Nothing is sent when it is made.

    On the server's own machine and for the same user it finds its token by itself; else it is given one.

    Errors: `Refused` with code, field, detail and status; `Unreachable`; `InvalidInput`; `Unexpected`.
    """

    def __enter__(self) -> MapClient:
        return self
