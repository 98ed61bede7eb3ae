"""Maps, their walls and underlays, and the server itself."""

from __future__ import annotations

from collections.abc import Iterable
from os import PathLike

from waymark._async.base import AsyncBase, AsyncEvents, AsyncStream
from waymark._events import live_event
from waymark._http import Revised, picture_part, query_of
from waymark._values import UNSET, Unset, given, present, to_json
from waymark.api import (
    Backup,
    Commit,
    CoverageResponse,
    Difference,
    Distance,
    Draft,
    DraftDifference,
    FileWalls,
    GazeRankingBody,
    Health,
    LearningSettings,
    LiveEvent,
    Map,
    Order,
    Parent,
    PipelinePreset,
    PoseBody,
    Readiness,
    Replay,
    RollbackOutcome,
    Servers,
    SiteTopologyBody,
    TransformResponse,
    Underlay,
    UnderlayPlace,
    Version,
    VisibilitySettingsBody,
    VisibleResponse,
    WallBody,
    WallsBody,
)
from waymark.image import Picture
from waymark.wire import GazeCriterion, Pose2


class AsyncLiveEvents(AsyncStream[LiveEvent]):
    """Answers, poses and changes of a map from now on. A reader that is too slow gets `LiveMissed`."""

    def __init__(self, events: AsyncEvents) -> None:
        super().__init__(events)

    def _read(self, name: str, data: str) -> LiveEvent | None:
        return live_event(name, data)


