//! `/maps/{map}/areas`: which modality is best where, as runs have shown; the areas that somebody named; what is fused.

use super::{
    Shared,
    error::{ApiError, Problem},
    extract::{At, Body, Params},
};
use crate::store::{
    areas::{self, Settings},
    maps,
};
use axum::{Json, extract::State};
use map::{
    modality_stats::{
        CELL_M, FusionMode, MAX_AREAS, Modality, ModalityAdvice, ModalityMap, NamedArea, PoseCell,
        StatsByModality, StatsScope,
    },
    pose2::Pose2,
};
use serde::{Deserialize, Serialize};
use std::{f64::consts::FRAC_PI_2, sync::Arc};
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::{router::OpenApiRouter, routes};

/// Most cells of one answer.
const MAX_CELLS_TOLD: usize = 20_000;

pub(super) fn router() -> OpenApiRouter<Shared> {
    OpenApiRouter::new().routes(routes!(get, put)).routes(routes!(at))
}

/// What is fused where runs have told which modality is best. Odometry carries the pose in any case.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
enum Fusion {
    /// Everything, each as sure as it proved to be.
    All,
    /// Those whose score is at most twice the best one's.
    Fuse,
    /// The best one alone.
    Single,
}

impl From<Fusion> for FusionMode {
    fn from(fusion: Fusion) -> Self {
        match fusion {
            Fusion::All => Self::All,
            Fusion::Fuse => Self::Fuse,
            Fusion::Single => Self::Single,
        }
    }
}

impl From<FusionMode> for Fusion {
    fn from(mode: FusionMode) -> Self {
        match mode {
            FusionMode::All => Self::All,
            FusionMode::Fuse => Self::Fuse,
            FusionMode::Single => Self::Single,
        }
    }
}

/// A part of the map with a name: a room, a piece of corridor. It speaks for its square metres that were hardly driven
/// through.
#[derive(Debug, Clone, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct Area {
    /// Unique, 1 to 64 bytes.
    name: String,
    /// Its corners in order, x and y in metres: 3 to 64.
    corners_m: Vec<[f64; 2]>,
}

/// What changes; a field that is absent stays.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct Change {
    /// What is fused.
    mode: Option<Fusion>,
    /// All named areas, at most 64; where they overlap the first one counts.
    areas: Option<Vec<Area>>,
}

/// What runs have shown of one module: odometry alone, or the laser or landmarks each with odometry only.
/// Errors are robot-aligned: metres along, metres to the left, radians.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct Shown {
    /// `odometry`, `laser` or `landmarks`.
    #[schema(value_type = String)]
    module: Modality,
    /// Mean error of its own position.
    mean: [f64; 3],
    /// Standard deviations about that.
    sigma: [f64; 3],
    /// Share of the way on which it knew something lately.
    availability: f64,
    /// Measurements a second.
    rate_hz: f64,
    /// Share of them off by more than three of the standard deviations that they claim.
    outliers: f64,
    /// Mean squared error over availability, 0.1 rad as much as a metre; absent if it never knew anything. The lowest is best.
    score: Option<f64>,
    /// Steps of 5 cm that were compared.
    steps: u64,
    /// Measurements that were compared.
    measurements: u64,
}

impl Shown {
    pub(super) fn all(found: &StatsByModality) -> Vec<Self> {
        let one = |(module, evidence): (Modality, &::map::modality_stats::ModalityStats)| {
            let figures = evidence.figures();
            Self {
                module,
                mean: figures.mean,
                sigma: figures.sigma,
                availability: figures.availability,
                rate_hz: figures.rate_hz,
                outliers: figures.outliers,
                score: figures.score.is_finite().then_some(figures.score),
                steps: evidence.available(),
                measurements: evidence.fixes(),
            }
        };
        Modality::ALL.into_iter().zip(found).map(one).collect()
    }
}

