//! Claim: a map keeps the picture that is shown under it, replaced or deleted on request, and with
//! the map.

use client::{
    ClientError, MapClient,
    api::{NewMap, UnderlayPlace},
};
use server::config::Limits;
use tests::{Inside, pictures::picture};

fn code(result: Result<impl std::fmt::Debug, ClientError>) -> String {
    match result {
        Err(ClientError::Refused { code, .. }) => code,
        other => panic!("not refused: {other:?}"),
    }
}

async fn hall(maps: &MapClient) {
    maps.create_map(&NewMap::new("hall")).await.expect("map");
}

#[tokio::test(flavor = "multi_thread")]
async fn the_picture_under_a_map_is_kept_with_it() {
    let inside = Inside::start(Limits::default()).await;
    let maps = inside.maps();
    hall(&maps).await;
    assert_eq!(code(maps.underlay("hall").await), "unknown_underlay");
    assert!(!maps.maps().await.expect("maps")[0].has_underlay);
    let place = UnderlayPlace { metres_per_pixel: 0.05, x_m: -1.5, y_m: 2.0, theta_rad: 0.1 };
    let set = maps.set_underlay("hall", picture(1), &place).await.expect("underlay");
    assert!(maps.map("hall").await.expect("map").has_underlay);
    assert_eq!((set.place, set.width_px, set.height_px), (place, 160, 120));
    assert_eq!(maps.underlay("hall").await.expect("underlay"), set);
    assert_eq!(maps.underlay_image("hall").await.expect("image"), picture(1));
    let flat = UnderlayPlace { metres_per_pixel: 0.0, ..place };
    assert_eq!(code(maps.set_underlay("hall", picture(2), &flat).await), "out_of_range");
    assert_eq!(code(maps.set_underlay("hall", vec![1, 2, 3], &place).await), "wrong_encoding");
    assert_eq!(code(maps.set_underlay("nowhere", picture(2), &place).await), "unknown_map");
    assert_eq!(
        maps.underlay_image("hall").await.expect("image"),
        picture(1),
        "what is refused changes nothing"
    );
    maps.delete_underlay("hall").await.expect("deleted");
    assert_eq!(code(maps.delete_underlay("hall").await), "unknown_underlay");
    // It goes with its map.
    maps.set_underlay("hall", picture(1), &place).await.expect("underlay");
    maps.delete_map("hall").await.expect("deleted");
    hall(&maps).await;
    assert_eq!(code(maps.underlay_image("hall").await), "unknown_underlay");
    inside.server.stop().await;
}
