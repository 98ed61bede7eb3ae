//! `/robots/{robot}/certificates`: what robots show on encrypted connections.

use super::{
    AppState,
    answers::{created, page},
    error::ApiError,
    extract::{Body, PathParams, QueryParams, name, page_limit},
};
use crate::{
    identity::certificates::{CertificateError, Certificates},
    store::{
        now_ms,
        robot_certificates::{self, CertificateInsert},
        robots,
    },
};
use axum::{Json, extract::State, http::StatusCode};
use protos::api::{CertificateRequest, EnrolledRobot, Page, PageQuery, Problem, RobotCertificate};
use std::{sync::Arc, time::Duration};
use utoipa_axum::{router::OpenApiRouter, routes};

/// Validity of a certificate for which none is asked: a year.
const VALID_S: u64 = 31_536_000;
/// Shortest validity.
const MIN_VALID_S: u64 = 60;
/// Longest validity: ten years.
const MAX_VALID_S: u64 = 315_360_000;

/// What a robot is enrolled with.
#[derive(Debug, Clone)]
pub(crate) struct Enrolment {
    pub(crate) certificates: Arc<Certificates>,
    /// Where robots connect.
    pub(crate) zenoh: String,
}

pub(super) fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(enrol, list)).routes(routes!(revoke))
}

/// Signs a robot's request for a certificate, with which it connects to the encrypted listener. The
/// robot's private key stays where it was made. Other connections of robots are interrupted for
/// about a second. A repeat without a key makes another certificate.
#[utoipa::path(post, path = "/robots/{robot}/certificates", operation_id = "createCertificate",
    tag = "identity", params(("robot" = String, Path)),
    request_body = CertificateRequest, responses((status = 201, body = EnrolledRobot),
    (status = 404, body = Problem, description = "unknown_robot"),
    (status = 409, body = Problem, description = "not_encrypted, other_authority, too_many"),
    (status = 422, body = Problem, description = "bad_name, invalid_value, out_of_range")))]
async fn enrol(
    State(app): State<AppState>,
    PathParams(robot): PathParams<String>,
    Body(asked): Body<CertificateRequest>,
) -> Result<(StatusCode, Json<EnrolledRobot>), ApiError> {
    let robot = name("robot", robot)?;
    robots::get(app.store.reads(), robot.as_str()).await?;
    let valid_s = asked.valid_s.unwrap_or(VALID_S);
    if !(MIN_VALID_S..=MAX_VALID_S).contains(&valid_s) {
        let detail = format!("{MIN_VALID_S} to {MAX_VALID_S} s; leave it out to mean a year");
        return Err(ApiError::invalid("out_of_range", "valid_s", detail));
    }
    let Some(Enrolment { certificates, zenoh }) = app.enrolment.clone() else {
        let detail = "robots connect without encryption: set tls.enabled and a tls/ endpoint";
        return Err(ApiError::new(StatusCode::CONFLICT, "not_encrypted", detail));
    };
    if !certificates.enrols_robots() {
        let detail =
            "tls.client_authority signs robots' certificates: it is to sign this one, for the robot's name";
        return Err(ApiError::new(StatusCode::CONFLICT, "other_authority", detail));
    }
    let now_ms = now_ms();
    let valid = Duration::from_secs(valid_s);
    let signed = certificates.authority().issue_robot(&robot, &asked.request, now_ms, valid);
    let signed = signed.map_err(|error| match error {
        CertificateError::Request { reason } => ApiError::invalid("invalid_value", "request", reason),
        other => ApiError::internal(&other),
    })?;
    let insert = CertificateInsert {
        serial: signed.serial,
        robot: robot.as_str().to_owned(),
        sha256: signed.sha256,
        issued_ms: now_ms,
        expires_ms: signed.expires_ms,
    };
    let (certificate_pem, fleet) = (signed.certificate_pem, app.config.fleet.as_str().to_owned());
    let shown = move |stored: &RobotCertificate| {
        let enrolled = EnrolledRobot {
            certificate_pem: certificate_pem.clone(),
            authority_pem: certificates.server_authority_pem().map(str::to_owned),
            zenoh: zenoh.clone(),
            names: certificates.names().to_vec(),
            fleet: fleet.clone(),
            certificate: stored.clone(),
        };
        (StatusCode::CREATED, enrolled)
    };
    let work = app.store.write(move |tx| Box::pin(robot_certificates::create(tx, insert)));
    let done = created(shown, work).await?;
    access_control(&app).await;
    Ok(done)
}

/// Lists a robot's certificates, the oldest first, with those that were revoked or have expired.
#[utoipa::path(get, path = "/robots/{robot}/certificates", operation_id = "listCertificates", tag = "identity",
    params(("robot" = String, Path), PageQuery), responses((status = 200, body = Page<RobotCertificate>),
    (status = 404, body = Problem, description = "unknown_robot")))]
async fn list(
    State(app): State<AppState>,
    PathParams(robot): PathParams<String>,
    QueryParams(query): QueryParams<PageQuery>,
) -> Result<Json<Page<RobotCertificate>>, ApiError> {
    let limit = page_limit(query.limit, app.config.limits.page)?;
    robots::get(app.store.reads(), &robot).await?;
    let all = robot_certificates::of_robot(app.store.reads(), &robot).await?;
    let total = all.len() as u64;
    let after = query.cursor.as_deref();
    // A serial that is not there any more begins anew.
    let seen = after.and_then(|serial| all.iter().position(|c| c.serial == serial)).map_or(0, |at| at + 1);
    let rest: Vec<_> = all.into_iter().skip(seen).take(limit + 1).collect();
    Ok(Json(page(rest, limit, total, |row| row.serial.clone(), |row| row)))
}

/// Revokes a certificate: messages of the robot are refused at once if it has no other, and its
/// connection is closed.
#[utoipa::path(delete, path = "/robots/{robot}/certificates/{serial}", operation_id = "revokeCertificate",
    tag = "identity",
    params(("robot" = String, Path), ("serial" = String, Path)), responses((status = 204),
    (status = 404, body = Problem, description = "unknown_robot, unknown_certificate")))]
async fn revoke(
    State(app): State<AppState>,
    PathParams((robot, serial)): PathParams<(String, String)>,
) -> Result<StatusCode, ApiError> {
    robots::get(app.store.reads(), &robot).await?;
    let revoke = async move |tx: &mut _| robot_certificates::revoke(tx, &robot, &serial).await;
    app.store.write(move |tx| Box::pin(async move { revoke(tx).await })).await?;
    access_control(&app).await;
    Ok(StatusCode::NO_CONTENT)
}

/// Waits until robots' connections follow a change of certificates or robots, where they are
/// encrypted: whoever connects after the answer finds it, and meets no listener that is about to
/// open again.
pub(super) async fn access_control(app: &AppState) {
    if app.enrolment.is_some() && !app.store.certificates().applied().await {
        tracing::warn!(follows = "messages of revoked certificates are refused", "access_control_is_late");
    }
}
