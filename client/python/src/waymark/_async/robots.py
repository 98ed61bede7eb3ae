"""Robots, their cameras, recordings, gatherings, mapping, and modality statistics."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from waymark._async.base import AsyncBase
from waymark._http import Revised
from waymark._values import UNSET, Unset, given, present
from waymark.api import (
    AcceptanceBody,
    AcceptedTrackBody,
    AreaBody,
    AreaStatsBody,
    CalibrationConstraintsBody,
    CalibrationReport,
    Camera,
    CameraFrame,
    CorrectionsBody,
    FusionMode,
    Gathering,
    MappingProgressBody,
    ModalityMapBody,
    Order,
    PoseByHand,
    RecordingStatusBody,
    ReferenceRunBody,
    RelocalisationStatus,
    Robot,
    RobotPose,
    Ros2Status,
    TrackSummary,
    TrajectoriesBody,
    UnknownRobots,
    UploadedViews,
)
from waymark.errors import Unexpected
from waymark.wire import Answer, Pose2


@dataclass(frozen=True, slots=True)
class _Cameras:
    cameras: tuple[Camera, ...]


@dataclass(frozen=True, slots=True)
class _Tracks:
    tracks: tuple[TrackSummary, ...]


@dataclass(frozen=True, slots=True)
class _Runs:
    runs: tuple[ReferenceRunBody, ...]


class AsyncRobots(AsyncBase):
    """Operations on robots."""

    async def put_robot(self, robot: str, map: str) -> Robot:
        """Registers a robot, or gives it another map."""
        return await self._send(Robot, "put_robot", robot, json={"map": map})

    async def robots(self) -> tuple[Robot, ...]:
        """All robots, by name."""
        return await self._all(Robot, "robots")

    async def find_robots(self, *, name: str | None = None, sort: Order = "name") -> tuple[Robot, ...]:
        """The robots with this part of the name."""
        return await self._all(Robot, "robots", name=name, sort=sort)

    async def robot(self, robot: str) -> Robot:
        """One robot: whether it is connected, its pose, and whether a second program uses its name."""
        return await self._send(Robot, "robot", robot)

    async def set_robot_pose(self, robot: str, pose: PoseByHand) -> RobotPose:
        """Puts a robot where a person says it is. It has to send odometry; the pose is unsupported until a landmark
        agrees."""
        return await self._send(RobotPose, "set_robot_pose", robot, json=pose)

    async def unknown_robots(self) -> UnknownRobots:
        """Robots that send messages and are refused because they are not registered."""
        return await self._send(UnknownRobots, "unknown_robots")

    async def delete_robot(self, robot: str) -> None:
        """Deletes a robot; its frames are rejected from now on."""
        await self._done("delete_robot", robot)

    async def corrections(self, robot: str) -> CorrectionsBody:
        """Support of a robot's pose, and the outcomes of its fixes."""
        return await self._send(CorrectionsBody, "corrections", robot)

    async def relocalisation(self, robot: str) -> RelocalisationStatus:
        """Pose hypotheses of a robot that observes nothing unique."""
        return await self._send(RelocalisationStatus, "relocalisation", robot)

    async def ros2_status(self, robot: str) -> Ros2Status:
        """What became of the messages of a robot of ROS 2."""
        return await self._send(Ros2Status, "ros2_status", robot)

    async def trajectories(self, robot: str) -> TrajectoriesBody:
        """Recent trajectories of a robot, by source."""
        return await self._send(TrajectoriesBody, "trajectories", robot)

    async def cameras(self, robot: str) -> tuple[Camera, ...]:
        """The cameras of a robot in whose frames landmarks of known size were recognised, by name."""
        return (await self._send(_Cameras, "cameras", robot)).cameras

    async def calibrate_camera(
        self,
        robot: str,
        camera: str,
        *,
        uploaded_views: UploadedViews | None = None,
        constraints: CalibrationConstraintsBody | None = None,
    ) -> CalibrationReport:
        """Calibrates a camera, from uploaded corners or from stored views of its own frames."""
        body = present(uploaded_views=uploaded_views, constraints=constraints)
        return await self._send(CalibrationReport, "calibrate_camera", robot, camera, json=body)

    async def camera_frame(self, robot: str, camera: str) -> CameraFrame:
        """The last answered frame of a camera."""
        response = await self._checked("camera_frame", (robot, camera))
        seq = response.headers.get("x-frame-seq", "")
        if not seq.isdigit():
            raise Unexpected(f"{response.url}: no number in x-frame-seq")
        return CameraFrame(int(seq), response.headers.get("content-type", ""), response.content)

    async def camera_answer(self, robot: str, camera: str) -> Answer:
        """The answer to that frame."""
        return await self._send(Answer, "camera_answer", robot, camera)

    async def start_recording(self, robot: str) -> RecordingStatusBody:
        """Begins a recording of a robot, in the server's memory."""
        return await self._send(RecordingStatusBody, "start_recording", robot)

    async def recording(self, robot: str) -> RecordingStatusBody:
        """Status of the recording."""
        return await self._send(RecordingStatusBody, "recording", robot)

    async def cancel_recording(self, robot: str) -> None:
        """Cancels the recording."""
        await self._done("cancel_recording", robot)

    async def finish_recording(
        self,
        robot: str,
        poses: Iterable[tuple[int, float, float, float]],
        *,
        sigma_m: float | None = None,
        sigma_rad: float | None = None,
    ) -> ReferenceRunBody:
        """Ends the recording with a reference trajectory: time (ns of the robot's clock), x, y and heading on the map.
        The map learns modality statistics from it."""
        body = present(poses=list(poses), sigma_m=sigma_m, sigma_rad=sigma_rad)
        return await self._send(ReferenceRunBody, "finish_recording", robot, json=body)

    async def reference_runs(self, map: str) -> tuple[ReferenceRunBody, ...]:
        """The reference runs of a map, oldest first."""
        return (await self._send(_Runs, "reference_runs", map)).runs

    async def delete_reference_run(self, map: str, run: int) -> None:
        """Deletes a reference run with its statistics."""
        await self._done("delete_reference_run", map, run)

    async def modalities(self, map: str) -> ModalityMapBody:
        """Modality statistics by pose cell from reference runs, and the fusion mode."""
        return await self._send(ModalityMapBody, "modalities", map)

    async def modalities_revised(self, map: str) -> Revised[ModalityMapBody]:
        """The same with the revision of the fusion mode and the named areas, for `if_match`."""
        return await self._revised(ModalityMapBody, "modalities", map)

    async def set_modalities(
        self,
        map: str,
        *,
        fusion_mode: FusionMode | Unset = UNSET,
        areas: Sequence[AreaBody] | Unset = UNSET,
    ) -> ModalityMapBody:
        """Sets the fusion mode and the named areas; what is not given stays."""
        body = given(fusion_mode=fusion_mode, areas=areas)
        return await self._send(ModalityMapBody, "set_modalities", map, json=body)

    async def modalities_at(self, map: str, pose: Pose2) -> AreaStatsBody:
        """Modality statistics at a pose."""
        query = {"x_m": pose.x_m, "y_m": pose.y_m, "theta_rad": pose.theta_rad}
        return await self._send(AreaStatsBody, "modalities_at", map, params=query)

    async def start_mapping(
        self, map: str, robot: str, origin: tuple[float, float, float] | None = None, *, landmarks: bool = False
    ) -> MappingProgressBody:
        """Begins to make the walls of a map from the scans of a robot; `origin` is its first pose where it is known in
        the frame of the map. With `landmarks` it looks for them in the robot's frames, too."""
        body = {"robot": robot, "landmarks": landmarks} | ({"origin": list(origin)} if origin else {})
        return await self._send(MappingProgressBody, "start_mapping", map, json=body)

    async def mapping(self, map: str) -> MappingProgressBody:
        """The present mapping, or the last one since the server started."""
        return await self._send(MappingProgressBody, "mapping", map)

    async def cancel_mapping(self, map: str) -> None:
        """Cancels a mapping, or deletes one that failed; the map does not change."""
        await self._done("cancel_mapping", map)

    async def finish_mapping(self, map: str, *, hold: bool = False, accept: bool = False) -> MappingProgressBody:
        """Ends the drive: the walls are fitted once more and stored. `mapping` says when they are. With `hold` they are
        held instead: `mapping` has them, a further call without it stores them, `cancel_mapping` gives them up. With
        `accept` the landmarks that pass every gate are accepted and learnt."""
        params = {name: "true" for name, wanted in (("hold", hold), ("accept", accept)) if wanted}
        return await self._send(MappingProgressBody, "finish_mapping", map, params=params)

    async def start_gathering(
        self, map: str, robot: str, *, landmark: str | None = None, known: bool = False
    ) -> Gathering:
        """Begins to gather views with a robot: of one landmark, or of new objects (`known`: of known ones, too)."""
        body = present(robot=robot, landmark=landmark, known=known)
        return await self._send(Gathering, "start_gathering", map, json=body)

    async def gatherings(self, map: str) -> tuple[Gathering, ...]:
        """All gatherings of a map, by number."""
        return await self._all(Gathering, "gatherings", map)

    async def gathering(self, map: str, gathering: int) -> Gathering:
        """One gathering."""
        return await self._send(Gathering, "gathering", map, gathering)

    async def stop_gathering(self, map: str, gathering: int) -> Gathering:
        """Ends a gathering; its tracks wait for a decision."""
        return await self._send(Gathering, "stop_gathering", map, gathering)

    async def delete_gathering(self, map: str, gathering: int) -> None:
        """Ends a gathering and deletes all tracks that nobody has accepted."""
        await self._done("delete_gathering", map, gathering)

    async def tracks(self, map: str, gathering: int) -> tuple[TrackSummary, ...]:
        """The tracks that wait for a decision."""
        return (await self._send(_Tracks, "tracks", map, gathering)).tracks

    async def discard_track(self, map: str, gathering: int, track: int) -> None:
        """Deletes a track. While the gathering lasts, no more views of that object are stored."""
        await self._done("discard_track", map, gathering, track)

    async def track_icon(self, map: str, gathering: int, track: int, view: int) -> bytes:
        """The rectified picture of a view of a track, PNG."""
        return await self._bytes("track_icon", map, gathering, track, view)

    async def accept_tracks(
        self, map: str, gathering: int, tracks: Iterable[AcceptedTrackBody], *, learn: bool = True
    ) -> AcceptanceBody:
        """Creates landmarks from tracks, or adds views to the landmarks that they show; all or none."""
        body = present(tracks=list(tracks), learn=learn)
        return await self._send(AcceptanceBody, "accept_tracks", map, gathering, json=body)
