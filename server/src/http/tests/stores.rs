//! What the interface says of a store in PostgreSQL, and what it takes for every store.

use super::*;
use crate::store::tests::cluster::{Cluster, on_cluster, on_each_store, on_postgres};

on_each_store! {
    a_text_with_u_0000_is_refused_and_names_its_field,
}

async fn a_text_with_u_0000_is_refused_and_names_its_field() {
    let service = Service::start(Limits::default()).await;
    let text = r#"{"name": "roof", "site": "no\u0000rd"}"#;
    for (method, path, body, expected) in [
        ("POST", "/api/v1/maps", text, (422, "invalid_value", "site")),
        ("GET", "/api/v1/maps?cursor=a%00b", "", (400, "bad_query", "cursor")),
        ("GET", "/api/v1/maps/a%00b", "", (404, "not_found", "path")),
    ] {
        let (status, problem) = read(service.ask(request(method, path, body)).await).await;
        let (code, field) = (problem["code"].as_str(), problem["field"].as_str());
        assert_eq!((status, code, field), (expected.0, Some(expected.1), Some(expected.2)), "{problem}");
        assert!(problem["detail"].as_str().unwrap().contains("U+0000"), "{problem}");
    }
    let (status, maps) = service.get("/api/v1/maps").await;
    assert_eq!((status, maps["items"].as_array().map(Vec::len)), (200, Some(1)));
}

#[tokio::test]
async fn postgresql_checks_its_pages_itself_and_the_audit_log_is_checked_here() {
    let test = async {
        let service = Service::start(Limits::default()).await;
        let (status, ready) = service.get("/readyz").await;
        assert_eq!((status, &ready["database_check"]), (200, &Value::Null), "{ready}");
        let (status, checked) = service.get("/api/v1/audit/check").await;
        assert_eq!((status, &checked["fault"]), (200, &Value::Null), "{checked}");
    };
    on_postgres(Box::pin(test)).await;
}

#[tokio::test]
async fn a_database_that_goes_away_stops_writes_alone_and_is_found_again() {
    let Some(cluster) = Cluster::new().await else { return };
    let cluster: &Cluster = Box::leak(Box::new(cluster));
    cluster.start();
    let test = async {
        let service = Service::start(Limits::default()).await;
        let version = service.store.snapshots().get("hall").unwrap().version;
        let create = async |name: &str| {
            service.ask(request("POST", "/api/v1/maps", format!(r#"{{"name": "{name}"}}"#))).await
        };
        cluster.stop();
        for _ in 0..2 {
            let refused = create("lost").await;
            assert!(refused.headers().contains_key(header::RETRY_AFTER), "{refused:?}");
            let (status, problem) = read(refused).await;
            assert_eq!((status, &problem["code"]), (503, &"store_away".into()), "{problem}");
        }
        let (status, problem) = service.get("/readyz").await;
        assert_eq!((status, &problem["code"]), (503, &"store_away".into()), "{problem}");
        assert_eq!(service.store.vitals().failure(), None);
        assert_eq!(service.store.snapshots().get("hall").unwrap().version, version, "robots are served");
        cluster.start();
        assert_eq!(create("found").await.status(), StatusCode::CREATED);
        let (_, maps) = service.get("/api/v1/maps").await;
        let names: Vec<_> = maps["items"].as_array().unwrap().iter().map(|map| &map["name"]).collect();
        assert_eq!(names, ["found", "hall"]);
        assert_eq!(service.get("/readyz").await.0, 200);
    };
    on_cluster(cluster, Box::pin(test)).await;
}
