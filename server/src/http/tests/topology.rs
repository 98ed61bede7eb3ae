//! Places and passages of a site, routes, and who sees which of its maps.

use super::{
    authorisation::{token, with_token},
    teaching::blocks,
    *,
};
use protos::api::{Role, SiteTopologyBody};
use serde_json::json;

const PATH: &str = "/api/v1/sites/Works%201/topology";

impl Service {
    async fn done(&self, method: &str, path: &str, body: Value) {
        let (status, answer) =
            read(self.ask(request(method, &format!("/api/v1{path}"), body.to_string())).await).await;
        assert!((200..300).contains(&status), "{path}: {answer}");
    }

    async fn topology(&self, query: &str) -> SiteTopologyBody {
        let (status, body) = self.get(&format!("{PATH}{query}")).await;
        assert_eq!(status, 200, "{query}: {body}");
        serde_json::from_value(body).unwrap()
    }
}

fn wall([ax, ay, bx, by]: [f64; 4]) -> Value {
    json!({ "a": [ax, ay], "b": [bx, by] })
}

/// Map `hall` of the site `Works 1`: a corridor of 12 x 2 m with two rooms above it, each with a
/// door of 0.9 m; the poster `sign`, learnt, on the lower wall of the corridor.
async fn corridor() -> Service {
    let service = Service::start(Limits::default()).await;
    let walls = [
        [0.0, 0.0, 12.0, 0.0],
        [12.0, 0.0, 12.0, 6.0],
        [12.0, 6.0, 0.0, 6.0],
        [0.0, 6.0, 0.0, 0.0],
        [0.0, 2.0, 2.55, 2.0],
        [3.45, 2.0, 8.55, 2.0],
        [9.45, 2.0, 12.0, 2.0],
        [6.0, 2.0, 6.0, 6.0],
    ];
    service.done("PUT", "/maps/hall/walls", json!({ "segments": walls.map(wall) })).await;
    service.done("PATCH", "/maps/hall", json!({ "site": "Works 1" })).await;
    let parts = [("create", "true"), ("whole_image", "true"), ("width_m", "0.6"), ("height_m", "0.6")];
    assert_eq!(service.upload("sign", blocks(1), &parts).await.0, 201);
    service.learn("sign").await;
    let place = json!({ "x_m": 6.0, "y_m": 0.001, "z_m": 1.4, "theta_rad": std::f64::consts::FRAC_PI_2 });
    service.done("PATCH", "/maps/hall/landmarks/sign", json!({ "place": place })).await;
    service
}

#[tokio::test(flavor = "multi_thread")]
async fn a_site_has_places_and_passages_and_a_route_names_the_landmark_to_look_for() {
    let service = corridor().await;
    let site = service.topology("").await;
    let places: Vec<&str> = site.places.iter().map(|place| place.place.as_str()).collect();
    assert_eq!(places, ["hall/1", "hall/2", "hall/3"]);
    assert_eq!((site.passages.len(), site.maps[0].map.as_str(), site.route), (2, "hall", None));
    let corridor = &site.places[0];
    assert!(corridor.landmarks[0].landmark == "sign" && corridor.landmarks[0].share > 0.1, "{corridor:?}");
    let door = &site.passages[0];
    assert!((door.ends[0].x_m - 3.0).abs() < 0.15 && door.width_m.unwrap() < 1.0, "{door:?}");

    let route = service.topology("?from=hall/1,5&to=hall/3").await.route.unwrap();
    let legs: Vec<_> = route.legs.iter().map(|leg| (leg.place.as_str(), leg.passage)).collect();
    assert_eq!(legs, [("hall/2", Some(0)), ("hall/1", Some(1)), ("hall/3", None)]);
    let next = route.legs[1].next_landmark.as_ref().unwrap();
    let bearing = (0.001 - next.y_m).atan2(6.0 - next.x_m);
    assert!(next.landmark == "sign" && (next.theta_rad + next.pan_rad - bearing).abs() < 1e-6, "{next:?}");
    assert!((route.length_m - route.legs.iter().map(|leg| leg.length_m).sum::<f64>()).abs() < 1e-9);

    for (query, status, code, field) in [
        ("?from=hall/1", 422, "missing", "to"),
        ("?to=hall/1", 422, "missing", "from"),
        ("?from=hall&to=hall/1", 422, "invalid_value", "from"),
        ("?from=hall/1&to=hall/0", 422, "invalid_value", "to"),
        ("?from=hall/1&to=hall/1,inf", 422, "invalid_value", "to"),
        ("?from=hall/4&to=hall/1", 404, "unknown_place", "from"),
        ("?from=hall/1&to=hall/60,1", 404, "unknown_place", "to"),
        ("?from=hall/1&to=yard/1", 404, "unknown_place", "to"),
        ("?form=hall/1", 400, "bad_query", "query"),
    ] {
        let (found, problem) = service.get(&format!("{PATH}{query}")).await;
        assert_eq!(
            (found, &problem["code"], &problem["field"]),
            (status, &json!(code), &json!(field)),
            "{query}"
        );
    }
    // Beyond a wall without doors nothing is seen.
    let shut = json!({ "segments": [wall([0.0, 2.0, 12.0, 2.0]), wall([0.0, 4.0, 12.0, 4.0])] });
    service.done("PUT", "/maps/hall/walls", shut).await;
    let halves = service.topology("").await;
    assert_eq!((halves.places.len(), halves.passages.len()), (1, 0), "only what is seen from the floor");
    service.done("PUT", "/maps/hall/walls", json!({ "segments": [wall([0.0, 0.0, 200.0, 200.0])] })).await;
    let (status, problem) = service.get(PATH).await;
    assert_eq!((status, &problem["code"], &problem["field"]), (409, &json!("too_many"), &json!("site")));
}

#[tokio::test(flavor = "multi_thread")]
async fn linked_maps_are_joined_and_those_of_others_left_out() {
    let service = corridor().await;
    service.done("POST", "/maps/hall/copies", json!({ "name": "annex" })).await;
    assert_eq!(service.topology("").await.places.len(), 6);
    let (status, problem) = service.get(&format!("{PATH}?from=hall/1&to=annex/1")).await;
    assert_eq!((status, &problem["code"]), (409, &json!("no_route")), "{problem}");
    let parent = json!({ "map": "hall", "x_m": 0, "y_m": 0, "theta_rad": 0, "level_m": 3.0 });
    service.done("PATCH", "/maps/annex", json!({ "parent": parent })).await;
    let route = service.topology("?from=hall/2&to=annex/3").await.route.unwrap();
    assert!(
        route.length_m > 3.0 && route.legs.iter().any(|leg| leg.place.starts_with("annex/")),
        "{route:?}"
    );
    let viewer = token(&service, Role::Viewer, Some("hall"), None).await;
    let ask = async |query: &str| {
        let request = with_token(request("GET", &format!("{PATH}{query}"), ""), &viewer);
        read(service.ask_as_it_is(request).await).await
    };
    let (status, body) = ask("").await;
    assert!(status == 200 && !body.to_string().contains("annex"), "{body}");
    assert_eq!(ask("?from=hall/1&to=annex/1").await.0, 404);
    // A site without maps is an empty list, and a draft is none of its maps.
    service.done("POST", "/maps/hall/drafts", json!({ "name": "hall-draft" })).await;
    assert_eq!(service.topology("").await.maps.len(), 2);
    let (status, nowhere) = service.get("/api/v1/sites/nowhere/topology").await;
    assert_eq!((status, &nowhere["places"]), (200, &json!([])), "{nowhere}");
}
