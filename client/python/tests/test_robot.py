"""Claim: a robot in Python sends frames of every encoding and gets answers, poses and changes of maps, by reply, by
iteration and by callback; what is wrong is an error with a code."""

from __future__ import annotations

import dataclasses
import math
import subprocess
import sys
import threading
import time
from collections.abc import Callable

import numpy as np
import pictures
import pytest
from conftest import SOON_S, Server

from waymark import (
    Answer,
    CameraAnswer,
    Capture,
    Image,
    InvalidInput,
    NoAnswer,
    Pose2,
    Pose3,
    Quads,
    Refused,
    Robot,
    RobotPose,
    Scan,
    Superseded,
    Unreachable,
    named_landmarks,
    quad_corners,
)
from waymark.robot import matching
from waymark.wire import GazeRequest, MapChanged

MOUNTING = Pose3.mounting(0.0, 0.0, pictures.CAMERA_HEIGHT_M)


def connect(server: Server, robot: str) -> Robot:
    return Robot.connect(robot, endpoint=server.zenoh, delivery="every")


def capture(image: Image, odometry: Pose2 | None = None) -> Capture:
    return Capture(
        image,
        intrinsics=pictures.CAMERA,
        robot_from_camera=MOUNTING,
        odometry=odometry,
        deadline_ms=60_000,
    )


def recognised(answer: Answer) -> list[str]:
    return [named.name for named in named_landmarks(answer.accepted())]


def test_frames_of_every_encoding_are_recognised(server: Server, taught: str) -> None:
    rgb = pictures.seen_from(pictures.front(2.2))
    bgr = np.ascontiguousarray(rgb[:, :, ::-1])
    gray = np.rint(rgb @ np.array([0.299, 0.587, 0.114])).astype(np.uint8)
    images = {
        "rgb8": Image.rgb(rgb),
        "bgr8": Image.bgr(bgr),
        "bgr8 mirrored view": Image.bgr(rgb[:, :, ::-1]),
        "rgb8 bytes": Image.rgb(rgb.tobytes(), (pictures.WIDTH_PX, pictures.HEIGHT_PX)),
        "gray8": Image.gray(gray),
        "png": Image.rgb(rgb).png(),
        "jpeg": Image.bgr(bgr).jpeg(95),
    }
    answers = {}
    with connect(server, taught) as robot:
        for name, image in images.items():
            answers[name] = robot.recognise("front", capture(image), wait_s=SOON_S)
            assert recognised(answers[name]) == ["poster-0"], name
    # Raw colour and PNG are the same grey: the same quads to the last bit.
    same = [answers[name].quads for name in ("rgb8", "bgr8", "bgr8 mirrored view", "rgb8 bytes", "png")]
    assert all(quads == same[0] for quads in same)
    found = np.array(quad_corners(named_landmarks(answers["rgb8"])[0].quad))
    assert np.abs(found - np.array(pictures.corners_px(pictures.front(2.2)))).max() < 2.0


def test_a_frame_over_the_limit_is_refused_at_once(server: Server, taught: str) -> None:
    raw = Image.bgr(bytes(1920 * 1200 * 3), (1920, 1200))
    with connect(server, taught) as robot, server.maps() as maps:
        begun = time.monotonic()
        with pytest.raises(Refused) as refused:
            robot.recognise("wide", raw, wait_s=SOON_S).accepted()
        assert time.monotonic() - begun < SOON_S / 3
        assert (refused.value.code, refused.value.field) == ("too_large", "image")
        assert "6912000" in str(refused.value) and "limits.frame_bytes" in str(refused.value)
        with pytest.raises(Refused) as asked:
            robot.localise(capture(raw), wait_s=SOON_S)
        assert (asked.value.code, asked.value.field) == ("too_large", "frame.image")
        # The page of the robot counts it, too.
        activity = maps.robot(taught).activity
        assert activity is not None
        reasons = [reason.code for each in activity.inputs for reason in each.reasons]
        assert "too_large" in reasons, activity
        # Whatever fits is sent whole.
        answer = robot.recognise("wide", Image.bgr(bytes(1280 * 1024 * 3), (1280, 1024)), wait_s=SOON_S)
        assert answer.accepted().status == "no_match"


def test_a_camera_of_another_scale_gives_the_same_pose(server: Server, taught: str) -> None:
    half = dataclasses.replace(
        pictures.CAMERA, fx_px=250.0, fy_px=250.0, cx_px=159.5, cy_px=119.5, width_px=320, height_px=240
    )
    image = Image.rgb(pictures.seen_from(pictures.front(2.0)))
    with connect(server, taught) as robot:
        answers = [
            robot.recognise("front", dataclasses.replace(capture(image), intrinsics=camera), wait_s=SOON_S)
            for camera in (pictures.CAMERA, half, dataclasses.replace(half, height_px=200))
        ]
    first, scaled = (answer.map_from_robot for answer in answers[:2])
    assert first is not None and scaled is not None
    assert math.hypot(first.pose.x_m - scaled.pose.x_m, first.pose.y_m - scaled.pose.y_m) < 0.01
    rejection = answers[2].rejection
    assert rejection is not None and (rejection.code, rejection.field) == ("size_mismatch", "intrinsics.width_px")


