//! `/sites/{site}/topology`: places and passages of a site's maps, and a route through them.

use super::{
    AppState,
    error::{ApiError, out_of_range},
    extract::{PathParams, QueryParams},
    visibility::name_of,
};
use crate::{identity::Principal, store::map_locations};
use axum::{Extension, Json, extract::State, http::StatusCode};
use engine::{gaze::candidates, snapshot::MapSnapshot};
use map::{
    check::OutOfRange,
    gaze::PanTiltUnit,
    map_links::MapLinks,
    topology::{
        Leg, MAX_SITE_MAPS, MapTopology, Passage, PlaceAt, SiteTopology, TooManyMaps, map_topology,
        next_landmark,
    },
    visibility::VisibilityMap,
};
use nalgebra::Point2;
use protos::api::{
    NextLandmarkBody, PassageEnd, PlaceLandmark, Problem, RouteLeg, SiteTopologyBody, TopologyMap,
    TopologyPassage, TopologyPlace, TopologyQuery, TopologyRoute,
};
use std::{collections::BTreeMap, sync::Arc};
use utoipa_axum::{router::OpenApiRouter, routes};
use vision::model::LandmarkId;

pub(super) fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(get))
}

type Site = SiteTopology<String>;
type Snapshots = BTreeMap<String, Arc<MapSnapshot>>;

/// Places, which are free floor that no doorway divides, with the landmarks seen from them;
/// passages between them; and with `from` and `to` a route with the landmarks to look for.
#[utoipa::path(get, path = "/sites/{site}/topology", operation_id = "getSiteTopology",
    tag = "maps", params(("site" = String, Path), TopologyQuery), responses(
    (status = 200, body = SiteTopologyBody), (status = 400, body = Problem, description = "bad_query"),
    (status = 404, body = Problem, description = "unknown_place"),
    (status = 409, body = Problem, description = "no_route; too_many: maps, or cells of a floor"),
    (status = 422, body = Problem, description = "missing, invalid_value")))]
async fn get(
    State(app): State<AppState>,
    PathParams(site): PathParams<String>,
    QueryParams(query): QueryParams<TopologyQuery>,
    Extension(principal): Extension<Principal>,
) -> Result<Json<SiteTopologyBody>, ApiError> {
    let ends = ends(&query)?;
    let locations = map_locations::all(app.store.reads()).await?;
    let of_site = |(map, location): (&String, &map_locations::MapLocation)| {
        (location.site.as_ref() == Some(&site) && principal.may_see(map)).then(|| map.clone())
    };
    let mut snapshots = Snapshots::new();
    for name in locations.iter().filter_map(of_site) {
        let map = app.store.snapshots().with_visibility(&name).await;
        snapshots.extend(map.filter(|map| !map.is_draft).map(|map| (name, map)));
    }
    if snapshots.len() > MAX_SITE_MAPS {
        return Err(too_many(TooManyMaps(snapshots.len())));
    }
    let mut topologies = Vec::new();
    // One after the other: other requests have their turn between two maps.
    for (name, map) in &snapshots {
        let of_map = map.clone();
        let made =
            app.clone().on_vision_thread(move |_| map_topology(&of_map.walls, &areas(&of_map))).await?;
        let made = made.map_err(|error| {
            ApiError::new(StatusCode::CONFLICT, "too_many", format!("map `{name}`: {error}")).field("site")
        })?;
        topologies.push(made);
    }
    let links = map_locations::links(&locations);
    app.on_vision_thread(move |_| answer(&snapshots, topologies, &links, ends.as_ref())).await?.map(Json)
}

/// `topologies` in the order of `maps`.
fn answer(
    maps: &Snapshots,
    topologies: Vec<MapTopology>,
    links: &MapLinks<String>,
    ends: Option<&Ends>,
) -> Result<SiteTopologyBody, ApiError> {
    let with_areas =
        maps.iter().zip(topologies).map(|((name, map), made)| (name.clone(), (made, areas(map))));
    let site = SiteTopology::new(with_areas.collect(), links).map_err(too_many)?;
    let route = ends.map(|ends| route(&site, maps, ends)).transpose()?;
    Ok(shown(&site, maps, route))
}

fn too_many(error: TooManyMaps) -> ApiError {
    ApiError::new(StatusCode::CONFLICT, "too_many", error.to_string()).field("site")
}

fn areas(map: &MapSnapshot) -> Vec<(LandmarkId, &VisibilityMap)> {
    map.visibility.iter().map(|(id, area)| (*id, &**area)).collect()
}

/// A place or a point of a map.
#[derive(Debug, PartialEq)]
enum End {
    /// From 0.
    Place(usize),
    Point(Point2<f64>),
}

