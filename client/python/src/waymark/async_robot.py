"""The robot's side for programs of asyncio: the methods of `Robot`, awaited. What may wait runs on a thread."""

from __future__ import annotations

import asyncio
import contextlib
import os
from collections import deque
from collections.abc import AsyncIterator
from typing import Any, Generic, TypeVar
from weakref import WeakSet

from waymark._link import INBOX, Link, Listener, Subscription, name
from waymark._servers import LOOK_EVERY_S
from waymark._session import Delivery
from waymark.api import LocaliseResult
from waymark.errors import NoAnswer
from waymark.image import Capture, Picture
from waymark.quads import Quads
from waymark.robot import matching
from waymark.robot_file import RobotFile
from waymark.wire import Answer, CameraAnswer, GazeAdvice, GazeRequest, MapChanged, Pose2, RobotPose, Scan, ServerEvent

T = TypeVar("T")


class AsyncInbox(Generic[T]):
    """What arrives from now on, for one reader of the event loop that it was made in. At most 64 wait: beyond, the
    oldest is missed, and `missed` counts. Iterate over it with `async for`, or await `get`."""

    def __init__(self) -> None:
        self._waiting: deque[T] = deque()
        self._changed = asyncio.Event()
        self._is_closed = False
        self._loop = asyncio.get_running_loop()
        self._subscription: Subscription | None = None
        self.missed = 0

    def _attach(self, subscription: Subscription) -> AsyncInbox[T]:
        self._subscription = subscription
        return self

    def _push(self, value: T) -> None:
        # From a thread of zenoh. A loop that has ended reads nothing any more.
        with contextlib.suppress(RuntimeError):
            self._loop.call_soon_threadsafe(self._store, value)

    def _store(self, value: T) -> None:
        if len(self._waiting) == INBOX:
            self._waiting.popleft()
            self.missed += 1
        self._waiting.append(value)
        self._changed.set()

    async def get(self, wait_s: float | None = None) -> T | None:
        """The next, waiting at most so long, or for ever; `None` when the time is up or the inbox is closed."""
        while not self._waiting and not self._is_closed:
            self._changed.clear()
            try:
                await asyncio.wait_for(self._changed.wait(), wait_s)
            except asyncio.TimeoutError:
                return None
        return self._waiting.popleft() if self._waiting else None

    async def __aiter__(self) -> AsyncIterator[T]:
        while True:
            value = await self.get()
            if value is None:
                return
            yield value

    def close(self) -> None:
        """Nothing more arrives; what waits can still be read."""
        if self._subscription is not None:
            self._subscription.close()
        self._is_closed = True
        self._changed.set()

    async def __aenter__(self) -> AsyncInbox[T]:
        return self

    async def __aexit__(self, *_: object) -> None:
        self.close()


