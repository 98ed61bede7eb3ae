//! Claim: of two editors of the same thing the second is told that somebody was faster, and
//! overwrites nothing: by the SDK, and by the command line where it reads before it changes.

use client::{
    ClientError, MapClient,
    api::{FusionModeBody, LandmarkPatch, MapPatch, ModalityMapPatch, NewMap, Size, WallsBody},
    http::operations,
};
use reqwest::Method;
use server::config::Limits;
use std::{fs, net::SocketAddr, time::Duration};
use tempfile::TempDir;
use tests::{Inside, command::waymark, pictures::picture, robots::call};
use tokio::{
    io::{AsyncReadExt, AsyncWriteExt},
    net::{TcpListener, TcpStream},
};

/// Whether it was refused because somebody was faster.
fn told(result: Result<impl std::fmt::Debug, ClientError>) -> bool {
    match result {
        Err(ClientError::Refused { status: 412, code, .. }) => code == "changed_meanwhile",
        other => panic!("{other:?}"),
    }
}

fn walls(length_m: f64) -> WallsBody {
    [[[0.0, 0.0], [length_m, 0.0]]].into_iter().collect()
}

fn sized(width_m: f64) -> LandmarkPatch {
    LandmarkPatch { size: Some(Some(Size { width_m, height_m: 1.0 })), ..LandmarkPatch::default() }
}

async fn hall(inside: &Inside) -> MapClient {
    let maps = inside.maps();
    maps.create_map(&NewMap::new("hall")).await.expect("map");
    maps.add_landmark("hall", "poster", None, None).await.expect("landmark");
    maps
}

