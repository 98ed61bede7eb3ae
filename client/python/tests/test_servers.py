"""Claim: of several servers on a router a robot follows one for each map, and is told when its own goes and is back."""

from __future__ import annotations

import pytest

from waymark import ServerEvent, ServerGone
from waymark._servers import Servers


def test_a_map_follows_one_server_until_that_serves_it_no_longer() -> None:
    servers = Servers(lambda _: None)
    servers.hear("waymark/1/default/server/a/serves/hall", True)
    assert servers.takes("hall", "a") and not servers.takes("hall", "b") and servers.takes("hall", "a")
    servers.hear("waymark/1/default/server/a/serves/hall", False)
    assert servers.takes("hall", "b")
    assert servers.takes("annex", "c") and servers.takes("hall", "")


def test_gone_and_back_are_told_for_the_map_that_was_entered() -> None:
    events: list[ServerEvent] = []
    servers = Servers(events.append)
    tokens = [f"waymark/1/default/server/a/{each}" for each in ("alive/1", "serves/hall", "robot/r1")]
    for token in tokens:
        servers.hear(token, True)
    servers.raise_if_gone()
    # It lives, and has given both up: that is no end.
    for token in reversed(tokens):
        assert events == []
        servers.hear(token, False)
    assert events == [ServerEvent("gone", "a")]
    with pytest.raises(ServerGone, match="server a is gone"):
        servers.raise_if_gone()
    for token in ("alive/2", "serves/annex"):
        servers.hear(f"waymark/1/default/server/b/{token}", True)
    servers.enter("annex")
    assert events[1:] == [ServerEvent("back", "b", "annex")]
    servers.enter("hall")
    assert events[2:] == [ServerEvent("gone", "a", "hall")]
    for token in tokens:
        servers.hear(token, True)
    assert events[3:] == [ServerEvent("back", "a", "hall")]
    servers.raise_if_gone()
