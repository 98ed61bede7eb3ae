//! The routes without a network: requests go straight to the router.

mod authorisation;
mod creation;
mod events;
mod lists;
mod metrics;
mod learning_settings;
mod localise;
mod numbers;
mod objects;
mod openapi;
mod page_sessions;
mod readiness;
mod revision;
mod refused_views;
mod stored_answers;
mod stores;
mod teaching;
mod topology;
mod uploads;

use super::*;
use crate::{
    config::{Limits, RawConfig, RawTls},
    identity::{Secret, TokenText, certificates::Certificates},
    publication::{CatalogueTasks, tests::raw_config},
    store::{StoreError, maps},
};
use axum::{
    body::{Body, to_bytes},
    http::{Request, Response, header},
};
use engine::{panics::Edge, scene, snapshot::MapSnapshot, workers::Engine};
use serde_json::Value;
use std::time::Instant;
use vision::recognise::DistanceKind;

/// A service on a fresh database with map `hall` and robot `r1` on it.
struct Service {
    app: AppState,
    routes: super::Service,
    store: Catalogue,
    engine: Engine,
    /// Text of the local token.
    local: String,
    _writer: CatalogueTasks,
    _stop: watch::Sender<bool>,
    _data: tempfile::TempDir,
}

impl Service {
    async fn start(limits: Limits) -> Self {
        let service = Self::on(tempfile::tempdir().unwrap(), limits).await;
        let store = &service.store;
        store.write(|tx| Box::pin(maps::create(tx, "hall", DistanceKind::Both, 9))).await.unwrap();
        store.write(|tx| Box::pin(crate::store::robots::put(tx, "r1", "hall", 9))).await.unwrap();
        service
    }

    /// On the database of this directory.
    async fn on(data: tempfile::TempDir, limits: Limits) -> Self {
        let raw = RawConfig { limits, ..raw_config(data.path()) };
        let config = Arc::new(crate::config::Config::try_from(raw).unwrap());
        let (store, writer) = Catalogue::open(&config).await.unwrap();
        let (stop, stopping) = watch::channel(false);
        let (jobs, _) = Jobs::start(store.clone(), config.clone(), stopping.clone()).await.unwrap();
        let (tap, frames) = crate::gather::gathering_tap();
        let (gatherer, _) = Gatherer::start(store.clone(), &config, &tap, frames).await.unwrap();
        let told =
            (store.vitals().panics().clone(), store.events().clone(), store.disk().clone(), store.database());
        let (backups, _) = crate::backup::Backups::start(&config, told, stopping.clone());
        let hall = Arc::new(MapSnapshot::empty("hall", 1));
        let (mut engine, observers) = scene::engine(&[hall]);
        engine.vitals = store.vitals().clone();
        engine.observers.push(Arc::new(tap));
        let enrolment = {
            let tls = RawTls { enabled: true, ..RawTls::default() };
            let settings = Config::try_from(RawConfig { tls, ..RawConfig::default() }).unwrap();
            let certificates = Certificates::open(settings.tls.as_ref().unwrap(), data.path(), 0).unwrap();
            Enrolment { certificates: Arc::new(certificates), zenoh: settings.zenoh_endpoint }
        };
        // As a gate does that has nothing to close.
        let follower = store.certificates().clone();
        tokio::spawn(async move {
            let mut changes = follower.changes();
            while changes.changed().await.is_ok() {
                let change = *changes.borrow_and_update();
                follower.set_applied(change);
            }
        });
        let app = App::new(
            config,
            store.clone(),
            Services {
                server: protos::Name::new("test").unwrap(),
                fleet: None,
                jobs,
                gatherer,
                ros2: Arc::default(),
                publisher: None,
                sessions: Arc::default(),
                local_token_file: Some("/data/local-token".into()),
                backups,
                enrolment: Some(enrolment),
            },
            (&engine, &observers),
            stopping,
        );
        let secret = Secret::random().unwrap();
        store.tokens().set_local(&secret);
        let local = TokenText::local(80, &secret);
        let app = Arc::new(app);
        Self {
            routes: super::Service::new(app.clone()),
            app,
            store,
            engine,
            local,
            _writer: writer,
            _stop: stop,
            _data: data,
        }
    }

