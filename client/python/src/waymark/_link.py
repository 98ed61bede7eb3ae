"""A robot's zenoh session, shared by `Robot` and `AsyncRobot`. Out: frames, odometry, scans, a liveliness token. In:
answers, poses and changes of maps, handed to listeners on a thread of zenoh.

Nothing here waits but `open`, the questions (`gaze`, `map_version`), and a put on a full link.
"""

from __future__ import annotations

import itertools
import logging
import re
import secrets
import threading
import time
import weakref
from collections.abc import Callable
from typing import Any, Generic, TypeVar

import zenoh
from google.protobuf.message import DecodeError, Message

from waymark._messages import HEAD_BYTES, Sent, frame_message, localise_request, localise_result, prepared
from waymark._servers import Servers
from waymark._session import Delivery, in_words, open_session
from waymark._values import fill, from_message
from waymark.api import LocaliseResult
from waymark.errors import InvalidInput, NoAnswer, NotAdmitted, TlsRefused, Unexpected, Unreachable
from waymark.image import Capture, Picture
from waymark.quads import Quads
from waymark.robot_file import RobotFile
from waymark.v1 import waymark_pb2 as pb
from waymark.wire import Answer, CameraAnswer, GazeAdvice, GazeRequest, MapChanged, Pose2, RobotPose, Scan, ServerEvent

T = TypeVar("T")
M = TypeVar("M", bound=Message)
Listener = Callable[[T], None]

# Answers and poses that wait for a slow reader; beyond, it misses the oldest.
INBOX = 64
# Longest wait for one hello of the server, and time between two questions for it, in seconds.
_HELLO_WAIT_S = 0.5
_HELLO_EVERY_S = 0.05
# A session that was not greeted for so long is opened anew, in seconds: the first, and the most for later ones.
_GREETED_S = (0.5, 2.0)
# Longest wait for the present versions of maps, in seconds.
_VERSION_WAIT_S = 10.0
# Pixels up to here are sent without asking for the server's limit, in bytes: one batch of the transport.
_SMALL_BYTES = 60_000
# Liveliness tokens that a robot may have; an epoch takes the one of its remainder.
_ALIVE_SLOTS = 16
_NAME = re.compile(r"[a-z0-9_-]{1,64}")
_log = logging.getLogger("waymark")


def name(field: str, text: str) -> str:
    """The text, if it is a name."""
    if not _NAME.fullmatch(text):
        raise InvalidInput(f"{field} {text!r} is no name", code="bad_name", field=field)
    return text


