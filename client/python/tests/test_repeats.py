"""Claim: of two editors the second is told, and a creation is made once, also through a cut connection."""

from __future__ import annotations

import contextlib
import socket
import threading
from collections.abc import Iterator

import pytest
from conftest import Server

from waymark import (
    MapClient,
    Refused,
    Size,
    WallBody,
)


def test_of_two_editors_the_second_is_told(server: Server) -> None:
    with server.maps() as maps:
        maps.create_map("edited")
        maps.add_landmark("edited", "poster")
        seen = maps.landmark("edited", "poster")
        maps.if_match(seen.revision).update_landmark("edited", "poster", size=Size(0.5, 0.5))
        with pytest.raises(Refused, match="if_match") as refused:
            maps.if_match(seen.revision).delete_landmark("edited", "poster")
        assert (refused.value.code, refused.value.status) == ("changed_meanwhile", 412)
        walls = maps.walls_revised("edited")
        assert walls.value.segments == ()
        wall = [WallBody((0.0, 0.0), (4.0, 0.0))]
        maps.set_walls("edited", wall)
        with pytest.raises(Refused, match="changed_meanwhile"):
            maps.if_match(walls.revision).set_walls("edited", wall)
        for found in (maps.visibility_settings_revised("edited"), maps.modalities_revised("edited")):
            assert found.revision
        with pytest.raises(Refused, match="unknown_underlay"):
            maps.underlay_revised("edited")
        maps.if_match(maps.map("edited").revision).delete_map("edited")


def test_a_creation_is_repeated_with_its_key_through_a_cut_connection(server: Server) -> None:
    with MapClient(server.http) as near:
        # The local token is for the server's own port.
        token = near.create_token("relay", role="admin").text
    with cutting_relay(server.http) as relay, MapClient(relay, token=token) as maps:
        # Without its key, the second request would be refused: the map exists.
        assert maps.create_map("cut").name == "cut"
        keyed = maps.with_idempotency_key("test-cut")
        assert keyed.create_map("keyed") == keyed.create_map("keyed")
        with pytest.raises(Refused, match="idempotency_key_reused"):
            keyed.create_map("another")


@contextlib.contextmanager
def cutting_relay(to: str) -> Iterator[str]:
    """A relay that cuts its first connection when the answer comes: the request arrives, the answer does not."""
    host, port = to.removeprefix("http://").split(":")
    listener = socket.create_server(("127.0.0.1", 0))

    def pump(source: socket.socket, sink: socket.socket) -> None:
        with contextlib.suppress(OSError):
            while part := source.recv(1 << 16):
                sink.sendall(part)
            sink.shutdown(socket.SHUT_WR)

    def run() -> None:
        is_first = True
        with contextlib.suppress(OSError):
            while True:
                client, _ = listener.accept()
                upstream = socket.create_connection((host, int(port)))
                threading.Thread(target=pump, args=(client, upstream), daemon=True).start()
                if is_first:
                    is_first = False
                    upstream.recv(1)
                    client.shutdown(socket.SHUT_RDWR)
                else:
                    threading.Thread(target=pump, args=(upstream, client), daemon=True).start()

    threading.Thread(target=run, daemon=True).start()
    with listener:
        yield f"http://127.0.0.1:{listener.getsockname()[1]}"