def test_pictures_of_pillow_are_taken_wherever_a_picture_is(server: Server, taught: str) -> None:
    from PIL import Image as Pillow

    picture = Pillow.fromarray(pictures.seen_from(pictures.front(2.0)))
    with connect(server, taught) as robot, server.maps() as maps:
        assert recognised(robot.recognise("front", picture, wait_s=SOON_S)) == ["poster-0"]
        of_capture = Capture(picture, pictures.CAMERA, MOUNTING, deadline_ms=60_000)
        assert robot.recognise("front", of_capture, wait_s=SOON_S).accepted().map_from_robot is not None
        assert robot.localise(of_capture, wait_s=SOON_S).status == "located"
        assert recognised(maps.recognise(taught, picture)) == ["poster-0"]


def test_an_address_without_a_server_names_no_builder(server: Server) -> None:
    with pytest.raises(Unreachable) as refused:
        Robot.connect("r1", endpoint="tcp/127.0.0.1:1", timeout_s=0.5)
    text = str(refused.value)
    assert ".rs" not in text and "cargo" not in text and "tcp/127.0.0.1:1" in text, text
    assert text.startswith("unreachable") and "waymark serve" in text


def test_a_frame_gives_the_pose_of_the_robot(server: Server, taught: str) -> None:
    truth = Pose2(5.4, 2.0, -math.pi / 2 - 0.15)
    with connect(server, taught) as robot:
        answer = robot.recognise("front", capture(Image.rgb(pictures.seen_from(truth))), wait_s=SOON_S)
    assert answer.map_from_robot is not None, answer
    pose = answer.map_from_robot.pose
    assert math.hypot(pose.x_m - truth.x_m, pose.y_m - truth.y_m) < 0.1
    assert abs(pose.theta_rad - truth.theta_rad) < 0.05
    assert answer.pose_landmarks == ("poster-0",) and answer.map == taught
    assert all(0 < sigma < 0.5 for sigma in answer.map_from_robot.sigma)


def test_a_pose_that_is_refused_says_which_number_does_not_fit(server: Server, taught: str) -> None:
    image = Image.rgb(pictures.seen_from(pictures.front(2.0)))
    low = Capture(image, pictures.CAMERA, Pose3.mounting(0.0, 0.0, 0.6), deadline_ms=60_000)
    with connect(server, taught) as robot:
        answer = robot.recognise("front", low, wait_s=SOON_S)
    assert (answer.map_from_robot, answer.pose_refusal) == (None, "gate_reprojection")
    detail = answer.pose_refusal_detail
    assert detail is not None and detail.chi2 > detail.limit and detail.sentence
    height = next(cause for cause in detail.causes if cause.quantity == "camera_height")
    assert (height.expected, height.unit) == (0.6, "m") and abs(height.measured - pictures.CAMERA_HEIGHT_M) < 0.1


def test_answers_and_poses_come_by_iteration_and_by_callback(server: Server, taught: str) -> None:
    called: list[CameraAnswer | RobotPose] = []
    with connect(server, taught) as robot, robot.answers() as answers, robot.poses() as poses:
        with robot.on_answer(called.append), robot.on_pose(called.append):
            image = Image.rgb(pictures.seen_from(pictures.front())).jpeg(95)
            start = robot.publish_odometry(Pose2())
            seq = robot.publish_frame("front", capture(image, Pose2()))
            assert seq == start + 1
            arrived = answers.get(SOON_S)
            assert arrived is not None and arrived.camera == "front" and arrived.answer.seq == seq
            assert arrived.answer.epoch == robot.epoch
            pose = pose_of(robot, poses.get)
            assert pose.map == taught and pose.map_from_robot is not None
            assert math.hypot(pose.map_from_robot.pose.x_m - 5.0, pose.map_from_robot.pose.y_m - 2.0) < 0.1
            # The readers of the inboxes are served first.
            assert eventually(lambda: {type(each) for each in called} == {CameraAnswer, RobotPose})
        so_far = len(called)
        robot.recognise("front", capture(image), wait_s=SOON_S)
        assert len(called) == so_far, "a closed subscription is called no more"
        threading.Timer(0.2, answers.close).start()
        rest = [arrived.answer.seq for arrived in answers]
        assert len(rest) == 1 and rest[0] > seq, "the iteration ends when the inbox is closed"


