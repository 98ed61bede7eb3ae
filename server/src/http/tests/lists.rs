//! Lists with filters, orders and totals; several landmarks at once.

use super::{teaching::blocks, *};
use serde_json::json;

impl Service {
    /// The names, and the number of all pages, of a list of landmarks.
    async fn found(&self, query: &str) -> (Vec<String>, u64) {
        let (status, page) = self.get(&format!("/api/v1/maps/hall/landmarks{query}")).await;
        assert_eq!(status, 200, "{query}: {page}");
        let names = page["items"].as_array().unwrap().iter().map(|l| l["name"].as_str().unwrap().to_owned());
        (names.collect(), page["total"].as_u64().unwrap())
    }

    async fn bulk(&self, verb: &str, body: Value) -> (u16, Value) {
        let path = format!("/api/v1/maps/hall/bulk/{verb}-landmarks");
        read(self.ask(request("POST", &path, body.to_string())).await).await
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn landmarks_are_found_by_what_they_are() {
    let service = Service::start(Limits::default()).await;
    let place = json!({ "x_m": 1.0, "y_m": 0.0, "z_m": 1.5, "theta_rad": 0.0 });
    let new = json!({ "landmarks": [{ "name": "door-1", "place": place }, { "name": "door-2" }, { "name": "sign" }] });
    assert_eq!(service.bulk("create", new).await, (201, json!({ "count": 3 })));
    let all =
        |names: &[&str]| (names.iter().map(ToString::to_string).collect::<Vec<_>>(), names.len() as u64);
    assert_eq!(service.found("").await, all(&["door-1", "door-2", "sign"]));
    assert_eq!(service.found("?name=door").await, all(&["door-1", "door-2"]));
    assert_eq!(service.found("?name=door&has_place=false").await, all(&["door-2"]));
    assert_eq!(service.found("?sort=-name").await, all(&["sign", "door-2", "door-1"]));
    let (page, total) = service.found("?sort=-name&limit=1&cursor=sign").await;
    assert_eq!((page, total), (vec!["door-2".to_owned()], 3));
    // The one that is changed last comes first.
    tokio::time::sleep(Duration::from_millis(5)).await;
    let flagged = request("PATCH", "/api/v1/maps/hall/landmarks/door-2", r#"{"health": "flagged"}"#);
    assert_eq!(service.ask(flagged).await.status(), 200);
    assert_eq!(service.found("?sort=-changed&limit=1").await.0, ["door-2"]);
    assert_eq!(service.found("?health=flagged").await, all(&["door-2"]));
    assert_eq!(service.upload("sign", blocks(1), &[("whole_image", "true")]).await.0, 201);
    service.learn("sign").await;
    let status =
        service.get("/api/v1/maps/hall/landmarks/sign").await.1["status"].as_str().unwrap().to_owned();
    assert_eq!(service.found(&format!("?status={status}")).await, all(&["sign"]));
    assert_eq!(service.found("?status=not_learnt").await, all(&["door-1", "door-2"]));
    for (query, code) in
        [("?status=good", "bad_query"), ("?sort=size", "bad_query"), ("?limit=0", "out_of_range")]
    {
        let (_, problem) = service.get(&format!("/api/v1/maps/hall/landmarks{query}")).await;
        assert_eq!(problem["code"], code, "{query}");
    }
    assert_eq!(service.get("/api/v1/robots?sort=changed").await.1["field"], "sort");
    let maps = service.get("/api/v1/maps?name=al&sort=-changed").await.1;
    assert_eq!((&maps["items"][0]["name"], &maps["total"]), (&json!("hall"), &json!(1)));
}

#[tokio::test(flavor = "multi_thread")]
async fn jobs_are_listed_newest_first() {
    let service = Service::start(Limits::default()).await;
    assert_eq!(
        service.upload("poster", blocks(1), &[("create", "true"), ("whole_image", "true")]).await.0,
        201
    );
    for _ in 0..3 {
        service.learn("poster").await;
    }
    let ids = async |query: &str| {
        let (status, page) = service.get(&format!("/api/v1/jobs{query}")).await;
        assert_eq!(status, 200, "{page}");
        let ids = page["items"].as_array().unwrap().iter().map(|job| job["id"].as_i64().unwrap());
        (ids.collect::<Vec<_>>(), page["total"].as_u64().unwrap(), page["next"].as_str().map(str::to_owned))
    };
    assert_eq!(ids("?state=done&map=hall").await, (vec![3, 2, 1], 3, None));
    assert_eq!(ids("?limit=2").await, (vec![3, 2], 3, Some("2".to_owned())));
    assert_eq!(ids("?limit=2&cursor=2").await, (vec![1], 3, None));
    assert_eq!(ids("?state=queued").await, (vec![], 0, None));
    assert_eq!(ids("?map=attic").await, (vec![], 0, None));
    assert_eq!(service.get("/api/v1/jobs?cursor=x").await.1["field"], "cursor");
}

#[tokio::test]
async fn several_landmarks_are_made_and_deleted_together_or_not_at_all() {
    let service = Service::start(Limits { landmarks: 3, ..Limits::default() }).await;
    let named = |names: &[&str]| json!({ "landmarks": names.iter().map(|name| json!({ "name": name })).collect::<Vec<_>>() });
    let refused = |(status, problem): (u16, Value)| {
        let text = |member: &str| problem[member].as_str().unwrap_or_default().to_owned();
        (status, text("code"), text("field"))
    };
    let is = |status, code: &str, field: &str| (status, code.to_owned(), field.to_owned());
    for (body, expected) in [
        (named(&["a", "B"]), is(422, "bad_name", "landmarks[1].name")),
        (named(&["a", "b", "a"]), is(409, "exists", "landmarks[2].name")),
        (named(&["a", "b", "c", "d"]), is(409, "too_many", "landmarks[3].name")),
        (named(&[]), is(422, "out_of_range", "landmarks")),
        (
            json!({ "landmarks": [{ "name": "a", "size": { "width_m": 0, "height_m": 1 } }] }),
            is(422, "out_of_range", "landmarks[0].size.width_m"),
        ),
    ] {
        assert_eq!(refused(service.bulk("create", body).await), expected);
        assert_eq!(service.found("").await.1, 0, "a part of it was made");
    }
    assert_eq!(service.bulk("create", named(&["a", "b", "c"])).await, (201, json!({ "count": 3 })));
    let gone = refused(service.bulk("delete", named(&["a", "x"])).await);
    assert_eq!(gone, is(404, "unknown_landmark", "landmarks[1].name"));
    let (_, a) = service.get("/api/v1/maps/hall/landmarks/a").await;
    let stale = json!({ "landmarks": [{ "name": "b" }, { "name": "a", "revision": "1.1" }] });
    assert_eq!(
        refused(service.bulk("delete", stale).await),
        is(412, "changed_meanwhile", "landmarks[1].if-match")
    );
    assert_eq!(service.found("").await.1, 3, "a part of it was deleted");
    let seen = json!({ "landmarks": [{ "name": "b" }, { "name": "a", "revision": a["revision"] }] });
    assert_eq!(service.bulk("delete", seen).await, (200, json!({ "count": 2 })));
    assert_eq!(service.found("").await, (vec!["c".to_owned()], 1));
}
