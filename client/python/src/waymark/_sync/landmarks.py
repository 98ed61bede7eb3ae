# Made by tools/generate.py from _async/landmarks.py. Do not edit.
"""Landmarks, their training views, training, and recognition of one picture."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable

from waymark._http import JOB_POLL_S, Region, job_ended, picture_part, view_form
from waymark._sync.base import Base, Events, Stream
from waymark._values import UNSET, Unset, from_json, given, present, to_json
from waymark.api import (
    BulkOutcome,
    CaptureMetadata,
    Job,
    JobState,
    Landmark,
    LandmarkDeletion,
    LandmarkHealth,
    LandmarkStatus,
    LearningSettings,
    NewLandmark,
    NumberOrder,
    Order,
    PipelinePreset,
    Place,
    RefusedView,
    Size,
    TrainingView,
    VisibilityAreaBody,
    VisibilitySettingsBody,
)
from waymark.errors import JobTimeout
from waymark.image import Picture
from waymark.wire import Answer, Intrinsics


class JobEvents(Stream[Job]):
    """A job with each change, the last one with its end."""

    def __init__(self, events: Events) -> None:
        super().__init__(events)

    def _read(self, name: str, data: str) -> Job | None:
        # A newer server may send other events.
        return from_json(Job, json.loads(data)) if name == "job" else None


class Landmarks(Base):
    """Operations on landmarks."""

    def add_landmark(self, map: str, name: str, size: Size | None = None, place: Place | None = None) -> Landmark:
        """Adds a landmark without views. Without size there are no poses, without place none of the robot."""
        return self._send(Landmark, "add_landmark", map, json=present(name=name, size=size, place=place))

    def landmarks(self, map: str) -> tuple[Landmark, ...]:
        """All landmarks of a map, by name."""
        return self._all(Landmark, "landmarks", map)

    def find_landmarks(
        self,
        map: str,
        *,
        name: str | None = None,
        status: LandmarkStatus | None = None,
        health: LandmarkHealth | None = None,
        has_place: bool | None = None,
        sort: Order = "name",
    ) -> tuple[Landmark, ...]:
        """The landmarks of a map that have all of this: a part of the name, a status, a health, a place or none."""
        query = {"name": name, "status": status, "health": health, "has_place": has_place, "sort": sort}
        return self._all(Landmark, "landmarks", map, **query)

    def add_landmarks(self, map: str, new: Iterable[NewLandmark]) -> int:
        """Adds landmarks without views, at most 2000: all or none. The field of a refusal has the number of the one at
        fault."""
        body = {"landmarks": to_json(list(new))}
        return (self._send(BulkOutcome, "add_landmarks", map, json=body)).count

    def delete_landmarks(self, map: str, landmarks: Iterable[LandmarkDeletion]) -> int:
        """Deletes landmarks with their views and models, at most 2000: all or none. One with a revision is deleted only
        if it still has that."""
        body = {"landmarks": to_json(list(landmarks))}
        return (self._send(BulkOutcome, "delete_landmarks", map, json=body)).count

    def landmark(self, map: str, landmark: str) -> Landmark:
        """One landmark."""
        return self._send(Landmark, "landmark", map, landmark)

    def update_landmark(
        self,
        map: str,
        landmark: str,
        *,
        name: str | Unset = UNSET,
        size: Size | Unset | None = UNSET,
        place: Place | Unset | None = UNSET,
        learning: LearningSettings | Unset | None = UNSET,
        health: LandmarkHealth | Unset = UNSET,
    ) -> Landmark:
        """Renames a landmark; sets size, place, gates and health. What is not given stays; `None` forgets."""
        body = given(name=name, size=size, place=place, learning=learning, health=health)
        return self._send(Landmark, "update_landmark", map, landmark, json=body)

    def merge_landmarks(self, map: str, into: str, origin: str) -> Landmark:
        """Makes two landmarks one: `into` gets the views of `origin`, and the size and place that it lacks; `origin` is
        deleted. Learn it again afterwards."""
        return self._send(Landmark, "merge_landmarks", map, into, json={"from": origin})

    def delete_landmark(self, map: str, landmark: str) -> None:
        """Deletes a landmark with its views and model."""
        self._done("delete_landmark", map, landmark)

    def visibility_area(
        self, map: str, landmark: str, settings: VisibilitySettingsBody | None = None
    ) -> VisibilityAreaBody:
        """The visibility area of a landmark, with these settings instead of the map's."""
        query = to_json(settings) if settings is not None else None
        return self._send(VisibilityAreaBody, "visibility_area", map, landmark, params=query)

    def upload_view(
        self,
        map: str,
        landmark: str,
        image: Picture,
        region: Region = "detect",
        *,
        capture: CaptureMetadata | None = None,
        keep_near_duplicate: bool = False,
        make_landmark: bool = False,
        size: Size | None = None,
    ) -> TrainingView:
        """Adds a training view: a photograph, and the part of it that shows the landmark.

        `make_landmark`: makes the landmark if there is none of this name, together with this view or not at all.
        `size`: refused with `size_differs` if the landmark has another one by hand.
        """
        form = view_form(region, capture, keep_near_duplicate, make_landmark, size)
        return self._send(TrainingView, "upload_view", map, landmark, files=picture_part(image), data=form)

    def views(self, map: str, landmark: str) -> tuple[TrainingView, ...]:
        """All views of a landmark, by number."""
        return self._all(TrainingView, "views", map, landmark)

    def find_views(
        self,
        map: str,
        landmark: str,
        *,
        has_capture: bool | None = None,
        since_ms: int | None = None,
        until_ms: int | None = None,
        sort: NumberOrder = "number",
    ) -> tuple[TrainingView, ...]:
        """The views of a landmark with or without a capture, stored within these times (ms since the Unix epoch,
        `until_ms` not included)."""
        query = {"has_capture": has_capture, "since_ms": since_ms, "until_ms": until_ms, "sort": sort}
        return self._all(TrainingView, "views", map, landmark, **query)

    def delete_view(self, map: str, landmark: str, view: int) -> None:
        """Deletes a view. The model stays until the landmark is learnt again."""
        self._done("delete_view", map, landmark, view)

    def refused_views(self, map: str, landmark: str) -> tuple[RefusedView, ...]:
        """The photographs that uploads refused or the last lesson left out, newest first, at most 50, each with the
        reason."""
        return self._all(RefusedView, "refused_views", map, landmark)

    def refused_view_icon(self, map: str, landmark: str, refused: int) -> bytes:
        """A small picture of a refused photograph: PNG."""
        return self._bytes("refused_view_icon", map, landmark, refused)

    def view_icon(self, map: str, landmark: str, view: int) -> bytes:
        """The rectified picture of a view, PNG."""
        return self._bytes("view_icon", map, landmark, view)

    def view_image(self, map: str, landmark: str, view: int) -> bytes:
        """The photograph of a view as it was uploaded, PNG or JPEG."""
        return self._bytes("view_image", map, landmark, view)

    def learn(self, map: str, landmarks: Iterable[str] | None = None, generated_views: int | None = None) -> Job:
        """Starts to learn: these landmarks, or all that have views. `generated_views` warped views are made of each
        photograph, 0 to 100; the server chooses where it is not given."""
        names = list(landmarks) if landmarks is not None else None
        body = present(landmarks=names, generated_views=generated_views)
        return self._send(Job, "learn", map, json=body)

    def learn_landmark(self, map: str, landmark: str, generated_views: int | None = None) -> Job:
        """Starts to learn one landmark again from its views."""
        body = present(generated_views=generated_views)
        return self._send(Job, "learn_landmark", map, landmark, json=body)

    def jobs(self, *, state: JobState | None = None, map: str | None = None) -> tuple[Job, ...]:
        """All jobs that the server knows, newest first: those that stand so, those of a map."""
        return self._all(Job, "jobs", state=state, map=map)

    def job(self, job: int) -> Job:
        """The present state of a job."""
        return self._send(Job, "job", job)

    def cancel_job(self, job: int) -> Job:
        """Asks a job to stop. No effect on a job that has ended."""
        return self._send(Job, "cancel_job", job)

    def job_events(self, job: int) -> JobEvents:
        """Follows a job. Close the stream, or use it as a context manager."""
        return JobEvents(self._stream("job_events", job))

    def wait_for_job(self, job: Job, wait_s: float = 1800.0, progress: Callable[[Job], None] | None = None) -> Job:
        """Waits until a job is done; calls `progress` with every state received. Raises `JobFailed`, `JobTimeout`."""
        waited_s = 0.0
        while True:
            if progress is not None:
                progress(job)
            if job_ended(job):
                return job
            if waited_s >= wait_s:
                raise JobTimeout(f"job {job.id} is not done after {wait_s} s; it goes on, ask again for it")
            time.sleep(JOB_POLL_S)
            waited_s += JOB_POLL_S
            job = self.job(job.id)

    def recognise(
        self, map: str, image: Picture, intrinsics: Intrinsics | None = None, *, preset: PipelinePreset | None = None
    ) -> Answer:
        """Recognises the landmarks of one picture. Without intrinsics there is no pose; with them, `camera_pose` says
        where it was taken, by landmarks of known size and place. `preset`: another detector and decision than the
        map's."""
        form = {"intrinsics": json.dumps(to_json(intrinsics))} if intrinsics is not None else {}
        form |= {"preset": preset} if preset is not None else {}
        return self._send(Answer, "recognise", map, files=picture_part(image), data=form)