def pose_of(robot: Robot, get: object) -> RobotPose:
    """The first fused pose; odometry goes on meanwhile."""
    assert callable(get)
    until = time.monotonic() + SOON_S
    while time.monotonic() < until:
        robot.publish_odometry(Pose2())
        pose = get(0.2)
        if pose is not None:
            assert isinstance(pose, RobotPose)
            return pose
    raise AssertionError("no pose")


def test_changes_of_a_map_and_its_version_arrive(server: Server) -> None:
    called: list[MapChanged] = []
    with server.maps() as maps:
        version = maps.create_map("changing").version
        maps.put_robot("watcher", "changing")
        with connect(server, "watcher") as robot, robot.map_changes("changing") as changes:
            assert robot.map_version("changing") == version
            assert robot.map_version("no-such-map", wait_s=2.0) is None
            with robot.on_map_changed("*", called.append):
                maps.add_landmark("changing", "new")
                first = changes.get(SOON_S)
                assert first is not None and (first.map, first.version) == ("changing", version)
                changed = changes.get(SOON_S)
                assert eventually(lambda: changed in called)
            assert changed is not None and changed.map == "changing" and changed.version > version
            assert robot.map_version("changing") == changed.version


def test_who_starts_after_the_last_change_is_told_the_present_version(server: Server) -> None:
    called: list[MapChanged] = []
    with server.maps() as maps:
        version = maps.create_map("late").version
        maps.create_map("later")
        maps.put_robot("late-watcher", "late")
        with connect(server, "late-watcher") as robot, robot.map_changes("late") as changes:
            first = changes.get(SOON_S)
            assert first is not None and (first.map, first.version) == ("late", version)
            with robot.on_map_changed("*", called.append):
                assert eventually(lambda: {each.map for each in called} >= {"late", "later"})
                maps.add_landmark("late", "new")
                newer = changes.get(SOON_S)
                assert newer is not None and newer.version > version
                assert eventually(lambda: newer in called)
            assert changes.get(0.2) is None, "each version once"


def test_quads_found_on_board_are_answered_as_the_frame_they_are_of(server: Server, taught: str) -> None:
    pose = pictures.front(2.2)
    rgb = pictures.seen_from(pose)
    found = [pictures.corners_px(pose)]
    quads = Quads.cut(Image.rgb(rgb), found, intrinsics=pictures.CAMERA, robot_from_camera=MOUNTING)
    with connect(server, taught) as robot:
        whole = robot.recognise("front", capture(Image.rgb(rgb)), wait_s=SOON_S)
        answer = robot.recognise("front", quads, wait_s=SOON_S)
        assert recognised(answer) == recognised(whole) != []
        assert answer.map_from_robot is not None and whole.map_from_robot is not None
        here, there = answer.map_from_robot.pose, whole.map_from_robot.pose
        assert math.hypot(here.x_m - there.x_m, here.y_m - there.y_m) < 0.1
        nothing = robot.recognise("front", Quads.cut(Image.rgb(rgb), []), wait_s=SOON_S)
        assert nothing.status == "no_match" and nothing.quads == ()
        crooked = Quads.cut(Image.rgb(rgb), [list(reversed(found[0]))])
        with pytest.raises(Refused) as refused:
            robot.recognise("front", crooked, wait_s=SOON_S).accepted()
        assert (refused.value.code, refused.value.field) == ("out_of_range", "quads[0].border.corners")
    with pytest.raises(InvalidInput, match="raw pixels"):
        Quads.cut(Image.rgb(rgb).png(), found)


def test_a_robot_asks_where_it_is(server: Server, taught: str) -> None:
    pose = pictures.front(2.2)
    frame = capture(Image.rgb(pictures.seen_from(pose)))
    with connect(server, taught) as robot, server.maps() as maps:
        found = robot.localise(frame, wait_s=SOON_S)
        assert found.status == "located" and found.map_from_robot is not None and found.reason is None
        here = found.map_from_robot.pose
        assert math.hypot(here.x_m - pose.x_m, here.y_m - pose.y_m) < 0.2
        by_http = maps.localise(found.map, frame.image, pictures.CAMERA, MOUNTING)
        assert by_http.hypotheses == found.hypotheses
        scan = Scan((1.0,) * 90, -0.785, 0.0175, 30.0, Pose2())
        assert robot.localise(scan=scan, wait_s=SOON_S).reason == "few_points"
        wrong: list[tuple[Callable[[], object], str, str]] = [
            (lambda: robot.localise(), "missing", "frame"),
            (lambda: robot.localise(Image.gray(bytes(12), (4, 3))), "missing", "frame.intrinsics"),
            (lambda: robot.localise(frame, map="no-such-map"), "unknown_map", "map"),
        ]
        for asked, code, field in wrong:
            with pytest.raises(Refused) as refused:
                asked()
            assert (refused.value.code, refused.value.field) == (code, field)


