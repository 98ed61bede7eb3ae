"""What was learnt of landmarks, and which of them look alike."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

ThresholdLimit = Literal["cost", "nearest_negative", "absolute_cap"]


@dataclass(frozen=True, slots=True)
class ThresholdBody:
    """A threshold with its error rates. A distance is accepted only when it is strictly below."""

    threshold: float
    false_positive_rate: float
    false_negative_rate: float
    positives: int
    negatives: int
    limited_by: ThresholdLimit


@dataclass(frozen=True, slots=True)
class IconKeypoint:
    """A Harris point of the mean icon, in icon pixels."""

    x_px: float
    y_px: float


@dataclass(frozen=True, slots=True)
class LandmarkPoint:
    """A point of the landmark's photographs, 0 to 1 over its width and height, and its scale."""

    x: float
    y: float
    sigma: float


@dataclass(frozen=True, slots=True)
class MemoryPart:
    """Memory of a model for one purpose."""

    purpose: str
    bytes: int


@dataclass(frozen=True, slots=True)
class LandmarkModelDetail:
    """What was learnt of a landmark."""

    landmark: str
    sha256: str
    in_use: bool
    named_by_points: bool
    views: int
    generated_views: int
    exemplars: int
    icon_px: int
    keypoints: tuple[IconKeypoint, ...]
    points: tuple[LandmarkPoint, ...]
    bits_per_point: int
    mode_shares: tuple[float, ...]
    correlation: ThresholdBody
    hausdorff: ThresholdBody
    gradient_dissimilarity: ThresholdBody
    saliency: float
    stable_points: int
    visibility_confidence: float
    photographed_visibility_confidence: float
    memory: tuple[MemoryPart, ...]


@dataclass(frozen=True, slots=True)
class DistanceHistogram:
    """Distances by bin from 0: of the landmark's own views, and of the nearest of everything else."""

    threshold: float
    bin_width: float
    own: tuple[int, ...]
    own_beyond: int
    others: tuple[int, ...]
    others_beyond: int


@dataclass(frozen=True, slots=True)
class LandmarkDistances:
    """How far a landmark's own views and everything else are from its model."""

    landmark: str
    correlation: DistanceHistogram
    hausdorff: DistanceHistogram
    gradient_dissimilarity: DistanceHistogram


@dataclass(frozen=True, slots=True)
class LandmarkEvidence:
    """How strongly points spoke for a landmark in the newest stored answers, of which `answers` were read.

    Counts of quads by bins of the negative decimal logarithm of the number of false alarms. The last bin has everything
    beyond, too."""

    landmark: str
    answers: int
    threshold: float
    bin_width: float
    named: tuple[int, ...]
    doubtful: tuple[int, ...]
    named_without_points: int


@dataclass(frozen=True, slots=True)
class DuplicatePair:
    """Two landmarks that look alike, by name, and which of them is matched. `distance` is 1 minus the similarity."""

    first: str
    second: str
    gradient_similarity: float
    distance: float
    first_in_use: bool
    second_in_use: bool
