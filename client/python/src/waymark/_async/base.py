"""A connection to the server's HTTP interface: sends requests, reads answers, turns refusals into errors."""

from __future__ import annotations

import asyncio
import contextlib
import copy
from collections.abc import AsyncIterator, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any, Generic, TypeVar

import httpx

from waymark import _local_token
from waymark._events import EventParser
from waymark._http import (
    MAX_IDLE_S,
    TIMEOUT_S,
    Revised,
    headers_of,
    parsed,
    parsed_items,
    pause_of,
    query_of,
    refusal,
    request_of,
    revision_of,
    trusted,
    unreachable,
)

T = TypeVar("T")
B = TypeVar("B", bound="AsyncBase")


class AsyncBase:
    """Sends requests."""

    def __init__(
        self,
        server: str = "http://127.0.0.1:8080",
        token: str | None = None,
        *,
        authority: str | PathLike[str] | None = None,
    ) -> None:
        """A client of the server at this address, with a token of `waymark token create`. Nothing is sent yet.

        Without a token, that of a server on this machine is taken once it is asked for. `authority` is a PEM file of
        who signs the server's certificate, for `https`: the server's administrator has it, `tls/authority.pem` in the
        data directory. Without it, the authorities of the system are believed; with it, no other.
        """
        self._base = server.rstrip("/")
        self._token = token
        self._local_port = _local_token.local_port(self._base) if token is None else None
        self._key: str | None = None
        self._revision: str | None = None
        self._why: str | None = None
        # Ignores proxies of the environment: the server is in the robot's own network.
        self._http = httpx.AsyncClient(
            base_url=self._base,
            timeout=TIMEOUT_S,
            limits=httpx.Limits(keepalive_expiry=MAX_IDLE_S),
            trust_env=False,
            verify=trusted(self._base, authority),
        )

    def __repr__(self) -> str:
        # The token is a secret.
        return f"{type(self).__name__}({self._base!r})"

    def with_idempotency_key(self: B, key: str) -> B:
        """The same with this key for its next creation, in place of a fresh one: a program that repeats a creation by
        itself, also after its own restart, gives the same key again. The server makes it once, and answers with
        `idempotency_key_reused` if the key was used for another one. 1 to 128 visible ASCII characters; kept for a
        day."""
        other = copy.copy(self)
        other._key = key
        return other

    def if_match(self: B, revision: str) -> B:
        """The same for changes of what still has this revision: another one is refused with `changed_meanwhile` and
        changes nothing. Without it, changes are made whatever is there."""
        other = copy.copy(self)
        other._revision = revision
        return other

    def with_reason(self: B, why: str) -> B:
        """The same with this reason for its changes: the history of the map has it. One line, 1 to 200 characters."""
        other = copy.copy(self)
        other._why = why
        return other

    async def aclose(self) -> None:
        """Closes its connections."""
        await self._http.aclose()

    async def __aexit__(self, *_: object) -> None:
        await self.aclose()

    async def _checked(
        self, call: str, at: Sequence[str | int], is_stream: bool = False, **parts: Any
    ) -> httpx.Response:
        method, path = request_of(call, at)
        headers = headers_of(call, self._key, self._revision, self._why)
        answer = await self._answer(method, path, headers, is_stream, parts)
        pause_s = pause_of(call, answer)
        if pause_s is not None:
            await asyncio.sleep(pause_s)
            answer = await self._answer(method, path, headers, is_stream, parts)
        if isinstance(answer, httpx.HTTPError):
            raise unreachable(self._base, answer) from answer
        if answer.is_error:
            raise refusal(answer)
        return answer

    async def _answer(
        self, method: str, path: str, headers: dict[str, str], is_stream: bool, parts: dict[str, Any]
    ) -> httpx.Response | httpx.HTTPError:
        try:
            await self._find_local_token(parts)
            sent = self._token
            response = await self._sent(method, path, headers, is_stream, parts)
            if response.status_code == 401:
                try:
                    if self._take_local_token(response) != sent:
                        await response.aclose()
                        response = await self._sent(method, path, headers, is_stream, parts)
                except _local_token.NotUsedError as error:
                    await response.aread()
                    raise refusal(response, f" (the local token is not used: {error})") from error
            if response.is_error:
                await response.aread()
            return response
        except httpx.HTTPError as error:
            return error

    async def _find_local_token(self, parts: dict[str, Any]) -> None:
        """Finds the token of the server on this machine before a body is sent: a refusal may break off a large one."""
        is_large = "files" in parts or "content" in parts or (self._token is None and "json" in parts)
        if self._local_port is not None and is_large:
            response = await self._sent(*request_of("whoami", ()), headers={}, is_stream=False, parts={})
            with contextlib.suppress(_local_token.NotUsedError):
                self._take_local_token(response)

    async def _sent(
        self, method: str, path: str, headers: dict[str, str], is_stream: bool, parts: dict[str, Any]
    ) -> httpx.Response:
        if self._token is not None:
            headers = headers | {"Authorization": f"Bearer {self._token}"}
        request = self._http.build_request(method, path, headers=headers, **parts)
        return await self._http.send(request, stream=is_stream)

    def _take_local_token(self, response: httpx.Response) -> str | None:
        """The token of the server on this machine, if a 401 names its file; else the one that there is."""
        file = _local_token.named_file(response)
        if file is not None and self._local_port is not None:
            self._token = _local_token.read(file, self._local_port)
        return self._token

    async def _send(self, kind: type[T], call: str, *at: str | int, **parts: Any) -> T:
        found: T = parsed(kind, await self._checked(call, at, **parts))
        return found

    async def _revised(self, kind: type[T], call: str, *at: str | int) -> Revised[T]:
        response = await self._checked(call, at)
        return Revised(parsed(kind, response), revision_of(response))

    async def _done(self, call: str, *at: str | int) -> None:
        await self._checked(call, at)

    async def _bytes(self, call: str, *at: str | int, **parts: Any) -> bytes:
        return (await self._checked(call, at, **parts)).content

    async def _save(self, path: str | PathLike[str], call: str, *at: str | int) -> int:
        """Writes the answer to a new file; returns its size."""
        response = await self._checked(call, at, is_stream=True)
        size = 0
        try:
            with Path(path).open("xb") as file:
                async for part in response.aiter_bytes():
                    size += file.write(part)
        except httpx.HTTPError as error:
            raise unreachable(self._base, error) from error
        finally:
            await response.aclose()
        return size

    async def _all(self, kind: type[T], call: str, *at: str | int, **query: Any) -> tuple[T, ...]:
        """Every page of a list. What is `None` in the query is left out."""
        return await self._first(None, kind, call, *at, **query)

    async def _first(self, most: int | None, kind: type[T], call: str, *at: str | int, **query: Any) -> tuple[T, ...]:
        """The `most` first items of a list, or all."""
        params = query_of(query)
        items: list[T] = []
        cursor: str | None = None
        while True:
            response = await self._checked(call, at, params=params | ({"cursor": cursor} if cursor else {}))
            page = parsed(_Page, response)
            items.extend(parsed_items(kind, page.items, response))
            if page.next is None or (most is not None and len(items) >= most):
                return tuple(items[:most])
            cursor = page.next

    async def _stream(self, call: str, *at: str | int, **parts: Any) -> AsyncEvents:
        return AsyncEvents(await self._checked(call, at, is_stream=True, **parts))