def test_a_robot_is_alive_while_it_is_connected(server: Server) -> None:
    with server.maps() as maps:
        maps.create_map("presence")
        maps.put_robot("here", "presence")

        def is_alive() -> bool:
            return maps.robot("here").alive

        with connect(server, "here") as robot:
            assert eventually(is_alive) and maps.robot("here").epoch is None
            robot.publish_odometry(Pose2(0.0, 0.0, 0.0))
            assert eventually(lambda: maps.robot("here").epoch == robot.epoch)
        assert eventually(lambda: not is_alive())


def eventually(holds: object) -> bool:
    assert callable(holds)
    until = time.monotonic() + SOON_S
    while time.monotonic() < until:
        if holds():
            return True
        time.sleep(0.1)
    return False


def test_refused_frames_name_code_and_field(server: Server, taught: str) -> None:
    with connect(server, "nobody") as robot:
        answer = robot.recognise("front", Image.gray(bytes(12), (4, 3)), wait_s=SOON_S)
        with pytest.raises(Refused) as refused:
            answer.accepted()
        assert (refused.value.code, refused.value.field) == ("unknown_robot", "robot")
        assert "put_robot" in str(refused.value)
    with connect(server, taught) as robot:
        wrong = Capture(Image("rgb8", 4, 3, bytes(35)), deadline_ms=60_000)
        rejection = robot.recognise("front", wrong, wait_s=SOON_S).rejection
        assert rejection is not None and (rejection.code, rejection.field) == ("size_mismatch", "image")


def test_scans_and_gaze_are_taken(server: Server, taught: str) -> None:
    with connect(server, taught) as robot:
        scan = Scan((1.0, 2.0, 30.0), -0.1, 0.1, 30.0, odom_from_robot=Pose2())
        first = robot.publish_scan(scan)
        assert robot.publish_odometry(Pose2(), time.time_ns()) == first + 1
        answer = robot.recognise("front", capture(Image.rgb(pictures.seen_from(pictures.front()))), wait_s=SOON_S)
        request = GazeRequest(map_from_robot=answer.map_from_robot, criterion="information", looked_at="poster-1")
        advice = robot.gaze(request)
        assert advice.rejection is None and advice.action == "landmark" and advice.landmark == "poster-0"


def test_what_cannot_be_is_refused_before_it_is_sent(server: Server, taught: str) -> None:
    with pytest.raises(InvalidInput) as wrong_name:
        Robot.connect("Robot 1", endpoint=server.zenoh)
    assert wrong_name.value.code == "bad_name" and "lower-case" in str(wrong_name.value)
    with connect(server, taught) as robot, pytest.raises(InvalidInput):
        robot.publish_frame("Camera/1", Image.gray(bytes(12), (4, 3)))


def test_no_server_is_an_error_with_advice() -> None:
    started = time.monotonic()
    with pytest.raises(Unreachable) as error:
        Robot.connect("r1", endpoint="tcp/127.0.0.1:1", timeout_s=0.5)
    assert "waymark serve" in str(error.value) and time.monotonic() - started < 10


def test_no_answer_and_superseded_frames_are_errors(server: Server, taught: str) -> None:
    with connect(server, taught) as robot, pytest.raises(NoAnswer):
        robot.recognise("front", capture(Image.rgb(pictures.seen_from(pictures.front()))), wait_s=0.0)
    newer = CameraAnswer("front", Answer(epoch=1, seq=7))
    assert matching(newer, "front", 1, 8) is None and matching(newer, "back", 1, 7) is None
    assert matching(newer, "front", 1, 7) is newer.answer
    with pytest.raises(Superseded):
        matching(newer, "front", 1, 6)


def test_a_program_ends_though_it_leaves_its_session_open(server: Server, taught: str) -> None:
    program = f"""
from waymark import Pose2, Robot
robot = Robot.connect({taught!r}, endpoint={server.zenoh!r})
poses, changes = robot.poses(), robot.map_changes("*")
robot.publish_odometry(Pose2())
"""
    for end in ("", "raise SystemExit(3)", "1 / 0"):
        done = subprocess.run([sys.executable, "-c", program + end], capture_output=True, text=True, timeout=SOON_S)
        assert done.returncode == {"": 0, "raise SystemExit(3)": 3, "1 / 0": 1}[end], done.stderr


def test_a_slow_reader_misses_the_oldest_and_knows_how_many() -> None:
    from waymark import Inbox

    inbox: Inbox[int] = Inbox()
    for number in range(70):
        inbox._push(number)
    assert inbox.missed == 6 and inbox.get(0) == 6
