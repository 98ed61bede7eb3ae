//! `/readyz`: how much is wrong is for everybody, what it is for those who may see the maps.

use super::{
    authorisation::{token, with_token},
    page_sessions::{cookie, link, with_cookie},
    *,
};
use crate::store::{
    db, pictures,
    underlays::{self, UnderlayRow},
};
use protos::api::Role;
use serde_json::json;

/// What no stranger reads: a reason with a path.
const REASON: &str = "cannot read /srv/secret";

#[tokio::test]
async fn one_address_is_bound_and_the_server_looks_alive_all_the_same() {
    let limits = Limits { address_requests_per_s: 5, ..Limits::default() };
    let service = Service::start(limits).await;
    let ask = async |path: &str| {
        let mut asked = request("GET", path, "");
        asked.extensions_mut().insert(super::peer::Peer::plain("192.0.2.7:4000".parse().unwrap()));
        service.ask_as_it_is(asked).await.status().as_u16()
    };
    let mut refused = 0;
    for _ in 0..40 {
        refused += usize::from(ask("/version").await == 429);
        assert_eq!(ask("/healthz").await, 200);
    }
    assert!(refused >= 20, "{refused} of 40 requests were refused");
}

/// Maps `hall` and `yard`, each with a damaged picture and a version that is not in use.
async fn broken() -> Service {
    let service = Service::start(Limits::default()).await;
    let store = &service.store;
    store.write(|tx| Box::pin(maps::create(tx, "yard", DistanceKind::Both, 9))).await.unwrap();
    for map in ["hall", "yard"] {
        let row = UnderlayRow {
            image_sha256: pictures::digest(map.as_bytes()),
            image_kind: "png".into(),
            size_px: [2, 2],
            metres_per_pixel: 0.05,
            map_from_picture: [0.0; 3],
            created_ms: 0,
        };
        store.write(move |tx| Box::pin(underlays::put(tx, map, row, map.as_bytes()))).await.unwrap();
    }
    let damage =
        "INSERT INTO damaged_pictures (sha256, reason, found_ms) SELECT sha256, 'planted', 0 FROM pictures";
    let damaged = store.write(move |tx| {
        Box::pin(async move {
            db::raw_sql(damage).execute(tx.conn()).await.map_err(StoreError::during("damage")).map(drop)
        })
    });
    damaged.await.unwrap();
    for map in ["hall", "yard"] {
        store.vitals().unpublished(map, REASON);
    }
    service
}

/// What is named: maps, and places of damaged pictures.
fn named(body: &Value) -> (Value, Value) {
    (body["maps_not_in_use"].clone(), body["damaged_pictures"].clone())
}

#[tokio::test(flavor = "multi_thread")]
async fn everybody_is_told_how_much_is_wrong_and_by_name_only_who_may_see_the_map() {
    let service = broken().await;
    let hall = token(&service, Role::Viewer, Some("hall"), None).await;
    let all = token(&service, Role::Viewer, None, None).await;
    let expired = token(&service, Role::Admin, None, Some(1)).await;
    let path = link(&service, &hall).await;
    let session = cookie(&service.ask_as_it_is(request("GET", &path, "")).await);
    let nothing = (json!({}), json!([]));
    let of_hall = (json!({"hall": REASON}), json!(["underlay of map hall"]));
    let of_all =
        (json!({"hall": REASON, "yard": REASON}), json!(["underlay of map hall", "underlay of map yard"]));
    for path in ["/readyz", "/api/v1/readyz"] {
        let bare = || request("GET", path, "");
        let hostile = format!("{all}x");
        for (asked, wanted) in [
            (bare(), &nothing),
            (with_token(bare(), &expired), &nothing),
            (with_token(bare(), &hostile), &nothing),
            (with_cookie(bare(), "waymark_session_80=x"), &nothing),
            (with_token(bare(), &hall), &of_hall),
            (with_cookie(bare(), &session), &of_hall),
            (with_token(bare(), &all), &of_all),
        ] {
            let (status, body) = read(service.ask_as_it_is(asked).await).await;
            assert_eq!((status, &body["status"]), (200, &json!("degraded")), "{body}");
            assert_eq!(body["counts"], json!({"maps_not_in_use": 2, "damaged_pictures": 2}), "{body}");
            assert_eq!(named(&body), *wanted, "{path}");
            if wanted == &nothing {
                for secret in ["hall", "yard", "secret", "planted"] {
                    assert!(!body.to_string().contains(secret), "{secret}: {body}");
                }
            }
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn only_a_token_for_all_maps_is_told_of_backups_and_parts() {
    let service = Service::start(Limits::default()).await;
    let hall = token(&service, Role::Admin, Some("hall"), None).await;
    let (status, made) = read(service.ask(request("POST", "/api/v1/backups", "")).await).await;
    assert_eq!(status, 202, "{made}");
    let name = made["name"].as_str().unwrap().to_owned();
    let until = Instant::now() + Duration::from_mins(1);
    while service.get("/readyz").await.1["backup"]["newest"].is_null() {
        assert!(Instant::now() < until, "the backup does not end");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    let ask = async |token: Option<&str>| {
        let asked = match token {
            Some(token) => with_token(request("GET", "/readyz", ""), token),
            None => request("GET", "/readyz", ""),
        };
        read(service.ask_as_it_is(asked).await).await
    };
    for token in [None, Some(hall.as_str())] {
        let (_, body) = ask(token).await;
        assert!(body["backup"]["newest"].is_null() && body["backup"]["newest_ms"].is_i64(), "{body}");
        assert_eq!(body["status"], "ready");
    }
    assert_eq!(ask(Some(&service.local)).await.1["backup"]["newest"], json!(name));
    drop(service.store.vitals().begin("the thread of robot r9 of ROS"));
    for token in [None, Some(hall.as_str())] {
        let (status, problem) = ask(token).await;
        assert_eq!((status, &problem["code"]), (503, &json!("part_ended")));
        assert!(!problem.to_string().contains("r9"), "{problem}");
    }
    assert_eq!(ask(Some(&service.local)).await.1["part"], "the thread of robot r9 of ROS");
}

#[tokio::test]
async fn a_part_that_has_ended_makes_the_server_not_ready() {
    let service = Service::start(Limits::default()).await;
    assert_eq!(service.get("/readyz").await.0, 200);
    drop(service.store.vitals().begin("the laser thread"));
    let (status, problem) = service.get("/readyz").await;
    assert_eq!(
        (status, &problem["code"], &problem["part"]),
        (503, &"part_ended".into(), &"the laser thread".into())
    );
}

#[tokio::test]
async fn a_writer_that_has_ended_makes_the_server_not_ready() {
    let service = Service::start(Limits::default()).await;
    let fatal = service.store.write(|_| {
        let source = db::Error::WorkerCrashed;
        Box::pin(async move { Err::<(), _>(StoreError::Database { operation: "planted", source }) })
    });
    assert!(fatal.await.is_err());
    service.store.vitals().failed().await;
    let (status, problem) = service.get("/readyz").await;
    assert_eq!((status, &problem["code"]), (503, &"storage_failed".into()));
}
