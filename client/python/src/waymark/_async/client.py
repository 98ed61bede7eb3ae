"""The teacher's and the administrator's side, over HTTP: one method for each operation of the API."""

from __future__ import annotations

from waymark._async.answers import AsyncAnswers
from waymark._async.audit import AsyncAudit
from waymark._async.events import AsyncEventStreams
from waymark._async.landmarks import AsyncLandmarks
from waymark._async.maps import AsyncMaps
from waymark._async.robots import AsyncRobots
from waymark._async.tokens import AsyncTokens


class AsyncMapClient(AsyncMaps, AsyncLandmarks, AsyncAnswers, AsyncEventStreams, AsyncRobots, AsyncTokens, AsyncAudit):
    """A client of the server's HTTP interface, `http://127.0.0.1:8080` by default. Nothing is sent when it is made.

    On the server's own machine and for the same user it finds its token by itself; else it is given one.

    Errors: `Refused` with code, field, detail and status; `Unreachable`; `InvalidInput`; `Unexpected`.
    """

    async def __aenter__(self) -> AsyncMapClient:
        return self
