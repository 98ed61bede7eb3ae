"""The servers of a router."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ServedMap:
    """A map of a server, and whether robots are answered on it."""

    name: str
    is_served: bool


@dataclass(frozen=True, slots=True)
class ServerBody:
    """A server, with how many robots are registered with it."""

    name: str
    maps: tuple[ServedMap, ...]
    robots: int


@dataclass(frozen=True, slots=True)
class Servers:
    """This server and those that it shares a router with; `router` is empty where it is the router itself."""

    server: str
    router: tuple[str, ...]
    is_connected: bool
    servers: tuple[ServerBody, ...]
    contested_maps: dict[str, tuple[str, ...]]
    contested_robots: dict[str, tuple[str, ...]]
    ignored: int