#[tokio::test(flavor = "multi_thread")]
async fn the_second_editor_is_told_by_the_sdk() {
    let inside = Inside::start(Limits::default()).await;
    let maps = hall(&inside).await;

    let seen = maps.landmark("hall", "poster").await.expect("landmark");
    maps.if_match(&seen.revision).update_landmark("hall", "poster", &sized(1.0)).await.expect("the first");
    assert!(told(maps.if_match(&seen.revision).update_landmark("hall", "poster", &sized(2.0)).await));
    assert!(told(maps.if_match(&seen.revision).delete_landmark("hall", "poster").await));
    let kept = maps.landmark("hall", "poster").await.expect("landmark");
    assert_eq!(kept.size.map(|size| size.width_m), Some(1.0));

    let seen = maps.walls_revised("hall").await.expect("walls").revision;
    maps.set_walls("hall", &walls(4.0)).await.expect("whatever is there");
    assert!(told(maps.if_match(&seen).set_walls("hall", &walls(5.0)).await));
    assert_eq!(maps.walls("hall").await.expect("walls"), walls(4.0));

    let settings = maps.visibility_settings_revised("hall").await.expect("settings");
    let mut higher = settings.value;
    higher.camera_height_m = Some(2.0);
    maps.if_match(&settings.revision).set_visibility_settings("hall", &higher).await.expect("the first");
    assert!(told(maps.if_match(&settings.revision).set_visibility_settings("hall", &settings.value).await));

    let seen = maps.modalities_revised("hall").await.expect("modalities").revision;
    let best = ModalityMapPatch { fusion_mode: Some(FusionModeBody::Best), areas: None };
    maps.if_match(&seen).set_modalities("hall", &best).await.expect("the first");
    assert!(told(maps.if_match(&seen).set_modalities("hall", &best).await));

    let place = client::api::UnderlayPlace { metres_per_pixel: 0.05, x_m: 0.0, y_m: 0.0, theta_rad: 0.0 };
    maps.set_underlay("hall", picture(1), &place).await.expect("underlay");
    let seen = maps.underlay_revised("hall").await.expect("underlay").revision;
    maps.if_match(&seen).set_underlay("hall", picture(2), &place).await.expect("the first");
    assert!(told(maps.if_match(&seen).delete_underlay("hall").await));

    let seen = maps.map("hall").await.expect("map").revision;
    maps.add_landmark("hall", "another", None, None).await.expect("landmark");
    let words = MapPatch { site: Some(Some("Works".into())), ..MapPatch::default() };
    assert!(told(maps.if_match(&seen).locate_map("hall", &words).await));
    assert!(told(maps.if_match(&seen).delete_map("hall").await), "deleted with a landmark that nobody saw");
    maps.delete_map("hall").await.expect("whatever is there");
    inside.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_client_asks_for_a_revision_where_the_document_does() {
    let inside = Inside::start(Limits::default()).await;
    let (_, document) = call(&inside, Method::GET, "/openapi.json", None).await;
    for operation in operations() {
        let method = operation.method.as_str().to_lowercase();
        let parameters = &document["paths"][format!("/api/v1{}", operation.path)][method]["parameters"];
        let asks = parameters
            .as_array()
            .into_iter()
            .flatten()
            .any(|p| p["$ref"] == "#/components/parameters/header.If-Match");
        assert_eq!(operation.takes_revision(), asks, "{} {}", operation.method, operation.path);
    }
    inside.server.stop().await;
}

/// A relay to the server: before it passes on the first request that begins with `word`, it sends
/// this change itself.
async fn relay(server: SocketAddr, word: &'static str, maps: MapClient, change: LandmarkPatch) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
    let at = listener.local_addr().expect("its address");
    tokio::spawn(async move {
        let mut change = Some(change);
        while let Ok((client, _)) = listener.accept().await {
            let upstream = TcpStream::connect(server).await.expect("the server");
            let (mut from, mut to) = client.into_split();
            let (mut back, mut forth) = upstream.into_split();
            tokio::spawn(async move { tokio::io::copy(&mut back, &mut to).await });
            let mut part = vec![0; 1 << 16];
            while let Ok(read @ 1..) = from.read(&mut part).await {
                if part[..read].starts_with(word.as_bytes())
                    && let Some(change) = change.take()
                {
                    maps.update_landmark("hall", "poster", &change).await.expect("somebody was faster");
                    maps.set_walls("hall", &walls(1.0)).await.expect("somebody was faster");
                }
                forth.write_all(&part[..read]).await.expect("sent");
            }
        }
    });
    format!("http://{at}")
}

#[tokio::test(flavor = "multi_thread")]
async fn the_command_line_changes_only_what_it_has_shown() {
    let inside = Inside::start(Limits::default()).await;
    let maps = hall(&inside).await;
    maps.set_walls("hall", &walls(4.0)).await.expect("walls");
    let folder = TempDir::new().expect("a temporary directory");
    let file = folder.path().join("walls.txt");
    fs::write(&file, "0, 0, 9, 0\n").expect("a file");
    let file = file.to_str().expect("text");
    // The local token is for the server's own port.
    let token = tests::token(&inside.url()).await;
    for (word, line) in [
        ("DELETE ", "landmark delete poster --map hall --yes"),
        ("PATCH ", "landmark size poster 0.6x0.8 --map hall"),
        ("PATCH ", "landmark place poster --map hall --xy 1,2 --facing 0 --height 1.5"),
        ("DELETE ", "map delete hall --yes"),
        ("PUT ", &format!("map import hall {file} --yes")),
    ] {
        let server = relay(inside.server.http_addr, word, inside.maps(), sized(3.0)).await;
        let args = line.split(' ').chain(["--server", &server, "--token", &token]);
        let args: Vec<String> = args.map(str::to_owned).collect();
        let run = tokio::task::spawn_blocking(move || waymark(args, Duration::from_mins(1)));
        let run = run.await.expect("it ends");
        assert_eq!(run.status, 4, "`{line}`: {run:?}");
        assert!(run.stderr.contains("somebody else has changed it"), "`{line}`: {run:?}");
        assert!(run.stderr.contains("repeat the command"), "`{line}`: {run:?}");
        let poster = maps.landmark("hall", "poster").await.expect("it is still there");
        assert_eq!((poster.size.map(|size| size.width_m), poster.place), (Some(3.0), None), "`{line}`");
        assert_eq!(maps.walls("hall").await.expect("walls"), walls(1.0), "`{line}`");
    }
    inside.server.stop().await;
}
