//! Enrolling and revoking take effect at once; other robots go on.

use super::Fleet;
use client::{Capture, ClientError, RobotClient, RobotOptions, v1};
use map::pose2::Pose2;
use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant},
};
use tests::eventually;
use vision::frame::GrayImage;

fn picture() -> Capture {
    Capture::gray(&GrayImage::from_fn(64, 48, |u, _| u as u8))
}

/// Sends frames until one is answered: while the gate opens again they are lost.
async fn answered(robot: &RobotClient) {
    let ask = || async {
        let answer = robot.recognise("front", picture(), Duration::from_millis(500)).await.ok()?;
        (answer.status() == v1::Status::NoMatch).then_some(())
    };
    eventually("an answer", ask).await;
}

/// Connects in vain: the server is there, and takes nothing.
async fn refused(options: &RobotOptions) {
    let error = RobotClient::connect(options).await.err();
    assert!(matches!(error, Some(ClientError::NotAdmitted { .. })), "{error:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_that_is_enrolled_works_and_those_at_work_go_on() {
    let fleet = Fleet::start().await;
    let r1 = RobotClient::connect(&fleet.options("r1")).await.expect("connected");
    answered(&r1).await;
    fleet.add("r3", "cellar").await;
    let r3 = RobotClient::connect(&fleet.options("r3")).await.expect("connected");
    answered(&r3).await;
    answered(&r1).await;
    // Another map is another right, too.
    fleet.inside.maps().put_robot("r3", "hall").await.expect("moved");
    let told = || async { r3.map_version("hall", Duration::from_secs(1)).await.ok().flatten() };
    eventually("the version of the map it drives on now", told).await;
    answered(&r1).await;
    fleet.inside.server.stop().await;
}

/// How often the gate opens again while robots connect.
const REOPENED: usize = 12;
/// Programs that connect again and again meanwhile.
const PROGRAMS: usize = 6;

/// A session that meets the gate as that closes may keep a dead link for ever: the client opens it
/// anew.
#[tokio::test(flavor = "multi_thread")]
async fn a_robot_that_connects_while_the_gate_opens_again_is_admitted() {
    let fleet = Fleet::start().await;
    let options = fleet.options("r1");
    let maps = fleet.inside.maps();
    let done = Arc::new(AtomicBool::new(false));
    let connecting = |options: RobotOptions, done: Arc<AtomicBool>| async move {
        let mut connected = 0;
        while !done.load(Ordering::Relaxed) {
            RobotClient::connect(&options).await?.close().await?;
            connected += 1;
        }
        Ok::<usize, ClientError>(connected)
    };
    let programs: Vec<_> =
        (0..PROGRAMS).map(|_| tokio::spawn(connecting(options.clone(), done.clone()))).collect();
    for i in 0..REOPENED {
        // Another right of another robot; the answer comes once the gate is open again.
        maps.put_robot("r2", if i % 2 == 0 { "hall" } else { "yard" }).await.expect("moved");
        tokio::time::sleep(Duration::from_millis(250 + 37 * i as u64)).await;
    }
    done.store(true, Ordering::Relaxed);
    for program in programs {
        let connected = program.await.expect("no panic").expect("admitted each time");
        assert!(connected > 0);
    }
    let r1 = RobotClient::connect(&options).await.expect("connected");
    answered(&r1).await;
    fleet.inside.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_revoked_certificate_gives_nothing_at_once() {
    let fleet = Fleet::start().await;
    let (r1, r2) = (fleet.options("r1"), fleet.options("r2"));
    let (r1, r2) =
        (RobotClient::connect(&r1).await.expect("r1"), RobotClient::connect(&r2).await.expect("r2"));
    answered(&r1).await;
    answered(&r2).await;
    let maps = fleet.inside.maps();
    let serial = maps.robot_certificates("r1").await.expect("certificates")[0].serial.clone();
    maps.revoke_robot_certificate("r1", &serial).await.expect("revoked");
    let before = fleet.inside.server.slots.counts();
    let answers = r1.answers();
    for _ in 0..20 {
        r1.publish_frame("front", picture()).await.expect("sent");
    }
    answered(&r2).await;
    tokio::time::sleep(Duration::from_millis(300)).await;
    assert!(answers.is_empty(), "an answer to a revoked robot");
    let after = fleet.inside.server.slots.counts();
    assert_eq!(before.missing() + after.missing(), 0, "{after:?}");
    let again = RobotOptions { timeout: Duration::from_secs(3), ..fleet.options("r1") };
    refused(&again).await;
    // A new certificate is another one.
    fleet.enrol("r1", "r1-again");
    let r1 = RobotClient::connect(&fleet.options("r1-again")).await.expect("connected");
    answered(&r1).await;
    let all = maps.robot_certificates("r1").await.expect("certificates");
    assert_eq!(all.iter().map(|c| c.revoked_ms.is_some()).collect::<Vec<_>>(), [true, false]);
    fleet.inside.server.stop().await;
}

/// Messages of the other robot while one is revoked, one each 2 ms.
const MEANWHILE: u64 = 400;

/// Prints how long it took.
#[tokio::test(flavor = "multi_thread")]
async fn the_connection_of_a_revoked_robot_ends_and_another_loses_no_message() {
    let fleet = Fleet::start().await;
    let (r1, r2) = (fleet.options("r1"), fleet.options("r2"));
    let (_r1, r2) =
        (RobotClient::connect(&r1).await.expect("r1"), RobotClient::connect(&r2).await.expect("r2"));
    answered(&r2).await;
    let maps = fleet.inside.maps();
    let serial = maps.robot_certificates("r1").await.expect("certificates")[0].serial.clone();
    let other = tokio::spawn(async move {
        for _ in 0..MEANWHILE {
            r2.publish_odometry(&Pose2::default()).await.expect("sent");
            tokio::time::sleep(Duration::from_millis(2)).await;
        }
        r2
    });
    tokio::time::sleep(Duration::from_millis(100)).await;
    let asked = Instant::now();
    maps.revoke_robot_certificate("r1", &serial).await.expect("revoked");
    let ended = eventually("the connection ends", async || {
        let inputs = maps.robot("r1").await.expect("r1").activity?.inputs;
        let why = inputs.into_iter().find(|i| i.input == "connection")?.reasons.pop()?;
        assert_eq!(why.code, "certificate_ended", "{why:?}");
        Some(asked.elapsed().saturating_sub(Duration::from_millis(why.ago_ms)))
    })
    .await;
    println!("cut off {} ms after the request", ended.as_millis());
    let _r2 = other.await.expect("no panic");
    eventually("all of the other's odometry is used", async || {
        let inputs = maps.robot("r2").await.expect("r2").activity?.inputs;
        let odometry = inputs.into_iter().find(|i| i.input == "odometry")?;
        assert_eq!(odometry.refused, 0, "{odometry:?}");
        (odometry.used == MEANWHILE).then_some(())
    })
    .await;
    fleet.inside.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn one_of_two_certificates_is_revoked_and_the_other_stays() {
    let fleet = Fleet::start().await;
    fleet.enrol("r1", "r1-spare");
    let maps = fleet.inside.maps();
    let serials: Vec<_> =
        maps.robot_certificates("r1").await.expect("certificates").into_iter().map(|c| c.serial).collect();
    maps.revoke_robot_certificate("r1", &serials[0]).await.expect("revoked");
    let spare = RobotClient::connect(&fleet.options("r1-spare")).await.expect("connected");
    answered(&spare).await;
    let first = RobotOptions { timeout: Duration::from_secs(3), ..fleet.options("r1") };
    refused(&first).await;
    // A robot that is removed takes its certificates with it, also where its name is given again.
    maps.delete_robot("r1").await.expect("removed");
    maps.put_robot("r1", "hall").await.expect("another robot");
    let ghost = RobotOptions { timeout: Duration::from_secs(3), ..fleet.options("r1-spare") };
    refused(&ghost).await;
    fleet.inside.server.stop().await;
}
