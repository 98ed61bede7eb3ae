//! Metrics and readiness by the routes: what is counted, who may ask, and what a part that stands
//! still does to both.

use super::*;
use engine::heartbeats::STALLED;
use protos::Code;

async fn scraped(service: &Service, path: &str) -> (u16, String, String) {
    let response = service.ask(request("GET", path, "")).await;
    let kind = response.headers().get(header::CONTENT_TYPE).map(|kind| kind.to_str().unwrap().to_owned());
    let status = response.status().as_u16();
    let body = to_bytes(response.into_body(), 4 << 20).await.unwrap();
    (status, kind.unwrap_or_default(), String::from_utf8(body.to_vec()).unwrap())
}

fn value(text: &str, series: &str) -> f64 {
    let line = text.lines().find_map(|line| line.strip_prefix(series)?.strip_prefix(' '));
    line.unwrap_or_else(|| panic!("no {series} in {text}")).parse().unwrap()
}

#[tokio::test]
async fn metrics_are_those_of_the_counters_at_both_places() {
    let service = Service::start(Limits::default()).await;
    for code in [Code::BadImage, Code::BadImage, Code::UnknownRobot] {
        service.engine.slots.refuse(code);
    }
    let fault = || assert!(std::hint::black_box(false), "planted");
    service.engine.vitals.panics().catch(Edge::Scan, "a scan", "nothing", fault);
    let (status, kind, text) = scraped(&service, "/metrics").await;
    assert_eq!((status, kind.as_str()), (200, "text/plain; version=0.0.4; charset=utf-8"));
    let received = value(&text, "waymark_frames_received_total");
    let outcomes = ["processed", "superseded", "expired", "rejected"];
    let ended: f64 =
        outcomes.iter().map(|o| value(&text, &format!("waymark_frames_total{{outcome=\"{o}\"}}"))).sum();
    let open = value(&text, "waymark_frames_waiting") + value(&text, "waymark_frames_in_work");
    assert_eq!((received as u64, (ended + open) as u64), (3, 3));
    for (series, expected) in [
        ("waymark_frames_rejected_total{code=\"bad_image\"}", 2),
        ("waymark_panics_total{edge=\"scan\"}", 1),
        ("waymark_robots", 1),
        ("waymark_robot_connected{robot=\"r1\"}", 0),
        ("waymark_jobs{state=\"running\"}", 0),
        ("waymark_ready", 1),
    ] {
        let found = value(&text, series);
        assert_eq!(found as i64, expected, "{series}");
    }
    let (status, _, text) = scraped(&service, "/api/v1/metrics").await;
    assert!(status == 200 && text.contains("# TYPE waymark_frames_total counter\n"), "{text}");
    for series in [
        "waymark_http_requests_total{method=\"GET\",route=\"/metrics\",status=\"200\"}",
        "waymark_http_request_duration_seconds_bucket{route=\"/metrics\",le=\"30\"}",
    ] {
        assert_eq!(value(&text, series) as u64, 1, "the first scrape: {series}");
    }
}

#[tokio::test]
async fn metrics_need_a_token_for_all_maps() {
    let service = Service::start(Limits::default()).await;
    let bare = |path: &str| request("GET", path, "");
    for path in ["/metrics", "/api/v1/metrics"] {
        assert_eq!(service.ask_as_it_is(bare(path)).await.status(), StatusCode::UNAUTHORIZED);
    }
    let scoped = r#"{"name": "narrow", "role": "admin", "maps": ["hall"]}"#;
    let (status, made) = read(service.ask(request("POST", "/api/v1/tokens", scoped)).await).await;
    assert_eq!(status, 201, "{made}");
    let mut asked = bare("/metrics");
    let token = format!("Bearer {}", made["text"].as_str().unwrap());
    asked.headers_mut().insert(header::AUTHORIZATION, token.parse().unwrap());
    assert_eq!(service.ask_as_it_is(asked).await.status(), StatusCode::FORBIDDEN);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_writer_that_stands_still_makes_the_server_not_ready_until_it_goes_on() {
    let service = Service::start(Limits::default()).await;
    let seconds = |n| {
        for _ in 0..n {
            service.store.vitals().hearts().tick(Duration::from_secs(1));
        }
    };
    let release = hold_writer(&service.store).await;
    service.store.heart().beat();
    let store = service.store.clone();
    let probe = tokio::spawn(async move { store.probe().await });
    while service.store.queue().waiting == 0 {
        tokio::task::yield_now().await;
    }
    seconds(STALLED.as_secs());
    assert_eq!(service.get("/readyz").await.0, 200);
    seconds(2);
    let (status, problem) = service.get("/readyz").await;
    let expected = (503, &"part_stalled".into(), &crate::store::WRITER.into());
    assert_eq!((status, &problem["code"], &problem["part"]), expected);
    let (_, _, text) = scraped(&service, "/metrics").await;
    assert_eq!((value(&text, "waymark_ready") as u64, value(&text, "waymark_writes_waiting") as u64), (0, 1));
    assert!(!probe.is_finished(), "the probe went past a write that has not ended");
    drop(release);
    probe.await.unwrap().unwrap();
    seconds(1);
    let (status, ready) = service.get("/readyz").await;
    assert_eq!((status, &ready["parts_still_s"][crate::store::WRITER]), (200, &0.into()));
    let commits = service.store.commits();
    service.store.probe().await.unwrap();
    assert_eq!(service.store.commits(), commits, "a probe writes nothing");
}