/// Both ends of a route: field, map, place or point.
type Ends = [(&'static str, String, End); 2];

fn ends(query: &TopologyQuery) -> Result<Option<Ends>, ApiError> {
    let TopologyQuery { from, to } = query;
    let (from, to) = match (from, to) {
        (None, None) => return Ok(None),
        (Some(from), Some(to)) => (from, to),
        (None, _) => return Err(ApiError::invalid("missing", "from", "`from` and `to` go together")),
        (_, None) => return Err(ApiError::invalid("missing", "to", "`from` and `to` go together")),
    };
    Ok(Some([end("from", from)?, end("to", to)?]))
}

fn end(field: &'static str, text: &str) -> Result<(&'static str, String, End), ApiError> {
    let wrong = || {
        let detail = "a place as `hall/3`, or a point in metres as `hall/2.5,-1`";
        ApiError::invalid("invalid_value", field, detail)
    };
    let (map, at) = text.split_once('/').ok_or_else(wrong)?;
    let end = match at.split_once(',') {
        Some((x, y)) => {
            let number = |text: &str| text.parse().ok().filter(|value: &f64| value.is_finite());
            End::Point(Point2::new(number(x).ok_or_else(wrong)?, number(y).ok_or_else(wrong)?))
        }
        None => End::Place(at.parse::<usize>().ok().and_then(|at| at.checked_sub(1)).ok_or_else(wrong)?),
    };
    Ok((field, map.to_owned(), end))
}

fn found(site: &Site, (field, map, end): &(&'static str, String, End)) -> Result<PlaceAt<String>, ApiError> {
    let topology = site.maps.get(map);
    let place = topology.and_then(|topology| match end {
        End::Place(place) => (*place < topology.places.len()).then_some(*place),
        End::Point(point) => topology.place_at(point),
    });
    let unknown = || {
        let detail = format!("map `{map}` of this site has no such place");
        ApiError::new(StatusCode::NOT_FOUND, "unknown_place", detail).field(*field)
    };
    place.map(|place| PlaceAt { map: map.clone(), place }).ok_or_else(unknown)
}

fn route(site: &Site, maps: &Snapshots, ends: &Ends) -> Result<TopologyRoute, ApiError> {
    let [from, to] = [found(site, &ends[0])?, found(site, &ends[1])?];
    let start = if let End::Point(point) = ends[0].2 { Some(point) } else { None };
    let legs = site.route(&from, start, &to).ok_or_else(|| {
        let detail = "no passages lead there: walls without a gap, or maps without a link";
        ApiError::new(StatusCode::CONFLICT, "no_route", detail).field("to")
    })?;
    let shown = |leg: &Leg<String>| {
        maps.get(&leg.place.map)
            .map(|map| leg_shown(map, leg))
            .transpose()
            .map_err(|e| out_of_range(&e, "site"))
    };
    let legs: Vec<RouteLeg> =
        legs.iter().filter_map(|leg| shown(leg).transpose()).collect::<Result<_, _>>()?;
    Ok(TopologyRoute { length_m: legs.iter().map(|leg| leg.length_m).sum(), legs })
}

fn leg_shown(map: &MapSnapshot, leg: &Leg<String>) -> Result<RouteLeg, OutOfRange> {
    let viewer = &map.visibility_settings.viewer;
    let head = PanTiltUnit { camera_m: [0.0, 0.0, viewer.camera_height_m], ..PanTiltUnit::default() };
    let next = next_landmark(&leg.path, &candidates(map), viewer, &head)?;
    Ok(RouteLeg {
        place: place_name(&leg.place),
        passage: leg.passage,
        length_m: leg.length_m,
        path: leg.path.iter().map(|point| [point.x, point.y]).collect(),
        next_landmark: next.map(|next| NextLandmarkBody {
            landmark: name_of(map, next.target.landmark),
            along_m: next.along_m,
            x_m: next.map_from_robot.x_m,
            y_m: next.map_from_robot.y_m,
            theta_rad: next.map_from_robot.theta_rad,
            pan_rad: next.target.pan_rad,
            tilt_rad: next.target.tilt_rad,
            range_m: next.target.range_m,
        }),
    })
}

/// `hall/3`.
fn place_name(at: &PlaceAt<String>) -> String {
    format!("{}/{}", at.map, at.place + 1)
}

fn shown(site: &Site, maps: &Snapshots, route: Option<TopologyRoute>) -> SiteTopologyBody {
    let version =
        |(name, map): (&String, &Arc<MapSnapshot>)| TopologyMap { map: name.clone(), version: map.version };
    let of_map =
        site.maps.iter().filter_map(|(name, topology)| Some(places(name, topology, maps.get(name)?)));
    let passage = |passage: &Passage<String>| {
        let first = maps.get(&passage.places[0].map);
        let name = |id: &LandmarkId| first.map(|map| name_of(map, *id));
        let end = |(at, middle): (&PlaceAt<String>, &Point2<f64>)| PassageEnd {
            place: place_name(at),
            x_m: middle.x,
            y_m: middle.y,
        };
        TopologyPassage {
            ends: passage.places.iter().zip(&passage.middles).map(end).collect(),
            width_m: passage.width_m,
            length_m: passage.length_m(),
            landmarks: passage.landmarks.iter().filter_map(name).collect(),
        }
    };
    SiteTopologyBody {
        maps: maps.iter().map(version).collect(),
        places: of_map.flatten().collect(),
        passages: site.passages.iter().map(passage).collect(),
        route,
    }
}

fn places(name: &str, topology: &MapTopology, map: &MapSnapshot) -> Vec<TopologyPlace> {
    let place = |(place, made): (usize, &map::topology::Place)| TopologyPlace {
        place: place_name(&PlaceAt { map: name.to_owned(), place }),
        map: name.to_owned(),
        x_m: made.centre.x,
        y_m: made.centre.y,
        area_m2: made.area_m2,
        landmarks: made
            .landmarks
            .iter()
            .map(|seen| PlaceLandmark { landmark: name_of(map, seen.landmark), share: seen.share })
            .collect(),
    };
    topology.places.iter().enumerate().map(place).collect()
}