/// What follows for a robot there.
#[derive(Debug, Serialize, ToSchema)]
struct Told {
    /// The best module; absent where too little is known, and everything is fused.
    #[schema(value_type = Option<String>)]
    best: Option<Modality>,
    /// What is fused.
    #[schema(value_type = Vec<String>)]
    used: Vec<Modality>,
    /// Whose runs say so: those through the `cell`, those through the named `area`, or all of the `map`.
    #[schema(value_type = String)]
    level: StatsScope,
    /// What each module gets wrong there beyond what it claims.
    faults: Vec<Wrong>,
}

/// What a module gets wrong: along, to the left, heading.
#[derive(Debug, Serialize, ToSchema)]
struct Wrong {
    /// Which.
    #[schema(value_type = String)]
    module: Modality,
    /// Subtracted from what it says: metres, metres, radians; of odometry for each metre.
    bias: [f64; 3],
    /// Added to each variance, as a share of what it claims.
    excess: [f64; 3],
}

impl From<&ModalityAdvice> for Told {
    fn from(advice: &ModalityAdvice) -> Self {
        let wrong = |module| {
            let fault = advice.fault(module);
            Wrong { module, bias: fault.bias.into(), excess: fault.excess.into() }
        };
        Self {
            best: advice.best,
            used: Modality::ALL
                .into_iter()
                .zip(advice.used)
                .filter_map(|(m, used)| used.then_some(m))
                .collect(),
            level: advice.level,
            faults: Modality::ALL.map(wrong).into(),
        }
    }
}

/// A square metre that was driven through in one of four headings.
#[derive(Debug, Serialize, ToSchema)]
struct Square {
    /// Its lower left corner.
    x_m: f64,
    /// The same.
    y_m: f64,
    /// 0, pi/2, pi or -pi/2, each for a quarter of the circle about it.
    heading_rad: f64,
    /// The best module; absent where too little is known.
    #[schema(value_type = Option<String>)]
    best: Option<Modality>,
    /// What is fused.
    #[schema(value_type = Vec<String>)]
    used: Vec<Modality>,
}

/// A named area and what is known of it.
#[derive(Debug, Serialize, ToSchema)]
struct KnownArea {
    /// Its name.
    name: String,
    /// Its corners.
    corners_m: Vec<[f64; 2]>,
    /// By heading: 0, pi/2, pi, -pi/2.
    headings: Vec<Known>,
}

/// What is known of a place.
#[derive(Debug, Serialize, ToSchema)]
struct Known {
    /// What follows.
    told: Told,
    /// What was found.
    modules: Vec<Shown>,
}

/// All that is known.
#[derive(Debug, Serialize, ToSchema)]
struct AllAreas {
    /// What is fused.
    mode: Fusion,
    /// Areas with a name.
    areas: Vec<KnownArea>,
    /// Side of the squares.
    cell_m: f64,
    /// Square metres that were driven through; see `areas/at` for what was found in one.
    cells: Vec<Square>,
    /// Squares that this answer has no room for.
    left_off: usize,
    /// All of the map.
    map: Known,
}

fn heading_rad(heading: u8) -> f64 {
    Pose2::new(0.0, 0.0, f64::from(heading) * FRAC_PI_2).theta_rad
}

fn square(cell: &PoseCell, advice: &ModalityAdvice) -> Square {
    let told = Told::from(advice);
    Square {
        x_m: f64::from(cell.x) * CELL_M,
        y_m: f64::from(cell.y) * CELL_M,
        heading_rad: heading_rad(cell.heading),
        best: told.best,
        used: told.used,
    }
}

impl AllAreas {
    fn new(areas: &ModalityMap) -> Self {
        let named = areas.named().map(|(area, by_heading)| KnownArea {
            name: area.name.clone(),
            corners_m: area.corners_m.clone(),
            headings: by_heading
                .iter()
                .map(|(found, advice)| Known { told: advice.into(), modules: Shown::all(found) })
                .collect(),
        });
        let (found, advice) = areas.map();
        let count = areas.cells().count();
        Self {
            mode: areas.mode().into(),
            areas: named.collect(),
            cell_m: CELL_M,
            cells: areas.cells().take(MAX_CELLS_TOLD).map(|(cell, _, advice)| square(cell, advice)).collect(),
            left_off: count.saturating_sub(MAX_CELLS_TOLD),
            map: Known { told: advice.into(), modules: Shown::all(found) },
        }
    }
}

