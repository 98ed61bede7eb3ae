"""Claim: events are followed through a lost connection, stored answers are listed, what was learnt is shown, and a
robot is found without its history."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import socket
import threading
from collections.abc import Callable, Iterator

import pictures
import pytest
from conftest import Server

from waymark import AsyncMapClient, Image, MapClient, Pose2, Pose3, Refused
from waymark.wire import Scan


@contextlib.contextmanager
def relay(to: str) -> Iterator[tuple[str, Callable[[], None]]]:
    """A relay to a server, and what cuts its present connections."""
    host, port = to.removeprefix("http://").split(":")
    listener = socket.create_server(("127.0.0.1", 0))
    ends: list[socket.socket] = []

    def pump(source: socket.socket, sink: socket.socket) -> None:
        with contextlib.suppress(OSError):
            while part := source.recv(1 << 16):
                sink.sendall(part)

    def run() -> None:
        with contextlib.suppress(OSError):
            while True:
                client, _ = listener.accept()
                upstream = socket.create_connection((host, int(port)))
                ends.extend((client, upstream))
                threading.Thread(target=pump, args=(client, upstream), daemon=True).start()
                threading.Thread(target=pump, args=(upstream, client), daemon=True).start()

    def cut() -> None:
        while ends:
            with contextlib.suppress(OSError):
                ends.pop().shutdown(socket.SHUT_RDWR)

    threading.Thread(target=run, daemon=True).start()
    with listener:
        yield f"http://127.0.0.1:{listener.getsockname()[1]}", cut


def test_events_are_followed_through_a_lost_connection(server: Server) -> None:
    with server.maps() as maps:
        text = maps.create_token("watcher", role="viewer").text
        with maps.events(kinds=["map_changed"]) as direct:
            maps.create_map("watched")
            first = next(iter(direct))
            assert (first.kind, first.map, first.version) == ("map_changed", "watched", 1)
        with relay(server.http) as (near, cut), MapClient(near, token=text) as watcher:
            with pytest.raises(Refused, match="kind"):
                watcher.events(kinds=["weather"])  # type: ignore[list-item]
            with watcher.events(map="watched", last_event_id=first.id) as events:
                maps.add_landmark("watched", "door")
                stream = iter(events)
                assert next(stream).kind == "map_changed"
                cut()
                maps.add_landmark("watched", "sign")
                found = [(event.kind, event.landmark, event.change) for event in itertools.islice(stream, 3)]
                assert found[0] == ("landmark_changed", "door", "added")
                assert found[2] == ("landmark_changed", "sign", "added")
                assert events.last_event_id is not None

    async def asynchronous() -> str:
        async with AsyncMapClient(server.http) as maps, await maps.events(map="watched") as events:
            await maps.delete_landmark("watched", "door")
            async for event in events:
                return event.kind
        return ""

    assert asyncio.run(asynchronous()) == "map_changed"


def test_what_was_learnt_is_shown(server: Server, taught: str) -> None:
    with server.maps() as maps:
        assert maps.stored_answers(map=taught, status="rejected") == ()
        with pytest.raises(Refused, match="unknown_answer"):
            maps.stored_answer(1 << 40)
        with pytest.raises(Refused, match="unknown_answer"):
            maps.stored_quad_icon(1 << 40, 0)
        landmark = maps.landmarks(taught)[0].name
        model = maps.landmark_model(taught, landmark)
        assert model.landmark == landmark and model.correlation.threshold > 0
        distances = maps.landmark_distances(taught, landmark)
        assert distances.correlation.threshold == model.correlation.threshold
        evidence = maps.landmark_evidence(taught, landmark)
        assert evidence.threshold == 5 and len(evidence.named) == len(evidence.doubtful) and evidence.answers >= 0
        assert maps.landmark_icon(taught, landmark).startswith(b"\x89PNG")
        assert isinstance(maps.duplicates(taught), tuple)
        views = maps.views(taught, landmark)
        assert maps.find_views(taught, landmark, sort="-number") == tuple(reversed(views))
        with pytest.raises(Refused, match="unknown_view"):
            maps.refused_view_icon(taught, landmark, 1 << 40)
        again = maps.view_image(taught, landmark, views[0].id)
        maps.upload_view(taught, landmark, again, views[0].corners)
        refused = maps.refused_views(taught, landmark)[0]
        assert (refused.by, refused.reason, refused.view) == ("upload", "duplicate", views[0].id)
        assert maps.refused_view_icon(taught, landmark, refused.id).startswith(b"\x89PNG")
        mounting = Pose3.mounting(0.0, 0.0, pictures.CAMERA_HEIGHT_M)
        found = maps.localise(taught, Image.rgb(pictures.seen_from(pictures.front())), pictures.CAMERA, mounting)
        assert found.status == "located" and found.map_from_robot is not None, found
        pose, truth = found.map_from_robot.pose, pictures.front()
        assert abs(pose.x_m - truth.x_m) < 0.2 and abs(pose.y_m - truth.y_m) < 0.2
        assert found.hypotheses[0].landmarks == ("poster-0",) and found.answer is not None
        # A map without walls tells nothing by a scan.
        scan = Scan((2.0,) * 90, 0.0, 0.05, 9.0, Pose2())
        assert maps.localise(taught, scan=scan).reason == "few_points"
        maps.create_map("untaught")
        maps.upload_view("untaught", "sign", pictures.teaching_photo(7), "whole_image", make_landmark=True)
        with pytest.raises(Refused, match="not_learnt"):
            maps.landmark_model("untaught", "sign")
