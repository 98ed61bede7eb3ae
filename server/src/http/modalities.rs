//! `/maps/{map}/modalities`: which modality is best where, as runs have shown; the areas that
//! somebody named; what is fused.

use super::{
    AppState,
    error::ApiError,
    extract::{Body, PathParams, QueryParams, label},
    revision::{IfMatch, Revised},
};
use crate::store::kind::Kind;
use crate::store::{
    maps,
    modality_stats::{self, ModalitySettings},
    revisions::{self, Subject},
};
use axum::{Json, extract::State};
use map::{
    modality_stats::{
        CELL_M, FusionMode, MAX_AREAS, MAX_NAME_BYTES, Modality, ModalityAdvice, ModalityMap, NamedArea,
        PoseCell, StatsByModality, StatsScope,
    },
    pose2::Pose2,
};
use protos::api::{
    AdviceBody, AreaBody, AreaStatsBody, CellBody, ErrorModelBody, FusionModeBody, ModalityBody,
    ModalityMapBody, ModalityMapPatch, ModalityQuery, ModalityStatsBody, NamedAreaBody, Problem,
    StatsScopeBody,
};
use std::{f64::consts::FRAC_PI_2, sync::Arc};
use utoipa_axum::{router::OpenApiRouter, routes};

/// Most cells of one answer.
const MAX_CELLS: usize = 20_000;

pub(super) fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(get, put)).routes(routes!(at))
}

fn heading_rad(heading: u8) -> f64 {
    Pose2::new(0.0, 0.0, f64::from(heading) * FRAC_PI_2).theta_rad
}

fn mode(fusion: FusionModeBody) -> FusionMode {
    match fusion {
        FusionModeBody::All => FusionMode::All,
        FusionModeBody::NearBest => FusionMode::NearBest,
        FusionModeBody::Best => FusionMode::Best,
    }
}

fn mode_shown(mode: FusionMode) -> FusionModeBody {
    match mode {
        FusionMode::All => FusionModeBody::All,
        FusionMode::NearBest => FusionModeBody::NearBest,
        FusionMode::Best => FusionModeBody::Best,
    }
}

fn modality(of: Modality) -> ModalityBody {
    match of {
        Modality::Odometry => ModalityBody::Odometry,
        Modality::Laser => ModalityBody::Laser,
        Modality::Landmarks => ModalityBody::Landmarks,
    }
}

fn scope(scope: StatsScope) -> StatsScopeBody {
    match scope {
        StatsScope::Cell => StatsScopeBody::Cell,
        StatsScope::Neighbourhood => StatsScopeBody::Neighbourhood,
        StatsScope::Area => StatsScopeBody::Area,
        StatsScope::Map => StatsScopeBody::Map,
    }
}