    /// Asks with the local token, unless the request says who asks.
    fn ask(&self, mut request: Request<Body>) -> impl Future<Output = Response<Body>> + Send + 'static {
        let local = format!("Bearer {}", self.local).parse().unwrap();
        request.headers_mut().entry(header::AUTHORIZATION).or_insert(local);
        self.ask_as_it_is(request)
    }

    /// Asks without more credentials than the request has.
    fn ask_as_it_is(&self, request: Request<Body>) -> impl Future<Output = Response<Body>> + Send + 'static {
        self.routes.clone().answer(request)
    }

    async fn get(&self, path: &str) -> (u16, Value) {
        read(self.ask(request("GET", path, "")).await).await
    }
}

fn request(method: &str, path: &str, body: impl Into<Body>) -> Request<Body> {
    let request = Request::builder().method(method).uri(path).header(header::HOST, "localhost");
    let request = request.header(header::CONTENT_TYPE, "application/json").header(header::IF_MATCH, "*");
    request.body(body.into()).unwrap()
}

async fn read(response: Response<Body>) -> (u16, Value) {
    let status = response.status().as_u16();
    let bytes = to_bytes(response.into_body(), 1 << 20).await.unwrap();
    (status, serde_json::from_slice(&bytes).unwrap_or_default())
}