@dataclass(frozen=True, slots=True)
class _Page:
    items: tuple[Any, ...]
    next: str | None = None


class AsyncEvents:
    """The events of one answer: name and data."""

    def __init__(self, response: httpx.Response) -> None:
        self._response = response

    async def events(self) -> AsyncIterator[tuple[str, str]]:
        """One after the other, until the server ends the stream."""
        parser = EventParser()
        try:
            async for line in self._response.aiter_lines():
                for event in parser.push(line):
                    yield event
        except httpx.StreamClosed:
            return
        except httpx.HTTPError as error:
            raise unreachable(str(self._response.url), error) from error

    async def aclose(self) -> None:
        """Ends the stream."""
        await self._response.aclose()


class AsyncStream(Generic[T]):
    """Events as they come, until the server stops or it is closed. A context manager; iterate over it."""

    def __init__(self, events: AsyncEvents) -> None:
        self._events = events

    def _read(self, name: str, data: str) -> T | None:
        raise NotImplementedError

    async def __aiter__(self) -> AsyncIterator[T]:
        async for name, data in self._events.events():
            value = self._read(name, data)
            if value is not None:
                yield value

    async def aclose(self) -> None:
        """Ends the stream."""
        await self._events.aclose()

    async def __aenter__(self) -> AsyncStream[T]:
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.aclose()
