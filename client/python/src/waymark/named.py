"""The landmarks that an answer names, each named by the picture alone (`global`) or with a known pose (`guided`)."""

from __future__ import annotations

from dataclasses import dataclass

from waymark.wire import Answer, QuadAnswer, Sighting


@dataclass(frozen=True, slots=True)
class NamedLandmark:
    """A quad with a landmark's name. A `guided` one may correct a known pose and means nothing without it."""

    name: str
    sighting: Sighting
    quad: QuadAnswer

    @property
    def is_guided(self) -> bool:
        """Whether the landmark was named with the pose known before."""
        return self.sighting == "guided"


def named(quad: QuadAnswer) -> NamedLandmark | None:
    """The landmark of a quad, and how it was named; `None` for a quad without a name."""
    if quad.sighting == "guided":
        return NamedLandmark(quad.guided_landmark, "guided", quad) if quad.guided_landmark else None
    # A server without guided recognition does not state the kind: its names are global.
    if quad.landmark and quad.verdict == "unique":
        return NamedLandmark(quad.landmark, "global", quad)
    return None


def named_landmarks(answer: Answer) -> tuple[NamedLandmark, ...]:
    """Every landmark that an answer names, in the order of its quads."""
    return tuple(found for quad in answer.quads if (found := named(quad)) is not None)


def quad_corners(quad: QuadAnswer) -> tuple[tuple[float, float], ...]:
    """Corners of a quad of an answer, (u, v) in pixels of the frame sent, clockwise from the top left."""
    return tuple((corner.u_px, corner.v_px) for corner in quad.corners)
