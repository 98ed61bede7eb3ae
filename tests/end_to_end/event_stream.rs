//! Claim: whoever follows the server's events misses none when the connection is lost, and is told
//! when its token ends.

use client::{
    ClientError, MapClient,
    api::{EventQuery, NewMap, NewToken, Role, ServerEventBody},
};
use server::config::Limits;
use std::{net::SocketAddr, sync::Arc};
use tests::{Inside, SOON, robots::connect};
use tokio::{
    io::copy_bidirectional,
    net::{TcpListener, TcpStream},
    sync::Notify,
};

/// A relay to the server that cuts every connection at each notification.
async fn relay(server: SocketAddr) -> (SocketAddr, Arc<Notify>) {
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
    let (at, cut) = (listener.local_addr().expect("its address"), Arc::new(Notify::new()));
    let notified = cut.clone();
    tokio::spawn(async move {
        while let Ok((mut client, _)) = listener.accept().await {
            let notified = notified.clone();
            tokio::spawn(async move {
                let mut upstream = TcpStream::connect(server).await.expect("the server");
                tokio::select! {
                    () = notified.notified() => {}
                    _ = copy_bidirectional(&mut client, &mut upstream) => {}
                }
            });
        }
    });
    (at, cut)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_that_joins_late_has_the_present_version_of_a_map_at_once() {
    let inside = Inside::start(Limits::default()).await;
    let maps = inside.maps();
    maps.create_map(&NewMap::new("hall")).await.expect("map");
    maps.add_landmark("hall", "door", None, None).await.expect("landmark");
    let present = maps.map("hall").await.expect("map").version;
    maps.put_robot("r1", "hall").await.expect("robot");
    let robot = connect(&inside.server.zenoh_endpoint, "r1").await;
    let mut versions = robot.map_versions("hall", SOON).await.expect("versions");
    let mut next = async || tokio::time::timeout(SOON, versions.next()).await.expect("in time");
    assert_eq!(next().await, Some(present));
    maps.add_landmark("hall", "sign", None, None).await.expect("landmark");
    assert_eq!(next().await, Some(present + 1));
    robot.close().await.expect("closed");
    inside.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn events_go_on_after_a_lost_connection_and_end_with_the_token() {
    let inside = Inside::start(Limits::default()).await;
    let maps = inside.maps();
    let new = NewToken { name: "watcher".into(), role: Role::Viewer, maps: None, valid_s: None };
    let token = maps.create_token(&new).await.expect("a token");
    let (at, cut) = relay(inside.server.http_addr).await;
    let watcher = MapClient::new(&format!("http://{at}")).expect("a client").with_token(&token.text);
    let mut events = watcher.events(&EventQuery::default()).await.expect("events");
    let mut next =
        async || tokio::time::timeout(SOON, events.next()).await.expect("in time").map(|event| event.what);
    maps.create_map(&NewMap::new("hall")).await.expect("map");
    let changed = |version| ServerEventBody::MapChanged { map: "hall".into(), version };
    assert_eq!(next().await.expect("an event"), changed(Some(1)));
    cut.notify_waiters();
    maps.add_landmark("hall", "door", None, None).await.expect("landmark");
    assert_eq!(next().await.expect("an event"), changed(Some(2)));
    let landmark = next().await.expect("an event");
    assert!(
        matches!(&landmark, ServerEventBody::LandmarkChanged { landmark, .. } if landmark == "door"),
        "{landmark:?}"
    );
    maps.put_robot("r1", "hall").await.expect("robot");
    let robot = connect(&inside.server.zenoh_endpoint, "r1").await;
    let presence =
        |present| ServerEventBody::Presence { map: Some("hall".into()), robot: "r1".into(), present };
    assert_eq!(next().await.expect("an event"), presence(true));
    robot.close().await.expect("closed");
    assert_eq!(next().await.expect("an event"), presence(false));
    maps.revoke_token(token.token.id).await.expect("revoked");
    match next().await {
        Err(ClientError::Refused { status: 401, .. }) => {}
        other => panic!("{other:?}"),
    }
    inside.server.stop().await;
}
