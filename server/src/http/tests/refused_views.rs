//! Photographs that were not taken for a landmark: kept with the reason, shown, bounded.

use super::{teaching::blocks, *};
use crate::store::{StoreError, db, refused_views::MAX_REFUSED};
use engine::picture;
use serde_json::json;

const WHOLE: (&str, &str) = ("whole_image", "true");
const LIST: &str = "/api/v1/maps/hall/landmarks/sign/refused-views";

impl Service {
    /// Reasons, newest first.
    async fn reasons(&self) -> Vec<String> {
        let (status, page) = self.get(LIST).await;
        assert_eq!(status, 200, "{page}");
        page["items"].as_array().unwrap().iter().map(|v| v["reason"].as_str().unwrap().to_owned()).collect()
    }
}

#[tokio::test]
async fn a_refused_photograph_is_shown_with_its_reason_and_the_oldest_go() {
    let service = Service::start(Limits::default()).await;
    let blank = picture::png(300, 200, &vec![90; 60_000]).unwrap();
    assert_eq!(
        service.upload("sign", blank.clone(), &[("create", "true")]).await.1["code"],
        "quad_not_found"
    );
    assert_eq!(service.get(LIST).await.1["code"], "unknown_landmark", "there is nothing to keep it at");
    assert_eq!(service.upload("sign", blocks(1), &[("create", "true"), WHOLE]).await.0, 201);
    assert!(service.reasons().await.is_empty());
    let entries = async || service.get("/api/v1/audit").await.1["total"].clone();
    let before = entries().await;
    assert_eq!(service.upload("sign", blank, &[]).await.0, 422);
    assert_eq!(service.upload("sign", b"no picture".to_vec(), &[WHOLE]).await.0, 422);
    assert_eq!(service.upload("sign", blocks(1), &[WHOLE]).await.1["outcome"], "duplicate");
    // The same picture but for one pixel.
    let mut grey: Vec<u8> = image::load_from_memory(&blocks(1)).unwrap().into_luma8().into_raw();
    grey[0] ^= 1;
    let nearly = picture::png(240, 240, &grey).unwrap();
    assert_eq!(service.upload("sign", nearly, &[WHOLE]).await.1["outcome"], "near_duplicate");
    // What says nothing of the photograph is not kept.
    assert_eq!(service.upload("sign", blocks(2), &[WHOLE, ("corners", "[]")]).await.0, 422);
    assert_eq!(service.reasons().await, ["near_duplicate", "duplicate", "wrong_encoding", "quad_not_found"]);
    assert_eq!(entries().await, before, "a refusal is no change");

    let (_, page) = service.get(LIST).await;
    let items = page["items"].as_array().unwrap();
    assert_eq!((&items[0]["view"], &items[0]["by"]), (&json!(1), &json!("upload")));
    assert!(items[0]["sentence"].as_str().unwrap().contains("photograph 1"), "{page}");
    assert_eq!(items[2]["icon"], Value::Null, "it could not be decoded");
    for (item, size) in [(0, (75, 75)), (3, (75, 50))] {
        let path = items[item]["icon"].as_str().unwrap();
        let answer = service.ask(request("GET", path, "")).await;
        assert_eq!(answer.status(), StatusCode::OK, "{path}");
        let small = image::load_from_memory(&to_bytes(answer.into_body(), 1 << 20).await.unwrap()).unwrap();
        assert_eq!((small.width(), small.height()), size, "{path}");
    }
    let missing = service.get(&format!("{LIST}/{}/icon", items[2]["id"])).await;
    assert_eq!((missing.0, &missing.1["code"]), (404, &json!("unknown_view")));

    for _ in 0..MAX_REFUSED {
        service.upload("sign", b"no picture".to_vec(), &[WHOLE]).await;
    }
    let reasons = service.reasons().await;
    assert_eq!((reasons.len(), reasons.iter().all(|r| r == "wrong_encoding")), (MAX_REFUSED, true));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_photograph_that_a_lesson_cannot_read_is_shown_until_the_next_one_can() {
    let service = Service::start(Limits::default()).await;
    assert_eq!(service.upload("sign", blocks(1), &[("create", "true"), WHOLE]).await.0, 201);
    let write = service.store.write(|tx| {
        Box::pin(async move {
            let sql = "UPDATE pictures SET bytes = x'00'";
            db::raw_sql(sql).execute(tx.conn()).await.map(drop).map_err(StoreError::during("damage"))
        })
    });
    write.await.unwrap();
    service.learn("sign").await;
    assert_eq!(service.reasons().await, ["picture_unreadable"]);
    let (_, page) = service.get(LIST).await;
    let item = &page["items"][0];
    assert_eq!((&item["by"], &item["view"]), (&json!("lesson"), &json!(1)));
    assert_eq!(item["icon"], "/api/v1/maps/hall/landmarks/sign/views/1/icon");
    // The same photograph once more mends it.
    assert_eq!(service.upload("sign", blocks(1), &[WHOLE]).await.1["outcome"], "duplicate");
    service.learn("sign").await;
    assert_eq!(service.reasons().await, ["duplicate"]);
}
