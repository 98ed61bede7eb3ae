"""What changes on the server, as a stream that outlives its connections."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Iterable

from waymark._async.base import AsyncBase, AsyncEvents
from waymark._events import server_event
from waymark._http import FIRST_PAUSE_S, MAX_PAUSE_S, is_passing, query_of
from waymark.api import EventKind, ServerEvent
from waymark.errors import WaymarkError


class AsyncServerEvents:
    """The events of a server, one after the other. A lost connection is replaced, and the events meanwhile follow;
    where the server has forgotten some of them, an event `reset` says to read anew. Iterating ends when it is closed,
    and raises `Refused` when the server refuses, for instance because the token was revoked."""

    def __init__(self, client: AsyncBase, query: dict[str, str | None], events: AsyncEvents) -> None:
        self._client = client
        self._query = query
        self._events: AsyncEvents | None = events
        self._is_closed = False

    @property
    def last_event_id(self) -> str | None:
        """The id of the last event, to go on after it: also after a start of this program."""
        return self._query["last_event_id"]

    async def __aiter__(self) -> AsyncIterator[ServerEvent]:
        pause_s = FIRST_PAUSE_S
        while not self._is_closed:
            try:
                if self._events is None:
                    self._events = await self._client._stream("events", params=query_of(self._query))
                async for name, data in self._events.events():
                    pause_s = FIRST_PAUSE_S
                    value = json.loads(data)
                    self._query["last_event_id"] = value["id"]
                    event = server_event(name, value)
                    if event is not None:
                        yield event
            except WaymarkError as error:
                if not is_passing(error):
                    raise
            self._events = None
            if not self._is_closed:
                await asyncio.sleep(pause_s)
                pause_s = min(2 * pause_s, MAX_PAUSE_S)

    async def aclose(self) -> None:
        """Ends the stream."""
        self._is_closed = True
        if self._events is not None:
            await self._events.aclose()

    async def __aenter__(self) -> AsyncServerEvents:
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.aclose()


class AsyncEventStreams(AsyncBase):
    """Operations on events."""

    async def events(
        self,
        *,
        map: str | None = None,
        kinds: Iterable[EventKind] | None = None,
        last_event_id: str | None = None,
    ) -> AsyncServerEvents:
        """Follows what changes on the server, as far as the token may see it: of one map, of some kinds, after an event
        that was received before. Close the stream, or use it as a context manager."""
        kind = None if kinds is None else ",".join(kinds)
        query = {"map": map, "kind": kind, "last_event_id": last_event_id}
        return AsyncServerEvents(self, query, await self._stream("events", params=query_of(query)))
