//! Every route, with what is around them and the OpenAPI document made from them.

use super::{
    API, AppState, audit, authorise, backups, bulk, bundles, cameras,
    components::with_components,
    creation, documented, drafts,
    error::{ApiError, method_not_allowed},
    events,
    examples::with_examples,
    gathering, guard, health, history, landmark_models, landmarks, learning, live, localise, mapping, maps,
    metrics, modalities, page_session, pages, pose_by_hand, recognise, reference_runs, refused_views,
    relocalisation, replay, reused_answers, revision, robot_activity, robot_certificates, robots, ros2,
    security::with_security,
    servers, stored_answers, tokens, topology, underlay, views, visibility, visibility_settings, walls,
};
use crate::config::Limits;
use axum::{
    Json, Router,
    extract::{MatchedPath, Request, State},
    http::{HeaderMap, Method, StatusCode, Uri},
    middleware::{Next, from_fn_with_state},
    response::{IntoResponse, Response},
    routing::get,
};
use engine::panics::{Edge, Panics};
use futures::FutureExt as _;
use std::{any::Any, panic::AssertUnwindSafe};
use tower::ServiceExt as _;
use utoipa::{OpenApi, openapi};
use utoipa_axum::router::OpenApiRouter;
use utoipa_swagger_ui::SwaggerUi;

#[derive(OpenApi)]
#[openapi(
    components(schemas(
        protos::api::CaptureMetadata,
        protos::api::EventKind,
        protos::api::LandmarkDifference,
        protos::api::ListOrder,
        protos::api::ModelPicture,
        protos::api::NumberOrder,
        protos::api::ScanBody
    )),
    info(
        title = "Waymark",
        description = "Maps, landmarks, lessons and robots. Errors are application/problem+json with a stable `code` and \
                   the `field` at fault; lists come in pages."
    )
)]
struct Document;

fn api(limits: &Limits) -> OpenApiRouter<AppState> {
    OpenApiRouter::new()
        .merge(maps::router())
        .merge(walls::router())
        .merge(underlay::router(limits.upload_bytes))
        .merge(history::router())
        .merge(drafts::router())
        .merge(replay::router())
        .merge(mapping::router())
        .merge(landmarks::router())
        .merge(bulk::router())
        .merge(bundles::router())
        .merge(landmark_models::router())
        .merge(views::router(limits.upload_bytes))
        .merge(refused_views::router())
        .merge(learning::router())
        .merge(gathering::router())
        .merge(visibility::router())
        .merge(topology::router())
        .merge(modalities::router())
        .merge(reference_runs::router())
        .merge(visibility_settings::router())
        .merge(recognise::router(limits.upload_bytes))
        .merge(localise::router(limits.upload_bytes))
        .merge(stored_answers::router())
        .merge(robots::router())
        .merge(robot_activity::router())
        .merge(pose_by_hand::router())
        .merge(robot_certificates::router())
        .merge(relocalisation::router())
        .merge(ros2::router())
        .merge(servers::router())
        .merge(cameras::router())
        .merge(backups::router())
        .merge(live::router())
        .merge(events::router())
        .merge(tokens::router())
        .merge(audit::router())
        .merge(page_session::api())
        .merge(health::router())
        .merge(metrics::router())
}

/// Routes and their OpenAPI document.
pub(super) fn parts(limits: &Limits) -> (Router<AppState>, openapi::OpenApi) {
    let (routes, document) =
        OpenApiRouter::with_openapi(Document::openapi()).nest(API, api(limits)).split_for_parts();
    let document = creation::with_keys(with_examples(document, API));
    let document = with_security(revision::with_revisions(history::with_reasons(document)), API);
    (routes, with_components(documented::with_errors(document)))
}

/// The whole service: every route, with a guard in front.
#[derive(Debug, Clone)]
pub(crate) struct Service {
    app: AppState,
    routes: Router,
}

impl Service {
    pub(crate) fn new(app: AppState) -> Self {
        Self { routes: routes(&app), app }
    }

    pub(crate) async fn answer(self, request: Request) -> Response {
        let Self { app, routes } = self;
        let panics = app.store.vitals().panics();
        // The guard is no layer: what it answers itself costs neither a copy of the routes nor a
        // look for one of them.
        let inner = |request| async move {
            match AssertUnwindSafe(routes.oneshot(request)).catch_unwind().await {
                Ok(Ok(response)) => response,
                Ok(Err(never)) => match never {},
                Err(cause) => panicked(panics, cause.as_ref()),
            }
        };
        guard::guard(&app, request, inner).await
    }
}

fn routes(app: &AppState) -> Router {
    let (routes, document) = parts(&app.config.limits);
    let (health, _) = health::router().split_for_parts();
    let config = utoipa_swagger_ui::Config::from(format!("{API}/openapi.json"));
    let docs: Router<AppState> = SwaggerUi::new("/api/docs").config(config).into();
    routes
        .merge(metrics::at_root())
        .route_layer(from_fn_with_state(app.clone(), operation))
        .route(&format!("{API}/openapi.json"), get(move || async move { Json(document) }))
        .merge(health)
        .merge(pages::router())
        .merge(page_session::router())
        .merge(docs)
        .fallback(async |method: Method, uri: Uri, headers: HeaderMap| {
            pages::unknown(&method, uri.path(), &headers)
        })
        .method_not_allowed_fallback(async || method_not_allowed())
        .with_state(app.clone())
}

/// Around every operation. One layer and not three: each layer copies all that is below it, for
/// each request.
pub(super) async fn operation(State(app): State<AppState>, request: Request, next: Next) -> Response {
    let route = request.extensions().get::<MatchedPath>().cloned();
    let mut response = admitted(&app, request, next).await;
    if let Some(route) = route {
        // For the guard, which knows no routes.
        response.extensions_mut().insert(route);
    }
    response
}

async fn admitted(app: &AppState, request: Request, next: Next) -> Response {
    let (request, actor) = match authorise::authorise(app, request).await {
        Ok(admitted) => admitted,
        Err(refused) => return *refused,
    };
    let Some(actor) = actor else { return reused_answers::reused(app, request, next).await };
    actor.scope(creation::keyed(app, request, next)).await
}

fn panicked(panics: &Panics, cause: &(dyn Any + Send)) -> Response {
    panics.caught(Edge::Request, cause, "a request", "it is refused as internal");
    let detail = "the server failed on this request; see its log";
    ApiError::new(StatusCode::INTERNAL_SERVER_ERROR, "internal", detail).into_response()
}
