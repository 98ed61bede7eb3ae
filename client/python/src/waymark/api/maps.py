"""Maps, walls, jobs, and the server itself."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

from waymark.api.backups import BackupHealth

Distance = Literal["both", "correlation", "hausdorff"]
JobState = Literal["queued", "running", "done", "failed", "cancelled"]
Point2 = tuple[float, float]
# Of a list: by name, or by the time of the last edit or lesson; `-` reverses it.
Order = Literal["name", "-name", "changed", "-changed"]


@dataclass(frozen=True, slots=True)
class Parent:
    """Where a map lies in another: its origin and the direction of its x axis there, and its floor above that one's.
    Without `covariance`: 5 cm and half a degree."""

    map: str
    x_m: float
    y_m: float
    theta_rad: float
    level_m: float = 0.0
    covariance: tuple[float, ...] | None = None


@dataclass(frozen=True, slots=True)
class Map:
    """A map. `version` counts up with every change that an answer could depend on; `revision` is another one
    after every edit or lesson of it or of what is in it (`MapClient.if_match`)."""

    name: str
    version: int
    revision: str
    landmarks: int
    distance: Distance
    has_underlay: bool = False
    draft_of: str | None = None
    site: str | None = None
    building: str | None = None
    floor: str | None = None
    parent: Parent | None = None


@dataclass(frozen=True, slots=True)
class TransformedPose:
    """A pose in the other map, with covariance."""

    x_m: float
    y_m: float
    theta_rad: float
    covariance: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class TransformResponse:
    """How one map lies in another; `via` are the maps on the way. `pose` is the pose asked for, in the other map."""

    via: tuple[str, ...]
    to_from_map: TransformedPose
    level_m: float
    pose: TransformedPose | None = None


@dataclass(frozen=True, slots=True)
class WallBody:
    """A straight piece of wall from a to b, the free side on its left. `covariance` says how well it is known, about
    its middle: variance of its direction (rad^2), of direction and offset (rad m), of the offset to the free side
    (m^2)."""

    a: Point2
    b: Point2
    covariance: tuple[float, float, float] | None = None


@dataclass(frozen=True, slots=True)
class WallsBody:
    """The walls of a map, in the order given."""

    segments: tuple[WallBody, ...]


@dataclass(frozen=True, slots=True)
class UnderlayPlace:
    """Where a picture lies in the map: side of a pixel, 0.0001 to 10; lower left corner of the lower left pixel; and
    direction of the picture's rows."""

    metres_per_pixel: float
    x_m: float = 0.0
    y_m: float = 0.0
    theta_rad: float = 0.0


@dataclass(frozen=True, slots=True)
class Underlay:
    """A picture that is shown under a map, with its size as a viewer shows it; `image_kind` is `png` or `jpeg`."""

    place: UnderlayPlace
    width_px: int
    height_px: int
    image_kind: str
    created_ms: int


@dataclass(frozen=True, slots=True)
class Job:
    """Long work. `progress` is 0 to 1; `message` says what it does, or why it failed; `by` names the token that
    asked for it. Times are ms since the Unix epoch; `started_ms` is absent while it waits."""

    id: int
    kind: str
    map: str
    state: JobState
    progress: float
    message: str
    by: str = ""
    created_ms: int = 0
    started_ms: int | None = None
    ended_ms: int | None = None
    result: Any = None


@dataclass(frozen=True, slots=True)
class Health:
    """The process answers: `ok`."""

    status: str


@dataclass(frozen=True, slots=True)
class ReadinessCounts:
    """How many things are wrong, named or not."""

    maps_not_in_use: int
    damaged_pictures: int


@dataclass(frozen=True, slots=True)
class StorageHealth:
    """The disk of the data directory. `refused` says why nothing can be added at present."""

    total_bytes: int
    free_bytes: int
    reusable_bytes: int
    used_percent: int
    limit_percent: int
    refused: str | None = None


@dataclass(frozen=True, slots=True)
class DatabaseCheckBody:
    """The check of every page, row and index that runs once after each start: `state` is `running`, `ok` or `failed`.
    `faults` are for a token for all maps; `advice` says what to do where it failed."""

    state: str
    ended_ms: int | None = None
    faults: tuple[str, ...] = ()
    advice: str | None = None


@dataclass(frozen=True, slots=True)
class Readiness:
    """`ready`, or `degraded`: everything runs, but some maps use an earlier version, or none, stored pictures are
    damaged, the last scheduled backup failed, or the disk has no room. `counts` has all of them; only those of the
    token's maps are named, and none without a token."""

    status: str
    maps_not_in_use: dict[str, str]
    panics: dict[str, int]
    damaged_pictures: tuple[str, ...] = ()
    backup: BackupHealth | None = None
    parts_still_s: dict[str, int] | None = None
    counts: ReadinessCounts = ReadinessCounts(0, 0)
    storage: StorageHealth | None = None
    # Why the server has no part in the router that it is to join.
    router: str | None = None
    # Maps that another server has, too, with the reason: robots are refused on them here.
    maps_not_served: dict[str, str] = field(default_factory=dict)
    database_check: DatabaseCheckBody | None = None


@dataclass(frozen=True, slots=True)
class Version:
    """What runs there."""

    name: str
    version: str
    api: str
    protocol: str
    # Name of the server among those of a router.
    server: str = ""