class Subscription:
    """Calls a function until it is closed. A context manager."""

    def __init__(self, close: Callable[[], None]) -> None:
        self._close: Callable[[], None] | None = close

    def close(self) -> None:
        """No more calls. No effect the second time."""
        close, self._close = self._close, None
        if close is not None:
            close()

    def __enter__(self) -> Subscription:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class Listeners(Generic[T]):
    """Functions that are called with what arrives."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        # Replaced as a whole: what is being called is not changed.
        self._all: tuple[Listener[T], ...] = ()

    def add(self, listener: Listener[T]) -> Subscription:
        """Calls `listener` from now on."""
        with self._lock:
            self._all = (*self._all, listener)
        return Subscription(lambda: self._remove(listener))

    def _remove(self, listener: Listener[T]) -> None:
        with self._lock:
            self._all = tuple(each for each in self._all if each is not listener)

    def __bool__(self) -> bool:
        return bool(self._all)

    def call(self, value: T) -> None:
        """Calls all. An error in one is logged, and the others are called."""
        for listener in self._all:
            try:
                listener(value)
            except Exception:
                _log.exception("a listener failed")


class Link:
    """An open session under a robot's name."""

    def __init__(
        self,
        robot: str,
        endpoint: str,
        fleet: str,
        delivery: Delivery,
        timeout_s: float,
        epoch: int | None,
        file: RobotFile | None = None,
    ) -> None:
        self.robot = name("robot", robot)
        self.endpoint = endpoint
        self._is_enrolled = file is not None
        prefix = f"waymark/1/{name('fleet', fleet)}"
        self._maps = f"{prefix}/map"
        self._own = f"{prefix}/robot/{robot}"
        # 53 bits, so that JSON readers with doubles keep it whole.
        self.epoch = epoch if epoch is not None else secrets.randbits(53) | 1
        self._seq = itertools.count(1)
        # Of the largest message that the server takes, as far as it is known.
        self._most_bytes = 0
        self._congestion = zenoh.CongestionControl.BLOCK if delivery == "every" else zenoh.CongestionControl.DROP
        self.answers: Listeners[CameraAnswer] = Listeners()
        self.poses: Listeners[RobotPose] = Listeners()
        self.server_events: Listeners[ServerEvent] = Listeners()
        self.servers = Servers(self.server_events.call)
        servers = f"{prefix}/server"
        self._session = open_session(endpoint, delivery, timeout_s, file)
        if file is not None:
            self._greet(file, delivery, timeout_s)
        try:
            # Held: dropping them ends subscriptions and token.
            self._held: list[Any] = [
                # Whether a server lives is known before what it has.
                *(
                    self._session.liveliness().declare_subscriber(key, self._on_server, history=True)
                    for key in (f"{servers}/*/alive/*", f"{servers}/*/serves/*", f"{servers}/*/robot/{robot}")
                ),
                self._session.declare_subscriber(f"{self._own}/answer", self._on_answer),
                self._session.declare_subscriber(f"{self._own}/pose", self._on_pose),
                self._session.liveliness().declare_token(f"{self._own}/alive/{self.epoch % _ALIVE_SLOTS}"),
            ]
        except zenoh.ZError as error:
            self._session.close()
            raise Unreachable(f"zenoh could not subscribe at {endpoint}: {in_words(error)}") from error

        _close_at_the_end(self)

    def close(self) -> None:
        """Ends the session, and with it the robot's presence. No effect the second time."""
        if not self._session.is_closed():
            for each in self._held:
                each.undeclare()
            self._session.close()

    @classmethod
    def of_file(cls, file: RobotFile, delivery: Delivery, timeout_s: float, epoch: int | None) -> Link:
        """A session of an enrolled robot."""
        file.check()
        return cls(file.robot, file.endpoint, file.fleet, delivery, timeout_s, epoch, file)

    def _greet(self, file: RobotFile, delivery: Delivery, timeout_s: float) -> None:
        """Waits for the server's answer: with a certificate that gives no access, everything is dropped silently.

        A session that is not greeted is opened anew: one that met the server's listener as that closed to open again
        may keep a dead link, or none, for ever. The first are given up early: it may open again more than once."""
        until = time.monotonic() + timeout_s
        patience, most = _GREETED_S
        while True:
            end = min(until, time.monotonic() + patience)
            patience = min(2 * patience, most)
            while time.monotonic() < end:
                for answer in self._session.get(f"{self._own}/rpc/hello", timeout=_HELLO_WAIT_S):
                    if answer.ok is not None:
                        return
                time.sleep(_HELLO_EVERY_S)
            self._session.close()
            left = until - time.monotonic()
            if left < _HELLO_WAIT_S:
                break
            try:
                self._session = open_session(self.endpoint, delivery, left, file)
            except (TlsRefused, Unreachable):
                # The server was there and silent: that says more than that the rest was too short for one more link.
                break
        raise NotAdmitted(
            f"the server at {self.endpoint} takes no messages of robot {self.robot} with this certificate"
        )

    def _on_server(self, sample: zenoh.Sample) -> None:
        self.servers.hear(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT)

    def _on_answer(self, sample: zenoh.Sample) -> None:
        if not self.answers:
            return
        camera = sample.attachment.to_bytes().decode(errors="replace") if sample.attachment is not None else ""
        if not _NAME.fullmatch(camera):
            _log.warning("%s: no camera is attached", sample.key_expr)
            return
        answer = _decoded(Answer, pb.Answer(), sample)
        # Refusals are of whoever says them.
        if answer is not None and (answer.status == "rejected" or self.servers.takes(answer.map, answer.server)):
            self.answers.call(CameraAnswer(camera, answer))

    def _on_pose(self, sample: zenoh.Sample) -> None:
        if not self.poses:
            return
        pose = _decoded(RobotPose, pb.RobotPose(), sample)
        # A pose of another epoch belongs to another program under this robot's name.
        if pose is not None and pose.epoch == self.epoch and self.servers.takes(pose.map, pose.server):
            self.poses.call(pose)

    def on_map_changed(self, map: str, listener: Listener[MapChanged]) -> Subscription:
        """Calls `listener` with the present version of a map, and with every new one; `*` stands for all maps, without
        a certificate: one gives access to maps by name."""
        if map == "*" and self._is_enrolled:
            raise InvalidInput("with a certificate a map is named: `*` hears nothing", code="bad_name", field="map")
        # A change that comes before the present version is newer.
        heard: set[str] = set()
        one_by_one = threading.Lock()

        def tell(sample: zenoh.Sample, is_change: bool) -> None:
            changed = _decoded(MapChanged, pb.MapChanged(), sample)
            with one_by_one:
                if changed is not None and (is_change or changed.map not in heard):
                    heard.add(changed.map)
                    listener(changed)

        def present(reply: zenoh.Reply) -> None:
            if reply.ok is not None:
                tell(reply.ok, False)

        which = map if map == "*" else name("map", map)
        # Before the question, so that no change is lost between.
        key = f"{self._maps}/{which}"
        subscriber = self._session.declare_subscriber(f"{key}/changed", lambda sample: tell(sample, True))
        self._session.get(f"{key}/version", present, timeout=_VERSION_WAIT_S)

        def undeclare() -> None:
            if not self._session.is_closed():
                subscriber.undeclare()

        return Subscription(undeclare)

    def next_seq(self) -> int:
        """The number of the next message."""
        return next(self._seq)

    def publish_frame(self, camera: str, frame: Capture | Quads | Picture, seq: int) -> None:
        """Sends a frame, or the quads of one. What is larger than the server takes would be dropped on the way: it is
        sent without its image, and the answer says `too_large`."""
        kind, message = frame_message(self._within(prepared(frame)), self.epoch, seq, self.servers.map)
        self._put(f"{self._own}/{kind}", message, zenoh.Priority.DATA_LOW, name("camera", camera))

    def _within(self, sent: Sent) -> Sent:
        """The same, or without its pixels. The server is asked where they are more than it was known to take: another
        one, with other settings, may have taken its place."""
        size = sent.pixel_bytes + HEAD_BYTES
        if size <= _SMALL_BYTES or size <= self._most_bytes:
            return sent
        self._most_bytes = self._ask_limit()
        return sent.withheld() if 0 < self._most_bytes < size else sent

    def _ask_limit(self) -> int:
        """The largest message that the server takes, in bytes; of several on a router the least. 0: it does not say."""
        told = []
        try:
            for reply in self._session.get(f"{self._own}/rpc/hello", timeout=_HELLO_WAIT_S):
                if reply.ok is not None:
                    hello = pb.Hello.FromString(reply.ok.payload.to_bytes())
                    told.append(hello.frame_bytes)
        except (zenoh.ZError, DecodeError):
            return 0
        return min((each for each in told if each > 0), default=0)

    def publish_odometry(self, odom_from_robot: Pose2, captured_ns: int | None) -> int:
        """Sends odometry, read now or at `captured_ns`."""
        seq = self.next_seq()
        captured_ns = captured_ns or time.time_ns()
        message = pb.Odometry(epoch=self.epoch, seq=seq, captured_ns=captured_ns, map=self.servers.map)
        fill(message.odom_from_robot, odom_from_robot)
        self._put(f"{self._own}/odometry", message.SerializeToString(), zenoh.Priority.DATA)
        return seq

    def publish_scan(self, scan: Scan) -> int:
        """Sends a laser scan."""
        seq = self.next_seq()
        message = pb.Scan(epoch=self.epoch, seq=seq)
        fill(message, scan)
        message.map = scan.map or self.servers.map
        self._put(f"{self._own}/scan", message.SerializeToString(), zenoh.Priority.DATA)
        return seq

    def _put(self, key: str, payload: bytes, priority: zenoh.Priority, attachment: str | None = None) -> None:
        congestion = self._congestion
        try:
            self._session.put(key, payload, congestion_control=congestion, priority=priority, attachment=attachment)
        except zenoh.ZError as error:
            raise Unreachable(f"zenoh could not send to {self.endpoint}: {in_words(error)}") from error

    def gaze(self, request: GazeRequest, wait_s: float) -> GazeAdvice:
        """Asks where to look."""
        message = pb.GazeRequest()
        fill(message, request)
        message.map = request.map or self.servers.map
        advice = self._ask(f"{self._own}/rpc/gaze", message.SerializeToString(), pb.GazeAdvice(), wait_s)
        if advice is None:
            raise NoAnswer(f"no gaze advice within {wait_s} s from {self.endpoint}")
        return from_message(GazeAdvice, advice)

    def localise(self, frame: Capture | Picture | None, scan: Scan | None, map: str, wait_s: float) -> LocaliseResult:
        """Asks where the robot is."""
        sent = self._within(prepared(frame)) if frame is not None else None
        request = localise_request(sent, scan, map or self.servers.map, wait_s)
        reply = self._ask(f"{self._own}/rpc/localise", request, pb.LocaliseReply(), wait_s)
        if reply is None:
            raise NoAnswer(f"no localisation within {wait_s} s from {self.endpoint}")
        return localise_result(reply)

    def map_version(self, map: str, wait_s: float) -> int | None:
        """The present version of a map; `None` if the server has no such map."""
        found = self._ask(f"{self._maps}/{name('map', map)}/version", b"", pb.MapChanged(), wait_s)
        return found.version if found is not None else None

    def _ask(self, key: str, payload: bytes, reply: M, wait_s: float) -> M | None:
        try:
            for answer in self._session.get(key, payload=payload, timeout=wait_s):
                if answer.ok is None:
                    # What zenoh says when the time is up.
                    return None
                reply.ParseFromString(answer.ok.payload.to_bytes())
                return reply
        except zenoh.ZError as error:
            raise Unreachable(f"zenoh could not ask {self.endpoint}: {in_words(error)}") from error
        except DecodeError as error:
            raise Unexpected(f"{key}: {error}") from error
        return None


_open_links: weakref.WeakSet[Link] = weakref.WeakSet()
_end_lock = threading.Lock()
_end_thread: threading.Thread | None = None


def _close_at_the_end(link: Link) -> None:
    """Closes the session when the main thread ends: the interpreter waits for the threads that zenoh calls back on, so
    that a program that leaves a session open would never end."""
    global _end_thread
    with _end_lock:
        _open_links.add(link)
        if _end_thread is None:
            # No daemon: the interpreter waits for it once the main thread has ended, and not before.
            _end_thread = threading.Thread(target=_close_all, name="waymark-end")
            _end_thread.start()


def _close_all() -> None:
    threading.main_thread().join()
    for link in list(_open_links):
        link.close()


def _decoded(kind: type[T], message: Message, sample: zenoh.Sample) -> T | None:
    try:
        message.ParseFromString(sample.payload.to_bytes())
    except DecodeError:
        _log.warning("%s: not a message of this version", sample.key_expr)
        return None
    return from_message(kind, message)