/// What runs have shown, by modality.
pub(super) fn stats(found: &StatsByModality) -> Vec<ModalityStatsBody> {
    let one = |(of, evidence): (Modality, &::map::modality_stats::ModalityStats)| {
        let figures = evidence.figures();
        ModalityStatsBody {
            modality: modality(of),
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

fn used(advice: &ModalityAdvice) -> Vec<ModalityBody> {
    let used = Modality::ALL.into_iter().zip(advice.used);
    used.filter_map(|(of, used)| used.then_some(modality(of))).collect()
}

fn advice_shown(advice: &ModalityAdvice) -> AdviceBody {
    let error_model = |of| {
        let model = advice.fault(of);
        ErrorModelBody {
            modality: modality(of),
            bias: model.bias.into(),
            variance_inflation: model.excess.into(),
        }
    };
    AdviceBody {
        best: advice.best.map(modality),
        used: used(advice),
        scope: scope(advice.level),
        error_models: Modality::ALL.map(error_model).into(),
    }
}

fn area_stats(advice: &ModalityAdvice, found: &StatsByModality) -> AreaStatsBody {
    AreaStatsBody { advice: advice_shown(advice), statistics: stats(found) }
}

fn cell(cell: &PoseCell, advice: &ModalityAdvice) -> CellBody {
    CellBody {
        x_m: f64::from(cell.x) * CELL_M,
        y_m: f64::from(cell.y) * CELL_M,
        heading_rad: heading_rad(cell.heading),
        best: advice.best.map(modality),
        used: used(advice),
    }
}

fn modality_map(areas: &ModalityMap) -> ModalityMapBody {
    let named = areas.named().map(|(area, by_heading)| NamedAreaBody {
        name: area.name.clone(),
        corners_m: area.corners_m.clone(),
        headings: by_heading.iter().map(|(found, advice)| area_stats(advice, found)).collect(),
    });
    let (found, advice) = areas.map();
    let count = areas.cells().count();
    ModalityMapBody {
        fusion_mode: mode_shown(areas.mode()),
        areas: named.collect(),
        cell_m: CELL_M,
        cells: areas.cells().take(MAX_CELLS).map(|(at, _, advice)| cell(at, advice)).collect(),
        omitted_cells: count.saturating_sub(MAX_CELLS),
        map: area_stats(advice, found),
    }
}

fn known(app: &AppState, map: &str) -> Result<Arc<ModalityMap>, ApiError> {
    let found = app.store.snapshots().get(map);
    let found =
        found.ok_or_else(|| crate::store::StoreError::NotFound { what: Kind::Map, name: map.to_owned() })?;
    Ok(found.modalities.clone())
}

/// With the revision of what people set: the fusion mode and the named areas.
fn revised(areas: &ModalityMap) -> Revised<ModalityMapBody> {
    let named = areas.named().map(|(area, _)| area.clone()).collect();
    let set = ModalitySettings { mode: areas.mode(), named };
    Revised(modality_stats::revision(&set), modality_map(areas))
}

/// Which modality is best where, as runs have shown, and what is fused.
#[utoipa::path(get, path = "/maps/{map}/modalities", operation_id = "getModalities",
    tag = "maps", params(("map" = String, Path)),
    responses((status = 200, body = ModalityMapBody), (status = 404, body = Problem)))]
async fn get(
    State(app): State<AppState>,
    PathParams(map): PathParams<String>,
) -> Result<Revised<ModalityMapBody>, ApiError> {
    Ok(revised(&*known(&app, &map)?))
}

fn checked(areas: Vec<AreaBody>) -> Result<Vec<NamedArea>, ApiError> {
    if areas.len() > MAX_AREAS {
        return Err(ApiError::invalid("too_many", "areas", format!("more than {MAX_AREAS} areas")));
    }
    let mut named: Vec<NamedArea> = Vec::new();
    for (i, AreaBody { name, corners_m }) in areas.into_iter().enumerate() {
        let area = NamedArea { name, corners_m };
        area.check().map_err(|e| {
            ApiError::invalid("out_of_range", format!("areas[{i}].{}", e.field), e.to_string())
        })?;
        label(format!("areas[{i}].name"), &area.name, MAX_NAME_BYTES)?;
        if named.iter().any(|other| other.name == area.name) {
            let detail = format!("two areas are named `{}`", area.name);
            return Err(ApiError::invalid("exists", format!("areas[{i}].name"), detail));
        }
        named.push(area);
    }
    Ok(named)
}

/// Sets what is fused, and the areas that have names.
#[utoipa::path(put, path = "/maps/{map}/modalities", operation_id = "setModalities",
    tag = "maps", params(("map" = String, Path)), request_body = ModalityMapPatch,
    responses((status = 200, body = ModalityMapBody), (status = 404, body = Problem),
    (status = 422, body = Problem, description = "out_of_range, exists, too_many")))]
async fn put(
    State(app): State<AppState>,
    PathParams(map): PathParams<String>,
    IfMatch(is): IfMatch,
    Body(change): Body<ModalityMapPatch>,
) -> Result<Revised<ModalityMapBody>, ApiError> {
    let named = change.areas.map(checked).transpose()?;
    let fusion = change.fusion_mode.map(mode);
    let name = map.clone();
    let write = app.store.write(move |tx| {
        Box::pin(async move {
            let new = |old: ModalitySettings| ModalitySettings {
                mode: fusion.unwrap_or(old.mode),
                named: named.unwrap_or(old.named),
            };
            revisions::check(tx, &name, &Subject::Modalities, &is).await?;
            modality_stats::set(tx, &name, new).await
        })
    });
    write.await?;
    Ok(revised(&*known(&app, &map)?))
}

/// What is known where a robot would be: what runs have found there, and what follows.
#[utoipa::path(get, path = "/maps/{map}/modalities/at", operation_id = "getModalitiesAt",
    tag = "maps", params(("map" = String, Path), ModalityQuery),
    responses((status = 200, body = AreaStatsBody), (status = 404, body = Problem),
    (status = 422, body = Problem, description = "out_of_range")))]
async fn at(
    State(app): State<AppState>,
    PathParams(map): PathParams<String>,
    QueryParams(place): QueryParams<ModalityQuery>,
) -> Result<Json<AreaStatsBody>, ApiError> {
    maps::get(app.store.reads(), &map).await?;
    let pose = Pose2::new(place.x_m, place.y_m, place.theta_rad);
    pose.check().map_err(|e| ApiError::invalid("out_of_range", e.field, e.to_string()))?;
    let (areas, cell) = (known(&app, &map)?, PoseCell::of(&pose));
    let found = areas.cells().find(|(other, ..)| **other == cell).map(|(_, found, _)| *found);
    let advice = areas.advice(&pose);
    Ok(Json(area_stats(&advice, &found.unwrap_or_default())))
}
