"""Claim: the clients for asyncio do what the blocking ones do, and the event loop goes on while they wait."""

from __future__ import annotations

import asyncio
import math

import pictures
import pytest
from conftest import SOON_S, Server

from waymark import (
    AsyncMapClient,
    AsyncRobot,
    Capture,
    Image,
    NoAnswer,
    Pose2,
    Pose3,
    Refused,
    RobotPose,
    Scan,
    named_landmarks,
)
from waymark.api import Job, LiveAnswer, LivePose
from waymark.wire import GazeRequest

MOUNTING = Pose3.mounting(0.0, 0.0, pictures.CAMERA_HEIGHT_M)


async def connect(server: Server, robot: str) -> AsyncRobot:
    return await AsyncRobot.connect(robot, endpoint=server.zenoh, delivery="every")


def capture() -> Capture:
    image = Image.rgb(pictures.seen_from(pictures.front()))
    return Capture(image, pictures.CAMERA, MOUNTING, odometry=Pose2(), deadline_ms=60_000)


def test_a_robot_gets_replies_answers_and_poses(server: Server, taught: str) -> None:
    async def run() -> None:
        async with await connect(server, taught) as robot:
            assert robot.name == taught and robot.epoch > 0
            called: list[RobotPose] = []
            async with robot.answers() as answers, robot.poses() as poses:
                with robot.on_pose(called.append):
                    await robot.publish_odometry(Pose2())
                    answer = await robot.recognise("front", capture(), wait_s=SOON_S)
                    assert [named.name for named in named_landmarks(answer)] == ["poster-0"]
                    arrived = await answers.get(SOON_S)
                    assert arrived is not None and arrived.answer == answer
                    pose = await moving(robot, poses.get(SOON_S))
                    assert pose.map_from_robot is not None
                    while not called:
                        await asyncio.sleep(0.01)
                    assert called[0] == pose
                seq = await robot.publish_frame("front", capture())
                async for each in answers:
                    assert each.answer.seq == seq
                    break
                assert await answers.get(0.01) is None
                answers.close()
                assert [each async for each in answers] == []
            with pytest.raises(NoAnswer):
                await robot.recognise("front", capture(), wait_s=0.0)
            await robot.publish_scan(Scan((1.0,), 0.0, 0.1, 30.0, Pose2()))
            advice = await robot.gaze(GazeRequest(map_from_robot=answer.map_from_robot))
            assert advice.landmark == "poster-0"
            assert await robot.map_version(taught) == answer.map_version

    asyncio.run(run())


async def moving(robot: AsyncRobot, pose: object) -> RobotPose:
    """The pose; odometry goes on until it is there."""
    assert asyncio.iscoroutine(pose)
    waiting: asyncio.Task[RobotPose] = asyncio.create_task(pose)
    while not waiting.done():
        await robot.publish_odometry(Pose2())
        await asyncio.wait([waiting], timeout=0.1)
    return waiting.result()


def test_the_loop_goes_on_while_a_frame_is_answered(server: Server, taught: str) -> None:
    async def run() -> int:
        ticks = 0

        async def count() -> None:
            nonlocal ticks
            while True:
                ticks += 1
                await asyncio.sleep(0)

        async with await connect(server, taught) as robot:
            counting = asyncio.create_task(count())
            await robot.recognise("front", capture(), wait_s=SOON_S)
            counting.cancel()
        return ticks

    assert asyncio.run(run()) > 10


def test_a_map_is_made_taught_and_followed(server: Server) -> None:
    async def run() -> None:
        async with AsyncMapClient(server.http) as maps:
            await maps.create_map("async")
            with pytest.raises(Refused) as exists:
                await maps.create_map("async")
            assert (exists.value.code, exists.value.status) == ("exists", 409)
            await maps.add_landmark("async", "poster")
            await maps.upload_view("async", "poster", pictures.teaching_photo(0))
            job = await maps.learn_landmark("async", "poster", 4)
            async with await maps.job_events(job.id) as events:
                states = [each async for each in events]
            assert isinstance(states[-1], Job) and states[-1].state == "done"
            done = await maps.wait_for_job(job, SOON_S)
            assert done.id == job.id
            assert [each.name for each in await maps.landmarks("async")] == ["poster"]
            await maps.put_robot("async", "async")
            async with await maps.live_events("async") as live, await connect(server, "async") as robot:
                answer = await robot.recognise("front", capture(), wait_s=SOON_S)
                async for event in live:
                    if isinstance(event, LiveAnswer):
                        assert (event.robot, event.camera, event.answer.seq) == ("async", "front", answer.seq)
                        break
                    assert not isinstance(event, LivePose)
            with pytest.raises(Refused) as in_use:
                await maps.delete_map("async")
            assert in_use.value.code == "in_use"
            await maps.delete_robot("async")
            await maps.delete_map("async")

    asyncio.run(run())


def test_changes_of_a_map_arrive(server: Server) -> None:
    async def run() -> None:
        async with AsyncMapClient(server.http) as maps, await connect(server, "nobody") as robot:
            present = (await maps.create_map("async-changing")).version
            changes = robot.map_changes("async-changing")
            first = await changes.get(SOON_S)
            assert first is not None and first.version == present
            await maps.add_landmark("async-changing", "new")
            changed = await changes.get(SOON_S)
            assert changed is not None and changed.version == await robot.map_version("async-changing")
            assert math.isfinite(changed.version)

    asyncio.run(run())
