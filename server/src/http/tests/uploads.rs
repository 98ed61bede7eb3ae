//! Places for large bodies: slow ones of one token hold half of them, and those of others are read
//! at once.

use super::{
    authorisation::{token, with_token},
    *,
};
use axum::body::Bytes;
use protos::api::Role;
use std::{convert::Infallible, time::Instant};

/// A body that does not come to its end.
fn endless() -> Body {
    Body::from_stream(futures::stream::pending::<Result<Bytes, Infallible>>())
}

#[tokio::test(flavor = "multi_thread")]
async fn slow_bodies_of_one_token_leave_places_to_the_uploads_of_others() {
    let limits = Limits { uploads: 4, upload_wait_s: 5, request_timeout_s: 20, ..Limits::default() };
    let service = Service::start(limits).await;
    let slow = token(&service, Role::Admin, None, None).await;
    let other = token(&service, Role::Admin, None, None).await;
    let mut held = tokio::task::JoinSet::new();
    for _ in 0..40 {
        let slow = with_token(request("POST", "/api/v1/maps", endless()), &slow);
        held.spawn(service.ask_as_it_is(slow));
    }
    // Those that got no place are refused, so that all places of the token are held by now.
    for _ in 0..38 {
        let refused = held.join_next().await.unwrap().unwrap();
        let (status, problem) = read(refused).await;
        assert_eq!((status, &problem["code"]), (503, &"too_many_uploads".into()));
        assert!(problem["detail"].as_str().unwrap().contains("of one token"), "{problem}");
    }
    let began = Instant::now();
    for name in ["one", "two", "three"] {
        let body = format!("{{\"name\": \"{name}\"{}}}", " ".repeat(65 << 10));
        let made = service.ask_as_it_is(with_token(request("POST", "/api/v1/maps", body), &other)).await;
        assert_eq!(made.status(), StatusCode::CREATED, "{name}");
    }
    assert!(began.elapsed() < Duration::from_secs(4), "it waited {:?}", began.elapsed());
    let body = format!("{{\"name\": \"four\"{}}}", " ".repeat(65 << 10));
    let refused = service.ask_as_it_is(with_token(request("POST", "/api/v1/maps", body), &slow)).await;
    assert_eq!(refused.status(), StatusCode::SERVICE_UNAVAILABLE, "its own places are in use");
    held.abort_all();
}