class AsyncRobot:
    """A robot's connection, made by `await AsyncRobot.connect(...)`; an asynchronous context manager."""

    def __init__(self, link: Link) -> None:
        self._link = link
        self._inboxes: WeakSet[AsyncInbox[Any]] = WeakSet()

    @classmethod
    async def connect(
        cls,
        robot: str,
        *,
        endpoint: str = "tcp/127.0.0.1:7447",
        fleet: str = "default",
        delivery: Delivery = "latest",
        timeout_s: float = 5.0,
        epoch: int | None = None,
    ) -> AsyncRobot:
        """Connects as `Robot.connect` does."""
        return cls(await asyncio.to_thread(Link, robot, endpoint, fleet, delivery, timeout_s, epoch))

    @classmethod
    async def from_file(
        cls,
        path: str | os.PathLike[str] | None = None,
        *,
        delivery: Delivery = "latest",
        timeout_s: float = 5.0,
        epoch: int | None = None,
    ) -> AsyncRobot:
        """Connects with encryption as the robot of a file of `waymark robot enrol`, or of the file that the variable
        WAYMARK_ROBOT_FILE names.

        Raises `CertificateExpired`; `TlsRefused` if the two sides do not accept each other's certificates;
        `NotAdmitted` if this one was revoked; `Unreachable` after `timeout_s`.
        """
        file = RobotFile.read(path)
        return cls(await asyncio.to_thread(Link.of_file, file, delivery, timeout_s, epoch))

    def __repr__(self) -> str:
        return f"AsyncRobot({self._link.robot!r}, endpoint={self._link.endpoint!r})"

    @property
    def name(self) -> str:
        """The robot's name."""
        return self._link.robot

    @property
    def epoch(self) -> int:
        """Epoch of this start of the robot's software."""
        return self._link.epoch

    def enter_map(self, map: str | None) -> None:
        """From now on frames, odometry, scans and questions name this map, unless they name one themselves; `None`:
        none, and the server where the robot is registered takes them. For a robot that drives into a building whose map
        another server on the same router has: it is registered there, too, and goes on."""
        self._link.servers.enter(name("map", map) if map is not None else "")

    def server_events(self) -> AsyncInbox[ServerEvent]:
        """When the server of the robot's map goes and comes back, where several servers share a router."""
        inbox: AsyncInbox[ServerEvent] = AsyncInbox()
        self._inboxes.add(inbox)
        return inbox._attach(self._link.server_events.add(inbox._push))

    async def publish_frame(self, camera: str, frame: Capture | Quads | Picture) -> int:
        """Sends a frame, or the quads of one, and returns its number."""
        seq = self._link.next_seq()
        await asyncio.to_thread(self._link.publish_frame, camera, frame, seq)
        return seq

    async def recognise(self, camera: str, frame: Capture | Quads | Picture, *, wait_s: float = 10.0) -> Answer:
        """Sends a frame, or the quads of one, and waits for its answer. One at a time for each camera, or the older is
        `Superseded`. Raises `ServerGone` as soon as it is known that the server of the robot's map is not there."""
        self._link.servers.raise_if_gone()
        seq = self._link.next_seq()
        answers: AsyncInbox[CameraAnswer] = AsyncInbox()
        async with answers._attach(self._link.answers.add(answers._push)):
            await asyncio.to_thread(self._link.publish_frame, camera, frame, seq)
            loop = asyncio.get_running_loop()
            until = loop.time() + wait_s
            while (left := until - loop.time()) > 0:
                answer = matching(await answers.get(min(left, LOOK_EVERY_S)), camera, self.epoch, seq)
                if answer is not None:
                    return answer
                self._link.servers.raise_if_gone()
        raise NoAnswer(f"no answer to frame {seq} within {wait_s} s from {self._link.endpoint}")

    def answers(self) -> AsyncInbox[CameraAnswer]:
        """Every answer from now on, of all cameras."""
        inbox: AsyncInbox[CameraAnswer] = AsyncInbox()
        self._inboxes.add(inbox)
        return inbox._attach(self._link.answers.add(inbox._push))

    def on_answer(self, call: Listener[CameraAnswer]) -> Subscription:
        """Calls a function with every answer from now on, on a thread of the session; it should be quick."""
        return self._link.answers.add(call)

    def poses(self) -> AsyncInbox[RobotPose]:
        """Every fused pose from now on. None older than 2 s is sent: silence means that the pose is unknown."""
        inbox: AsyncInbox[RobotPose] = AsyncInbox()
        self._inboxes.add(inbox)
        return inbox._attach(self._link.poses.add(inbox._push))

    def on_pose(self, call: Listener[RobotPose]) -> Subscription:
        """Calls a function with every fused pose from now on, on a thread of the session; it should be quick."""
        return self._link.poses.add(call)

    def map_changes(self, map: str) -> AsyncInbox[MapChanged]:
        """The present version of a map, then every new one; `*` stands for all maps, without a certificate."""
        inbox: AsyncInbox[MapChanged] = AsyncInbox()
        self._inboxes.add(inbox)
        return inbox._attach(self._link.on_map_changed(map, inbox._push))

    def on_map_changed(self, map: str, call: Listener[MapChanged]) -> Subscription:
        """Calls a function with the present version of a map, then with every new one, on a thread of the session; it
        should be quick."""
        return self._link.on_map_changed(map, call)

    async def publish_odometry(self, odom_from_robot: Pose2, captured_ns: int | None = None) -> int:
        """Sends odometry, read now or at `captured_ns` of the robot's clock; at least once a second, also at rest."""
        return await asyncio.to_thread(self._link.publish_odometry, odom_from_robot, captured_ns)

    async def publish_scan(self, scan: Scan) -> int:
        """Sends a laser scan. It corrects a known pose on a map with walls and never gives a first one."""
        return await asyncio.to_thread(self._link.publish_scan, scan)

    async def gaze(self, request: GazeRequest, *, wait_s: float = 5.0) -> GazeAdvice:
        """Asks where to look, for a camera that turns."""
        return await asyncio.to_thread(self._link.gaze, request, wait_s)

    async def localise(
        self,
        frame: Capture | Picture | None = None,
        scan: Scan | None = None,
        *,
        map: str = "",
        wait_s: float = 10.0,
    ) -> LocaliseResult:
        """Asks where the robot is by a frame with intrinsics and mounting, a scan from the same place, or both, without
        its history; the server searches for at most 10 s. Raises `Refused` with code and field, of which `too_many`
        says to ask again later."""
        return await asyncio.to_thread(self._link.localise, frame, scan, map, wait_s)

    async def map_version(self, map: str, *, wait_s: float = 5.0) -> int | None:
        """The present version of a map; `None` if the server has no such map."""
        return await asyncio.to_thread(self._link.map_version, map, wait_s)

    async def close(self) -> None:
        """Ends the session in order, and every iteration over what arrives."""
        for inbox in list(self._inboxes):
            inbox.close()
        await asyncio.to_thread(self._link.close)

    async def __aenter__(self) -> AsyncRobot:
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.close()