#[tokio::test]
async fn a_panic_in_a_write_is_answered_and_counted_and_the_server_stays_ready() {
    let service = Service::start(Limits::default()).await;
    let planted = service.store.write(|_| {
        Box::pin(async {
            assert!(std::hint::black_box(false), "planted");
            Ok::<(), StoreError>(())
        })
    });
    assert_eq!(ApiError::from(planted.await.unwrap_err()).code, "internal");
    let (status, ready) = service.get("/readyz").await;
    assert_eq!((status, &ready["status"], &ready["panics"]["write"]), (200, &"ready".into(), &1.into()));
    let made = service.ask(request("POST", "/api/v1/maps", r#"{"name": "after"}"#)).await;
    assert_eq!(made.status(), StatusCode::CREATED);
    assert_eq!(service.store.vitals().panics().at(Edge::Write), 1);
}

/// A recorded drive of `r1` along x, and the body that tells its path.
fn driven(service: &Service) -> String {
    use protos::{Name, prost::Message, v1};
    let r1 = Name::new("r1").unwrap();
    service.engine.motion.start_recording(&r1, "hall").unwrap();
    let begun = std::time::Instant::now();
    for seq in 1..=20_u64 {
        let captured_ns = seq as i64 * 100_000_000;
        // As much time passes between messages as their stamps say.
        let received = begun + Duration::from_nanos(captured_ns as u64);
        let odom_from_robot = Some(v1::Pose2 { x_m: seq as f64 * 0.1, ..v1::Pose2::default() });
        let odometry =
            v1::Odometry { epoch: 1, seq, captured_ns, odom_from_robot, ..v1::Odometry::default() };
        service.engine.motion.odometry(&r1, odometry.encode_to_vec().into(), received);
    }
    assert_eq!(service.engine.motion.recording(&r1).unwrap().odometry, 20);
    let poses: Vec<_> =
        (1..=20).map(|i| (i * 100_000_000_i64, f64::from(i as i32) * 0.1, 0.0, 0.0)).collect();
    serde_json::json!({ "poses": poses }).to_string()
}

/// Keeps the writer busy from now until the sender is dropped.
async fn hold_writer(store: &Catalogue) -> tokio::sync::oneshot::Sender<()> {
    let (release, released) = tokio::sync::oneshot::channel::<()>();
    let (begin, begun) = tokio::sync::oneshot::channel();
    let store = store.clone();
    tokio::spawn(async move {
        let held = store.write(move |_| {
            Box::pin(async move {
                begin.send(()).unwrap();
                drop(released.await);
                Ok(())
            })
        });
        held.await.unwrap();
    });
    begun.await.unwrap();
    release
}

/// The caller hangs up at several points between the reading of the recording and the write. The
/// write never begins before that, because the writer is held, so the drive must still be there
/// each time.
#[tokio::test(flavor = "multi_thread")]
async fn a_recorded_drive_outlives_a_client_that_hangs_up() {
    let service = Service::start(Limits::default()).await;
    let body = driven(&service);
    let r1 = protos::Name::new("r1").unwrap();
    let motion = &service.engine.motion;
    let short = || tokio::time::sleep(Duration::from_micros(200));
    for polls_after_lending in 0..10 {
        let writer = hold_writer(&service.store).await;
        let asked = service.ask(request("POST", "/api/v1/robots/r1/recording/reference", body.clone()));
        let mut asked = Box::pin(asked);
        while !motion.is_lent(&r1) {
            assert!(futures::poll!(asked.as_mut()).is_pending(), "answered without the recording");
            short().await;
        }
        for _ in 0..polls_after_lending {
            assert!(futures::poll!(asked.as_mut()).is_pending(), "answered while the writer is held");
            short().await;
        }
        drop((asked, writer));
        while motion.is_lent(&r1) {
            short().await;
        }
        assert_eq!(motion.recording(&r1).unwrap().odometry, 20, "after {polls_after_lending} polls");
        let (_, runs) = service.get("/api/v1/maps/hall/reference-runs").await;
        assert_eq!(runs["runs"].as_array().unwrap().len(), 0);
    }
    let answer = service.ask(request("POST", "/api/v1/robots/r1/recording/reference", body)).await;
    assert_eq!(answer.status(), StatusCode::CREATED);
    assert!(motion.recording(&r1).is_none(), "stored once, and over");
}

#[tokio::test]
async fn a_drive_whose_run_cannot_be_stored_stays() {
    let service = Service::start(Limits::default()).await;
    let body = driven(&service);
    crate::publication::tests::refuse_runs(&service.store).await;
    let answer = service.ask(request("POST", "/api/v1/robots/r1/recording/reference", body)).await;
    assert_eq!(answer.status(), StatusCode::INTERNAL_SERVER_ERROR);
    let r1 = protos::Name::new("r1").unwrap();
    assert_eq!(service.engine.motion.recording(&r1).unwrap().odometry, 20);
    assert!(service.engine.motion.lend_recording(&r1).is_ok());
}

#[tokio::test]
async fn a_change_that_timed_out_before_it_began_is_not_made() {
    let service = Service::start(Limits { request_timeout_s: 1, ..Limits::default() }).await;
    let go = Arc::new(tokio::sync::Notify::new());
    let wait = go.clone();
    let store = service.store.clone();
    let first = tokio::spawn(async move {
        let write = store.write(move |_| {
            Box::pin(async move {
                wait.notified().await;
                Ok(())
            })
        });
        write.await
    });
    tokio::task::yield_now().await;
    // It waits behind that write for longer than it may.
    let late = read(service.ask(request("POST", "/api/v1/maps", r#"{"name": "late"}"#)).await).await;
    assert_eq!((late.0, &late.1["code"], &late.1["may_be_done"]), (408, &"timeout".into(), &true.into()));
    assert!(late.1["detail"].as_str().unwrap().contains("may have been made"));
    go.notify_one();
    first.await.unwrap().unwrap();
    // The writer has had its turn once this one is made.
    let made = service.ask(request("POST", "/api/v1/maps", r#"{"name": "next"}"#)).await;
    assert_eq!(made.status(), StatusCode::CREATED);
    assert_eq!(service.get("/api/v1/maps/late").await.0, 404);
}

#[tokio::test]
async fn large_bodies_take_a_place_before_they_are_read() {
    let service = Service::start(Limits { uploads: 1, upload_wait_s: 1, ..Limits::default() }).await;
    let large = |name: &str| {
        let body = format!("{{\"name\": \"{name}\"{}}}", " ".repeat(65 << 10));
        request("POST", "/api/v1/maps", body)
    };
    // A body that does not come to its end.
    let endless = futures::stream::pending::<Result<axum::body::Bytes, std::convert::Infallible>>();
    let mut held = Box::pin(service.ask(request("POST", "/api/v1/maps", Body::from_stream(endless))));
    assert!(futures::poll!(held.as_mut()).is_pending());
    let refused = service.ask(large("one")).await;
    assert!(refused.headers().contains_key(header::RETRY_AFTER));
    let (status, problem) = read(refused).await;
    assert_eq!((status, &problem["code"]), (503, &"too_many_uploads".into()));
    let small = service.ask(request("POST", "/api/v1/maps", r#"{"name": "small"}"#)).await;
    assert_eq!(small.status(), StatusCode::CREATED);
    drop(held);
    assert_eq!(service.ask(large("one")).await.status(), StatusCode::CREATED);
}

#[tokio::test]
async fn a_known_path_may_be_as_long_as_it_is_promised() {
    use ::map::modality_stats::MAX_REFERENCE;
    let service = Service::start(Limits::default()).await;
    let path = |poses: usize| {
        let pose = |i: usize| {
            let ns = 1_700_000_000_000_000_000_i64 + i as i64;
            format!("[{ns}, -1234.5678901234567, 0.00012345678901234567, -1.5707963267948966]")
        };
        let poses: Vec<String> = (0..poses).map(pose).collect();
        request(
            "POST",
            "/api/v1/robots/r1/recording/reference",
            format!("{{\"poses\": [{}]}}", poses.join(", ")),
        )
    };
    // Read to its end: only then it matters that there is no recording.
    let (status, problem) = read(service.ask(path(MAX_REFERENCE)).await).await;
    assert_eq!((status, &problem["code"]), (404, &"not_recording".into()), "{problem}");
    let (status, problem) = read(service.ask(path(MAX_REFERENCE + 1)).await).await;
    assert_eq!((status, &problem["code"]), (422, &"too_many".into()), "{problem}");
}

/// A robot whose odometry says that it is 7 m less far than it is: a frame a second with the
/// landmark of this number, that puts it there.
fn framed(service: &Service, seconds: u64, (landmark, x_m): (u64, f64)) {
    use engine::motion::{FrameFixes, FrameStamp};
    use map::{
        localise::{AmbiguityResolvedBy, Fix, FixResult, FixSource},
        pose2::{Pose2, Pose2Covariance},
    };
    let (r1, front) = (protos::Name::new("r1").unwrap(), protos::Name::new("front").unwrap());
    let odometry = Pose2::new(seconds as f64 * 0.1, 0.0, 0.0);
    let captured_ns = seconds as i64 * 1_000_000_000;
    let at = FrameStamp { map: "hall", epoch: 1, captured_ns, odometry: Some(odometry), now: Instant::now() };
    let prior = service.engine.motion.prior_pose(&r1, &front, at).map(|prior| prior.pose);
    let covariance = nalgebra::Matrix3::identity() * 1e-4;
    let fix = FixResult::Fixed(Box::new(Fix {
        modality: FixSource::Landmarks,
        pose: Pose2Covariance { pose: Pose2::new(x_m, 0.0, 0.0), covariance },
        noise: covariance,
        nuisances: Vec::new(),
        landmarks: vec![vision::model::LandmarkId(landmark)],
        decided_by: AmbiguityResolvedBy::Single,
        chi2: 1.0,
        dof: 5,
    }));
    let says = FrameFixes { prior: prior.as_ref(), independent: Some(&fix), ..FrameFixes::default() };
    service.engine.motion.apply_frame(&r1, &front, at, &says);
}

#[tokio::test]
async fn a_robot_is_shown_with_how_far_its_pose_is_trusted() {
    let service = Service::start(Limits::default()).await;
    assert_eq!(service.get("/api/v1/robots/r1").await.1["pose"], Value::Null);
    let shown = |path: &'static str, pointer: &'static str| {
        let asked = service.get(path);
        async move { asked.await.1.pointer(pointer).cloned().unwrap_or_default() }
    };
    framed(&service, 1, (1, 7.1));
    assert_eq!(shown("/api/v1/robots/r1", "/pose/trust").await, "supported");
    // Another landmark puts it 3 m further.
    framed(&service, 2, (2, 10.2));
    assert_eq!(shown("/api/v1/robots/r1", "/pose/trust").await, "contradicted");
    assert_eq!(shown("/api/v1/robots", "/items/0/pose/trust").await, "contradicted");
}

#[tokio::test]
async fn the_document_names_every_word_of_trust_and_what_guided_fixes_may_do() {
    let service = Service::start(Limits::default()).await;
    let (_, document) = service.get("/api/v1/openapi.json").await;
    let trust = &document["components"]["schemas"]["PoseTrust"];
    let described = trust["enum"].as_array().or(trust["oneOf"].as_array()).unwrap();
    let words: Vec<_> =
        described.iter().map(|w| w.as_str().unwrap_or_else(|| w["enum"][0].as_str().unwrap())).collect();
    let wire = (0..5).map(protos::json::pose_trust::word);
    assert_eq!(words, wire.collect::<Vec<_>>());
    assert_eq!(protos::json::pose_trust::word(5), words[0], "a word of the wire is missing here");
    let corrections = &document["paths"]["/api/v1/robots/{robot}/corrections"]["get"];
    let text = format!("{} {}", corrections["summary"], corrections["description"]);
    assert!(text.contains("`guided`") && text.contains("never starts, supports or replaces"), "{text}");
}