fn known(app: &Shared, map: &str) -> Result<Arc<ModalityMap>, ApiError> {
    let found = app.store.snapshots().get(map);
    let found =
        found.ok_or_else(|| crate::store::StoreError::NotFound { what: "map", name: map.to_owned() })?;
    Ok(found.modalities.clone())
}

/// Which modality is best where, as runs have shown, and what is fused.
#[utoipa::path(get, path = "/maps/{map}/areas", tag = "maps", params(("map" = String, Path)),
    responses((status = 200, body = AllAreas), (status = 404, body = Problem)))]
async fn get(State(app): State<Shared>, At(map): At<String>) -> Result<Json<AllAreas>, ApiError> {
    Ok(Json(AllAreas::new(&*known(&app, &map)?)))
}

fn checked(areas: Vec<Area>) -> Result<Vec<NamedArea>, ApiError> {
    if areas.len() > MAX_AREAS {
        return Err(ApiError::invalid("too_many", "areas", format!("more than {MAX_AREAS} areas")));
    }
    let mut named: Vec<NamedArea> = Vec::new();
    for (i, Area { name, corners_m }) in areas.into_iter().enumerate() {
        let area = NamedArea { name, corners_m };
        area.check().map_err(|e| {
            ApiError::invalid("out_of_range", format!("areas[{i}].{}", e.field), e.to_string())
        })?;
        if named.iter().any(|other| other.name == area.name) {
            let detail = format!("two areas are named `{}`", area.name);
            return Err(ApiError::invalid("exists", format!("areas[{i}].name"), detail));
        }
        named.push(area);
    }
    Ok(named)
}

/// Sets what is fused, and the areas that have names.
#[utoipa::path(put, path = "/maps/{map}/areas", tag = "maps", params(("map" = String, Path)), request_body = Change,
    responses((status = 200, body = AllAreas), (status = 404, body = Problem),
    (status = 422, body = Problem, description = "out_of_range, exists, too_many")))]
async fn put(
    State(app): State<Shared>,
    At(map): At<String>,
    Body(change): Body<Change>,
) -> Result<Json<AllAreas>, ApiError> {
    let named = change.areas.map(checked).transpose()?;
    let mode = change.mode.map(FusionMode::from);
    let name = map.clone();
    let write = app.store.write(move |tx| {
        Box::pin(async move {
            let new = |old: Settings| Settings {
                mode: mode.unwrap_or(old.mode),
                named: named.unwrap_or(old.named),
            };
            areas::set(tx, &name, new).await
        })
    });
    write.await?;
    Ok(Json(AllAreas::new(&*known(&app, &map)?)))
}

/// Where.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
struct Place {
    /// Metres.
    x_m: f64,
    /// Metres.
    y_m: f64,
    /// Heading of the robot, radians; 0 if absent.
    #[serde(default)]
    theta_rad: f64,
}

/// What is known where a robot would be: what runs have found there, and what follows.
#[utoipa::path(get, path = "/maps/{map}/areas/at", tag = "maps", params(("map" = String, Path), Place),
    responses((status = 200, body = Known), (status = 404, body = Problem),
    (status = 422, body = Problem, description = "out_of_range")))]
async fn at(
    State(app): State<Shared>,
    At(map): At<String>,
    Params(place): Params<Place>,
) -> Result<Json<Known>, ApiError> {
    maps::get(app.store.reads(), &map).await?;
    let pose = Pose2::new(place.x_m, place.y_m, place.theta_rad);
    pose.check().map_err(|e| ApiError::invalid("out_of_range", e.field, e.to_string()))?;
    let (areas, cell) = (known(&app, &map)?, PoseCell::of(&pose));
    let found = areas.cells().find(|(other, ..)| **other == cell).map(|(_, found, _)| *found);
    let advice = areas.advice(&pose);
    Ok(Json(Known { told: (&advice).into(), modules: Shown::all(&found.unwrap_or_default()) }))
}
