# Made by tools/generate.py from _async/answers.py. Do not edit.
"""Stored answers, and what was learnt of landmarks."""

from __future__ import annotations

from waymark._http import localise_parts
from waymark._sync.base import Base
from waymark.api import (
    AnswerStatus,
    DuplicatePair,
    LandmarkDistances,
    LandmarkEvidence,
    LandmarkModelDetail,
    LocaliseResult,
    ModelPicture,
    StoredAnswer,
    StoredAnswerSummary,
)
from waymark.image import Picture
from waymark.wire import Intrinsics, Pose3, Scan


class Answers(Base):
    """Operations that show why the server said what it said."""

    def stored_answers(
        self,
        *,
        map: str | None = None,
        robot: str | None = None,
        camera: str | None = None,
        status: AnswerStatus | None = None,
        refusal: str | None = None,
        landmark: str | None = None,
        since_ms: int | None = None,
        until_ms: int | None = None,
    ) -> tuple[StoredAnswerSummary, ...]:
        """The stored answers to frames that have all of this, newest first. `landmark` is one that an answer names or
        was compared with; times are ms since the Unix epoch, `until_ms` is not included."""
        query = {"map": map, "robot": robot, "camera": camera, "status": status, "refusal": refusal}
        times = {"landmark": landmark, "since_ms": since_ms, "until_ms": until_ms}
        return self._all(StoredAnswerSummary, "stored_answers", **query, **times)

    def stored_answer(self, answer: int) -> StoredAnswer:
        """One stored answer: quads, candidates with their distances and thresholds, poses, paths of pictures."""
        return self._send(StoredAnswer, "stored_answer", answer)

    def stored_quad_icon(self, answer: int, quad: int) -> bytes:
        """The icon of a quad of a stored answer, by its index: PNG."""
        return self._bytes("stored_quad_icon", answer, quad)

    def localise(
        self,
        map: str,
        image: Picture | None = None,
        intrinsics: Intrinsics | None = None,
        mounting: Pose3 | None = None,
        scan: Scan | None = None,
    ) -> LocaliseResult:
        """Finds where a robot is, without knowing anything of it before: by one picture, with the camera's intrinsics
        and its pose on the robot, one laser scan from the same place, or both."""
        parts = localise_parts(image, intrinsics, mounting, scan)
        return self._send(LocaliseResult, "localise", map, **parts)

    def landmark_model(self, map: str, landmark: str, *, harris: bool = False) -> LandmarkModelDetail:
        """Thresholds, keypoints, points and sizes of a landmark's model, and on request the Harris points of its icons
        with descriptors. Refused with `not_learnt` if there is none."""
        query = {"harris": "true"} if harris else None
        return self._send(LandmarkModelDetail, "landmark_model", map, landmark, params=query)

    def landmark_distances(self, map: str, landmark: str) -> LandmarkDistances:
        """Histograms of the distances that its thresholds were fitted to."""
        return self._send(LandmarkDistances, "landmark_distances", map, landmark)

    def landmark_evidence(self, map: str, landmark: str) -> LandmarkEvidence:
        """How strongly points spoke for it in the newest stored answers."""
        return self._send(LandmarkEvidence, "landmark_evidence", map, landmark)

    def landmark_icon(self, map: str, landmark: str, which: ModelPicture = "exemplar1") -> bytes:
        """A learnt icon, the mean of the views, or a mode: PNG."""
        return self._bytes("landmark_icon", map, landmark, params={"which": which})

    def duplicates(
        self, map: str, *, landmark: str | None = None, in_use: bool | None = None
    ) -> tuple[DuplicatePair, ...]:
        """The pairs of landmarks that look alike: those with this one; those of which both are in use, or not both."""
        return self._all(DuplicatePair, "duplicates", map, landmark=landmark, in_use=in_use)