class AsyncMaps(AsyncBase):
    """Operations on maps."""

    async def servers(self) -> Servers:
        """The servers that share a router, with their maps, and what more than one of them has."""
        return await self._send(Servers, "servers")

    async def health(self) -> Health:
        """Whether the process answers."""
        return await self._send(Health, "health")

    async def readiness(self) -> Readiness:
        """Whether every part of the server runs; `Refused` with status 503 otherwise."""
        return await self._send(Readiness, "readiness")

    async def version(self) -> Version:
        """Version of the server."""
        return await self._send(Version, "version")

    async def metrics(self) -> str:
        """Metrics of the server, in the text format of Prometheus."""
        return (await self._bytes("metrics")).decode()

    async def make_backup(self) -> Backup:
        """Begins a backup in the server's data directory; `backup` tells how far it is."""
        return await self._send(Backup, "make_backup")

    async def backups(self) -> tuple[Backup, ...]:
        """All backups in the server's data directory, by time."""
        return await self._all(Backup, "backups")

    async def backup(self, backup: str) -> Backup:
        """One backup: how far it is, and what it holds."""
        return await self._send(Backup, "backup", backup)

    async def backup_file(self, backup: str, path: str | PathLike[str]) -> int:
        """Writes a complete backup to a new file, for `waymark restore`; returns its size."""
        return await self._save(path, "backup_file", backup)

    async def delete_backup(self, backup: str) -> None:
        """Deletes a complete backup."""
        await self._done("delete_backup", backup)

    async def create_map(
        self,
        name: str,
        *,
        preset: PipelinePreset | None = None,
        distance: Distance | None = None,
        site: str | None = None,
        building: str | None = None,
        floor: str | None = None,
        parent: Parent | None = None,
    ) -> Map:
        """Creates an empty map; `Refused` with code `exists` if there is one of that name."""
        where = present(site=site, building=building, floor=floor, parent=parent)
        body = present(name=name, preset=preset, distance=distance) | where
        return await self._send(Map, "create_map", json=body)

    async def maps(self) -> tuple[Map, ...]:
        """All maps, by name."""
        return await self._all(Map, "maps")

    async def find_maps(self, *, name: str | None = None, sort: Order = "name") -> tuple[Map, ...]:
        """The maps with this part of the name."""
        return await self._all(Map, "maps", name=name, sort=sort)

    async def map(self, map: str) -> Map:
        """One map."""
        return await self._send(Map, "map", map)

    async def locate_map(
        self,
        map: str,
        *,
        site: str | Unset | None = UNSET,
        building: str | Unset | None = UNSET,
        floor: str | Unset | None = UNSET,
        parent: Parent | Unset | None = UNSET,
    ) -> Map:
        """Sets where a map is. What is not given stays; `None` forgets."""
        body = given(site=site, building=building, floor=floor, parent=parent)
        return await self._send(Map, "locate_map", map, json=body)

    async def set_pipeline(
        self, map: str, *, preset: PipelinePreset | Unset | None = UNSET, distance: Distance | Unset = UNSET
    ) -> Map:
        """Sets detector and decision of a map, and the distance that decides: without one, that of the preset. `None`:
        those of the server's settings."""
        return await self._send(Map, "locate_map", map, json=given(preset=preset, distance=distance))

    async def set_learning(self, map: str, learning: LearningSettings | None) -> Map:
        """Sets weights and gates of all landmarks of a map; `None`: those of the server. The reason in it
        goes to the history; what a landmark sets of its own goes before."""
        return await self._send(Map, "locate_map", map, json={"learning": to_json(learning)})

    async def copy_map(self, map: str, name: str) -> Map:
        """Makes a new map of all that a map has."""
        return await self._send(Map, "copy_map", map, json={"name": name})

    async def save_map(self, map: str, path: str | PathLike[str]) -> int:
        """Writes the whole map to a new file, a bundle (docs/BUNDLE.md); returns its size."""
        return await self._save(path, "save_map", map)

    async def load_map(self, bundle: bytes, name: str | None = None, *, without_link: bool = False) -> Map:
        """Makes a new map of a bundle, with its name or another one. `without_link` leaves out the link to the map that
        it lies in; otherwise a map of that name must be there."""
        query = query_of({"name": name, "without_link": without_link})
        return await self._send(Map, "load_map", content=bundle, params=query)

    async def rename_map(self, map: str, new_name: str) -> Map:
        """Gives a map another name; no robot may be on it."""
        return await self._send(Map, "locate_map", map, json={"name": new_name})

    async def delete_map(self, map: str) -> None:
        """Deletes a map and all that is in it."""
        await self._done("delete_map", map)

    async def commits(self, map: str) -> tuple[Commit, ...]:
        """All kept commits of a map, newest first: who changed what, when and why."""
        return await self._all(Commit, "commits", map)

    async def commit(self, map: str, commit: int) -> Commit:
        """One kept commit; `Refused` with code `unknown_commit` if it is not kept any more."""
        return await self._send(Commit, "commit", map, commit)

    async def difference(self, map: str, since: int, to: int | None = None, *, cursor: str | None = None) -> Difference:
        """What differs between a map at the commit `since` and at a later one, or now. `landmarks.next` is the cursor
        of the next page of landmarks."""
        query = {"from": since, **present(to=to, cursor=cursor)}
        return await self._send(Difference, "difference", map, params=query)

    async def roll_back(self, map: str, to: int) -> RollbackOutcome:
        """Makes a map what it was at a kept commit, by a commit of its own."""
        return await self._send(RollbackOutcome, "roll_back", map, json={"to": to})

    async def undo_commit(self, map: str, commit: int) -> RollbackOutcome:
        """Takes one commit back; `Refused` with code `changed_since` if a later one has changed the same."""
        return await self._send(RollbackOutcome, "undo_commit", map, commit)

    async def begin_draft(self, map: str, name: str) -> Draft:
        """Begins a draft: a map of its own, of this name, that no robot sees."""
        return await self._send(Draft, "begin_draft", map, json={"name": name})

    async def drafts(self, map: str) -> tuple[Draft, ...]:
        """The drafts of a map."""
        return await self._all(Draft, "drafts", map)

    async def discard_draft(self, map: str, draft: str) -> None:
        """Deletes a draft. The map stays as it is."""
        await self._done("discard_draft", map, draft)

    async def draft_difference(self, map: str, draft: str, *, cursor: str | None = None) -> DraftDifference:
        """What publishing a draft would change, and what is in the way."""
        query = present(cursor=cursor)
        return await self._send(DraftDifference, "draft_difference", map, draft, params=query)

    async def replay_draft(self, map: str, draft: str, frames: int | None = None) -> Replay:
        """Answers the last frames of the map's robots by map and draft, 40 unless given, and reports what differs."""
        return await self._send(Replay, "replay_draft", map, draft, params=present(frames=frames))

    async def publish_draft(self, map: str, draft: str) -> RollbackOutcome:
        """Publishes a draft by one commit of its map; `Refused` with code `conflict` where both changed the same."""
        return await self._send(RollbackOutcome, "publish_draft", map, draft)

    async def transform(self, map: str, to: str, pose: Pose2 | None = None) -> TransformResponse:
        """How a map lies in another one, and a pose converted by it."""
        query = {"to": to, **(to_json(pose) if pose is not None else {})}
        return await self._send(TransformResponse, "transform", map, params=query)

    async def site_topology(
        self, site: str, *, route_from: str | None = None, route_to: str | None = None
    ) -> SiteTopologyBody:
        """Places and passages of a site's maps; with both ends, each a place `hall/3` or a point `hall/2.5,-1`, a route
        with the landmarks to look for."""
        query = query_of({"from": route_from, "to": route_to})
        return await self._send(SiteTopologyBody, "site_topology", site, params=query)

    async def live_events(self, map: str) -> AsyncLiveEvents:
        """Follows a map. Close the stream, or use it as a context manager."""
        return AsyncLiveEvents(await self._stream("live_events", map))

    async def set_walls(self, map: str, segments: Iterable[WallBody]) -> WallsBody:
        """Replaces the walls; returns those stored."""
        return await self._send(WallsBody, "set_walls", map, json={"segments": to_json(list(segments))})

    async def read_wall_file(self, map: str, file: bytes, kind: str, metres_per_unit: float | None = None) -> FileWalls:
        """The walls of a file, which are stored nowhere. `kind` is the extension of its name: `geojson`, `svg`, `svgz`,
        `json` or `txt`. An SVG floor plan without a size needs the metres of one of its units."""
        query = query_of({"kind": kind, "metres_per_unit": metres_per_unit})
        return await self._send(FileWalls, "read_wall_file", map, content=file, params=query)

    async def walls(self, map: str) -> WallsBody:
        """The walls, as stored."""
        return await self._send(WallsBody, "walls", map)

    async def walls_revised(self, map: str) -> Revised[WallsBody]:
        """The walls, as stored, with their revision for `if_match`."""
        return await self._revised(WallsBody, "walls", map)

    async def set_underlay(self, map: str, image: Picture, place: UnderlayPlace) -> Underlay:
        """Replaces the picture that is shown under a map. It changes no answer to a robot."""
        form = {name: repr(float(value)) for name, value in to_json(place).items()}
        return await self._send(Underlay, "set_underlay", map, files=picture_part(image), data=form)

    async def underlay(self, map: str) -> Underlay:
        """Where the picture under a map lies; `Refused` with code `unknown_underlay` if there is none."""
        return await self._send(Underlay, "underlay", map)

    async def underlay_revised(self, map: str) -> Revised[Underlay]:
        """Where the picture under a map lies, with its revision for `if_match`."""
        return await self._revised(Underlay, "underlay", map)

    async def underlay_image(self, map: str) -> bytes:
        """The picture under a map, as it was uploaded: PNG or JPEG."""
        return await self._bytes("underlay_image", map)

    async def delete_underlay(self, map: str) -> None:
        """Deletes the picture under a map."""
        await self._done("delete_underlay", map)

    async def visibility_settings(self, map: str) -> VisibilitySettingsBody:
        """The camera that visibility is computed for, and what counts as seen; every field is there."""
        return await self._send(VisibilitySettingsBody, "visibility_settings", map)

    async def visibility_settings_revised(self, map: str) -> Revised[VisibilitySettingsBody]:
        """The visibility settings with their revision for `if_match`."""
        return await self._revised(VisibilitySettingsBody, "visibility_settings", map)

    async def set_visibility_settings(self, map: str, settings: VisibilitySettingsBody) -> VisibilitySettingsBody:
        """Replaces the visibility settings; absent fields take their defaults."""
        return await self._send(VisibilitySettingsBody, "set_visibility_settings", map, json=to_json(settings))

    async def visible(
        self, map: str, pose: PoseBody, visibility_settings: VisibilitySettingsBody | None = None
    ) -> VisibleResponse:
        """Landmarks that may be visible from an uncertain pose."""
        body = present(pose=pose, visibility_settings=visibility_settings)
        return await self._send(VisibleResponse, "visible", map, json=body)

    async def coverage(
        self,
        map: str,
        path: Iterable[tuple[float, float]],
        *,
        step_m: float = 0.1,
        visibility_settings: VisibilitySettingsBody | None = None,
    ) -> CoverageResponse:
        """Landmarks that are visible along a path (x, y in metres), and the parts without any."""
        body = present(path=list(path), step_m=step_m, visibility_settings=visibility_settings)
        return await self._send(CoverageResponse, "coverage", map, json=body)

    async def gaze_ranking(
        self,
        map: str,
        pose: PoseBody,
        *,
        head: dict[str, object] | None = None,
        viewer: dict[str, object] | None = None,
        criterion: GazeCriterion | None = None,
    ) -> GazeRankingBody:
        """Ranks landmarks as gaze targets from a pose. A robot that turns its camera uses `Robot.gaze`."""
        body = present(pose=pose, head=head, viewer=viewer, criterion=criterion)
        return await self._send(GazeRankingBody, "gaze_ranking", map, json=body)
