"""Claim: the methods of each resource work against a real server."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import time
from pathlib import Path

import pictures
import pytest
from conftest import SOON_S, Server

from waymark import (
    Capture,
    CaptureMetadata,
    Image,
    InvalidInput,
    JobFailed,
    JobTimeout,
    Landmark,
    MapClient,
    Place,
    Pose2,
    Pose2Covariance,
    Pose3,
    Refused,
    Robot,
    Size,
    Unreachable,
    WallBody,
)
from waymark._http import job_ended
from waymark.api import (
    AcceptedTrackBody,
    AreaBody,
    CalibrationConstraintsBody,
    CameraFrame,
    Job,
    LandmarkDeletion,
    LearningSettings,
    NewLandmark,
    Parent,
    PoseBody,
    ReadinessCounts,
    Ros2Status,
    UploadedView,
    UploadedViews,
    VisibilitySettingsBody,
)

QUARTER = math.pi / 2


def hall(maps: MapClient, name: str) -> None:
    """A map with two walls and a poster on the first of them."""
    maps.create_map(name)
    maps.set_walls(name, [WallBody((0.0, 0.0), (10.0, 0.0)), WallBody((10.0, 8.0), (0.0, 8.0))])
    maps.add_landmark(name, "poster", Size(*pictures.SIZE_M), Place(5.0, 0.0, 1.5, QUARTER))


def test_the_server_says_how_it_is(server: Server) -> None:
    with server.maps() as maps:
        assert (maps.health().status, maps.readiness().status) == ("ok", "ready")
        assert "waymark_ready 1" in maps.metrics()
        assert maps.readiness().counts == ReadinessCounts(0, 0)
        version = maps.version()
        assert (version.name, version.api, version.protocol) == ("waymark", "v1", "1")


def test_backups_are_made_saved_and_deleted(server: Server, tmp_path: Path) -> None:
    with server.maps() as maps:
        made = maps.make_backup()
        until = time.monotonic() + SOON_S
        while made.state == "running" and time.monotonic() < until:
            time.sleep(0.1)
            made = maps.backup(made.name)
        assert made.state == "complete" and made.manifest is not None and made in maps.backups()
        assert maps.backup_file(made.name, tmp_path / "all.waymark") == made.bytes
        assert (tmp_path / "all.waymark").read_bytes().startswith(b"SQLite format 3")
        health = maps.readiness().backup
        assert health is not None and health.newest == made.name
        maps.delete_backup(made.name)


def test_a_wrong_change_is_taken_back(server: Server) -> None:
    with server.maps() as maps:
        hall(maps, "annex")
        good = maps.commits("annex")[0].id
        maps.with_reason("für immer").delete_landmark("annex", "poster")
        deleted = maps.commits("annex")[0]
        assert (deleted.author, deleted.why, deleted.summary.landmarks) == ("local", "für immer", ("poster",))
        assert maps.commit("annex", deleted.id) == deleted and deleted.parent == good
        found = maps.difference("annex", good)
        assert (found.to_commit, found.landmarks.items[0].change) == (deleted.id, "removed")
        done = maps.roll_back("annex", good)
        assert done.changed and maps.landmark("annex", "poster").place is not None
        assert maps.difference("annex", good, done.commit.id).landmarks.items == ()
        maps.undo_commit("annex", done.commit.id)
        assert maps.landmarks("annex") == ()
        with pytest.raises(Refused, match="since"):
            maps.undo_commit("annex", done.commit.id)
        maps.delete_map("annex")


def test_maps_are_stored_with_all_their_fields(server: Server) -> None:
    with server.maps() as maps:
        hall(maps, "ground")
        assert maps.walls("ground").segments[1] == WallBody((10.0, 8.0), (0.0, 8.0))
        known = WallBody((0.0, 0.0), (10.0, 0.0), (1e-6, 0.0, 4e-4))
        assert maps.set_walls("ground", [known]).segments == (known,) == maps.walls("ground").segments
        parent = Parent("ground", 1.0, 2.0, 0.0, level_m=3.0)
        attic = maps.create_map("attic", distance="hausdorff", parent=parent)
        assert attic.distance == "hausdorff" and attic.parent is not None
        assert attic.parent.covariance is not None and len(attic.parent.covariance) == 9
        assert dataclasses.replace(attic.parent, covariance=None) == parent
        found = maps.transform("attic", "ground", Pose2(0.5, 0.0, 0.0))
        assert found.pose is not None and found.pose.x_m == pytest.approx(1.5)
        assert found.via == ("attic", "ground") and found.level_m == pytest.approx(3.0)
        attic = maps.locate_map("attic", site="Works / 1", parent=None)
        assert (attic.site, attic.parent) == ("Works / 1", None)
        assert maps.locate_map("attic", floor="2").site == "Works / 1", "what is not given stays"
        paper = maps.set_pipeline("attic", preset="paper")
        assert (paper.preset, paper.distance) == ("paper", "hausdorff")
        assert maps.set_pipeline("attic", preset=None, distance="correlation").preset is None
        assert maps.set_learning(
            "attic", LearningSettings("doors look alike", min_views=3)
        ).learning == LearningSettings("doors look alike", min_views=3)
        with pytest.raises(Refused, match="min_views"):
            maps.set_learning("attic", LearningSettings("none", min_views=0))
        assert maps.set_learning("attic", None).learning is None
        assert maps.rename_map("attic", "loft").site == "Works / 1"
        assert maps.rename_map("loft", "attic").name == "attic"
        assert {"attic", "ground"} <= {each.name for each in maps.maps()}
        maps.delete_map("attic")
        with pytest.raises(Refused) as gone:
            maps.map("attic")
        error = gone.value
        assert (error.code, error.field, error.status) == ("unknown_map", "map", 404)
        assert "attic" in error.detail and "create_map" in str(error)
        with pytest.raises(Refused) as escaped:
            maps.map("no / such?map")
        assert escaped.value.code == "unknown_map", "a value of a path stays in its segment"
        with pytest.raises(InvalidInput):
            maps.map("..")


def test_landmarks_are_placed_taught_and_learnt(server: Server) -> None:
    with server.maps() as maps:
        hall(maps, "lessons")
        sign = maps.add_landmark("lessons", "sign")
        assert (sign.status, sign.size, sign.place) == ("not_learnt", None, None)
        place = Place(5.0, 4.0, 2.5, 0.1, roll_rad=0.2, tilt_rad=QUARTER)
        sign = maps.update_landmark("lessons", "sign", place=place, health="quarantined")
        assert (sign.place, sign.health, sign.size) == (place, "quarantined", None)
        assert maps.update_landmark("lessons", "sign", size=Size(1.0, 0.5)).place == place
        assert maps.update_landmark("lessons", "sign", place=None).place is None
        maps.delete_landmark("lessons", "sign")

        photo = Image.rgb(pictures.seen_from(pictures.front(1.6)))
        corners = pictures.corners_px(pictures.front(1.6))
        first = maps.upload_view("lessons", "poster", photo, corners)
        assert first.outcome == "new" and first.corners[0] == pytest.approx(corners[0], abs=3.0)
        capture = CaptureMetadata(
            pictures.CAMERA,
            Pose2Covariance(pictures.front(1.6), (1e-4, 0, 0, 0, 1e-4, 0, 0, 0, 1e-4)),
            Pose3.mounting(0.0, 0.0, pictures.CAMERA_HEIGHT_M),
            corner_covariance_px2=((1.0, 0.0, 1.0),) * 4,
        )
        second = maps.upload_view("lessons", "poster", photo, corners, capture=capture, keep_near_duplicate=True)
        assert second.placing is None or second.placing.reason == "by_hand"
        whole = Image.rgb(pictures.poster(0)).png().data
        assert isinstance(whole, bytes)
        third = maps.upload_view("lessons", "poster", whole, "whole_image", keep_near_duplicate=True)
        views = maps.views("lessons", "poster")
        assert {first.id, third.id} <= {view.id for view in views}
        assert maps.view_icon("lessons", "poster", first.id).startswith(b"\x89PNG")
        assert maps.view_image("lessons", "poster", third.id) == whole
        maps.delete_view("lessons", "poster", third.id)

        states: list[str] = []
        job = maps.wait_for_job(maps.learn("lessons", ["poster"], 4), SOON_S, lambda each: states.append(each.state))
        assert job.state == "done" and states[-1] == "done"
        assert maps.cancel_job(job.id) == maps.job(job.id)
        with maps.job_events(maps.learn_landmark("lessons", "poster", 4).id) as events:
            assert [each.state for each in events][-1] == "done"
        learnt = maps.landmark("lessons", "poster")
        assert learnt.model is not None and learnt.model.generated_views == 4 and learnt.model.facts


def test_a_landmark_is_made_with_its_first_view_renamed_and_refused_for_its_likeness(server: Server) -> None:
    photo = pictures.teaching_photo(5)
    size = Size(*pictures.SIZE_M)
    with server.maps() as maps:
        maps.create_map("first-views")
        with pytest.raises(Refused):
            maps.upload_view("first-views", "first", Image.gray(bytes(64 * 48), (64, 48)), make_landmark=True)
        assert maps.landmarks("first-views") == (), "nothing is left behind"
        maps.upload_view("first-views", "first", photo, make_landmark=True, size=size)
        with pytest.raises(Refused) as differs:
            maps.upload_view("first-views", "first", photo, size=Size(2 * size.width_m, 2 * size.height_m))
        assert differs.value.code == "size_differs" and {"stored", "given"} <= set(differs.value.more)
        maps.upload_view("first-views", "again", photo, make_landmark=True, size=size)
        maps.wait_for_job(maps.learn("first-views"), SOON_S * 2)
        why = [gate for landmark in maps.landmarks("first-views") for gate in landmark.failed_gates]
        assert {gate.gate for gate in why} & {"looks_like", "by_pose_only"}, why
        assert any(gate.look_alike is not None and gate.look_alike.gradient_similarity > 0.8 for gate in why)
        assert str(why[0]) == f"{why[0].sentence} {why[0].advice}"
        assert maps.update_landmark("first-views", "again", name="second").name == "second"
        assert [each.name for each in maps.landmarks("first-views")] == ["first", "second"]


def test_refused_photographs_say_what_to_do(server: Server) -> None:
    plain = Image.gray(bytes(64 * 48), (64, 48))
    with server.maps() as maps:
        hall(maps, "refusals")
        with pytest.raises(Refused) as refused:
            maps.upload_view("refusals", "poster", plain)
        assert refused.value.code == "quad_not_found" and "whole_image" in str(refused.value)
        assert "quads" in refused.value.more
        answer = maps.recognise("refusals", plain)
        assert (answer.status, answer.quads) == ("no_match", ())
        # The camera is that of larger pictures.
        with pytest.raises(Refused) as refused:
            maps.recognise("refusals", plain, pictures.CAMERA)
        assert refused.value.field.startswith("intrinsics") and "middle" in str(refused.value)


def test_jobs_that_do_not_end_well_are_errors(server: Server) -> None:
    failed = Job(3, "learn", "hall", "failed", 0.5, "the disk is full", by="kim", created_ms=1)
    with pytest.raises(JobFailed, match="the disk is full"):
        job_ended(failed)
    with server.maps() as maps:
        hall(maps, "slow")
        running = Job(3, "learn", "slow", "running", 0.5, "", by="kim", created_ms=1)
        with pytest.raises(JobTimeout):
            maps.wait_for_job(running, 0.0)


def test_visibility_follows_the_settings(server: Server) -> None:
    with server.maps() as maps:
        hall(maps, "visible")
        near = VisibilitySettingsBody(focal_px=300.0)
        assert maps.set_visibility_settings("visible", near).focal_px == 300.0
        stored = maps.visibility_settings("visible")
        assert stored.focal_px == 300.0 and stored.width_px == 640.0
        area = maps.visibility_area("visible", "poster")
        far = maps.visibility_area("visible", "poster", VisibilitySettingsBody(focal_px=800.0))
        assert (area.kind, area.properties.landmark) == ("Feature", "poster")
        assert area.properties.reach_m < far.properties.reach_m and far.geometry.coordinates
        pose = PoseBody(5.0, 1.5, -QUARTER)
        visible = maps.visible("visible", pose).landmarks
        assert [each.landmark for each in visible] == ["poster"] and visible[0].margin_m > 0
        coverage = maps.coverage("visible", [(0.5, 1.5), (9.5, 1.5)])
        assert coverage.length_m == pytest.approx(9.0) and 0 <= coverage.share < 1
        ranking = maps.gaze_ranking("visible", pose, criterion="information")
        assert ranking.ranked == (), "a landmark without a model is no gaze target"


def test_a_robot_is_observed_and_its_camera_calibrated(server: Server, taught: str) -> None:
    with server.maps() as maps:
        maps.put_robot("observed", taught)
        with Robot.connect("observed", endpoint=server.zenoh, delivery="every") as robot:
            image = Image.rgb(pictures.seen_from(pictures.front())).png()
            frame = Capture(image, pictures.CAMERA, deadline_ms=60_000)
            answer = robot.recognise("front", frame, wait_s=SOON_S)
            shown = shown_frame(maps, "observed", answer.seq)
            assert (shown.seq, shown.media_type, shown.image) == (answer.seq, "image/png", image.data)
            assert maps.camera_answer("observed", "front") == answer, "one answer, by zenoh and by HTTP"
            raw = Capture(Image.rgb(pictures.seen_from(pictures.front())), pictures.CAMERA, deadline_ms=60_000)
            of_raw = robot.recognise("front", raw, wait_s=SOON_S)
            assert shown_frame(maps, "observed", of_raw.seq).media_type == "image/png"
            camera = maps.cameras("observed")[0]
            assert (camera.name, camera.width_px, camera.intrinsics.fx_px) == ("front", 640, 500.0)
            assert camera.intrinsics.focal_sigma_px == 2.5, "what is not given has a default"
            assert camera.intrinsics_monitor.suspicion is None
            known = maps.robot("observed")
            assert known.alive and known.conflict is None and known.map == taught
        assert maps.trajectories("observed").truth == ()
        assert not maps.relocalisation("observed").relocalising
        assert maps.ros2_status("observed") == Ros2Status(False, {}, {}, {}), "a robot of the SDK"
        assert maps.corrections("observed").corrections == ()
        assert "observed" in {each.name for each in maps.robots()}
        report = maps.calibrate_camera(
            "observed",
            "front",
            uploaded_views=uploaded_views(),
            constraints=CalibrationConstraintsBody(radial=0),
        )
        assert report.intrinsics.fx_px == pytest.approx(500.0, abs=5.0) and len(report.views) == 5
        maps.delete_robot("observed")
        with pytest.raises(Refused, match="put_robot"):
            maps.robot("observed")


def shown_frame(maps: MapClient, robot: str, seq: int) -> CameraFrame:
    """The frame of this number; the server shows it shortly after the robot has its answer."""
    until = time.monotonic() + SOON_S
    while time.monotonic() < until:
        with contextlib.suppress(Refused):
            shown = maps.camera_frame(robot, "front")
            if shown.seq == seq:
                return shown
        time.sleep(0.02)
    raise AssertionError(f"frame {seq} is not shown")


def uploaded_views() -> UploadedViews:
    """A rectangle of 0.6 m by 0.8 m, 2 m away and turned, in the image of a camera of 500 px."""

    def view(pitch: float, yaw: float) -> UploadedView:
        corners = []
        for x, y in ((-0.3, -0.4), (0.3, -0.4), (0.3, 0.4), (-0.3, 0.4)):
            down, away = y * math.cos(pitch), y * math.sin(pitch)
            right = x * math.cos(yaw) + away * math.sin(yaw)
            depth = 2.0 - x * math.sin(yaw) + away * math.cos(yaw)
            corners.append((500.0 * right / depth + 319.5, 500.0 * down / depth + 239.5))
        return UploadedView((corners[0], corners[1], corners[2], corners[3]))

    angles = [(0.0, 0.7), (0.0, -0.7), (0.7, 0.0), (-0.7, 0.0), (0.5, 0.5)]
    return UploadedViews(640, 480, 0.6, 0.8, tuple(view(*each) for each in angles))


def test_drives_are_recorded_mapped_and_gathered(server: Server) -> None:
    with server.maps() as maps:
        hall(maps, "drives")
        maps.put_robot("driver", "drives")
        assert maps.start_recording("driver").active
        with Robot.connect("driver", endpoint=server.zenoh) as robot:
            poses = []
            for step in range(21):
                captured_ns = time.time_ns()
                robot.publish_odometry(Pose2(0.05 * step), captured_ns)
                poses.append((captured_ns, 4.0 + 0.05 * step, 2.0, 0.0))
                time.sleep(0.05)
            until = time.monotonic() + SOON_S
            while maps.recording("driver").odometry < 21 and time.monotonic() < until:
                time.sleep(0.1)
            run = maps.finish_recording("driver", poses, sigma_m=0.01)
            assert run.statistics[0].modality == "odometry" and maps.reference_runs("drives") == (run,)
            maps.start_recording("driver")
            maps.cancel_recording("driver")
            with pytest.raises(Refused):
                maps.recording("driver")

            door = AreaBody("door", ((0.0, 0.0), (2.0, 0.0), (2.0, 2.0)))
            known = maps.set_modalities("drives", fusion_mode="best", areas=[door])
            assert (known.fusion_mode, known.areas[0].name, len(known.cells)) == ("best", "door", run.cells)
            assert maps.modalities("drives") == known
            assert maps.modalities_at("drives", Pose2(4.5, 2.0)).statistics[0].steps > 0
            maps.delete_reference_run("drives", run.id)

            begun = maps.start_mapping("drives", "driver", (1.0, 2.0, 0.0), landmarks=True)
            assert (begun.stage, begun.frames) == ("mapping", 0)
            maps.cancel_mapping("drives")
            assert maps.start_mapping("drives", "driver").frames is None
            maps.finish_mapping("drives", accept=True)
            until = time.monotonic() + SOON_S
            while maps.mapping("drives").stage != "failed" and time.monotonic() < until:
                time.sleep(0.1)
            assert maps.mapping("drives").reason
            # One that is to be held has no wall to hold, either.
            maps.start_mapping("drives", "driver")
            maps.finish_mapping("drives", hold=True)
            while maps.mapping("drives").stage != "failed" and time.monotonic() < until:
                time.sleep(0.1)
            assert maps.mapping("drives").walls is None

            gathering = maps.start_gathering("drives", "driver", known=True)
            assert maps.gathering("drives", gathering.id).open and gathering.known
            assert maps.tracks("drives", gathering.id) == ()
            assert not maps.stop_gathering("drives", gathering.id).open
            for call in (
                lambda: maps.accept_tracks("drives", gathering.id, [AcceptedTrackBody(1, "window")], learn=False),
                lambda: maps.discard_track("drives", gathering.id, 1),
                lambda: maps.track_icon("drives", gathering.id, 1, 1),
            ):
                with pytest.raises(Refused) as refused:
                    call()
                assert refused.value.code in ("unknown_track", "unknown_view")
            assert len(maps.gatherings("drives")) == 1
            maps.delete_gathering("drives", gathering.id)


def test_lists_are_read_to_their_last_page(server: Server) -> None:
    with server.maps() as maps:
        maps.create_map("long")
        names = [f"l{number:03}" for number in range(130)]
        for name in names:
            maps.add_landmark("long", name)
        assert [each.name for each in maps.landmarks("long")] == names


def test_no_server_is_an_error_with_advice() -> None:
    with MapClient("http://127.0.0.1:1") as maps, pytest.raises(Unreachable, match="waymark serve"):
        maps.maps()


def test_lists_have_filters_and_several_landmarks_are_made_at_once(server: Server) -> None:
    with server.maps() as maps:
        maps.create_map("several")
        place = Place(1.0, 0.0, 1.5, 0.0)
        new = [NewLandmark("door-1", place=place), NewLandmark("door-2"), NewLandmark("sign")]
        assert maps.add_landmarks("several", new) == 3
        with pytest.raises(Refused) as refused:
            maps.add_landmarks("several", [NewLandmark("new"), NewLandmark("sign")])
        assert (refused.value.code, refused.value.field) == ("exists", "landmarks[1].name")

        def names(found: tuple[Landmark, ...]) -> list[str]:
            return [landmark.name for landmark in found]

        assert names(maps.find_landmarks("several", name="door", has_place=False)) == ["door-2"]
        assert names(maps.find_landmarks("several", sort="-name")) == ["sign", "door-2", "door-1"]
        assert names(maps.find_landmarks("several", status="active")) == []
        assert [found.name for found in maps.find_maps(name="severa", sort="-changed")] == ["several"]
        assert maps.find_robots(name="nobody-of-this-name") == ()
        assert maps.jobs(map="several", state="queued") == ()
        gone = [LandmarkDeletion("sign"), LandmarkDeletion("door-1", maps.landmark("several", "door-1").revision)]
        assert maps.delete_landmarks("several", gone) == 2
