//! Claim: under load and under overload every frame that arrives ends in exactly one way, no work
//! begins on a frame beyond its deadline, at most one frame of a camera waits, a robot that sends
//! too much takes nothing from the others, and the server answers as before once the load ends.
//! Speed is measured by `waymark-lab bench load`, not here.

use client::{
    Capture, Delivery, RobotClient, RobotOptions,
    api::{NewMap, Size},
    v1::{self, Status},
};
use engine::slots::{FrameCounts, MAX_CAMERAS_PER_ROBOT};
use server::config::Limits;
use std::{
    collections::BTreeMap,
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant},
};
use tests::{Inside, SOON, eventually, pictures, robots};
use vision::frame::GrayImage;

const MAP: &str = "hall";
/// Frames of quiet robots.
const QUIET_EVERY: Duration = Duration::from_secs(1);
/// How long the load lasts.
const LOAD: Duration = Duration::from_secs(10);
/// Deadline of frames in overload.
const DEADLINE_MS: u32 = 5_000;

/// A picture with edges, encoded once.
fn jpeg() -> Vec<u8> {
    let blocks = pictures::blocks(7, 320, 240);
    robots::jpeg(&GrayImage::from_fn(320, 240, |u, v| blocks[v * 320 + u]))
}

/// Answers of a robot by status, and the greatest age of a frame when the work on it began, ms.
#[derive(Debug, Default)]
struct Answered {
    by_status: BTreeMap<Status, u64>,
    oldest_begun_ms: f64,
}

impl Answered {
    fn processed(&self) -> u64 {
        let ended = |status| self.by_status.get(&status).copied().unwrap_or(0);
        self.by_status.values().sum::<u64>() - ended(Status::Rejected) - ended(Status::Expired)
    }
}

fn listen(client: &RobotClient) -> Arc<Mutex<Answered>> {
    let (answered, mut answers) = (Arc::<Mutex<Answered>>::default(), client.answers());
    let noted = answered.clone();
    tokio::spawn(async move {
        loop {
            match answers.recv().await {
                Ok(received) => note(&mut noted.lock().expect("whole"), &received.answer),
                Err(tokio::sync::broadcast::error::RecvError::Lagged(_)) => {}
                Err(tokio::sync::broadcast::error::RecvError::Closed) => return,
            }
        }
    });
    answered
}

fn note(answered: &mut Answered, answer: &v1::Answer) {
    *answered.by_status.entry(answer.status()).or_default() += 1;
    let work_ms: f64 = answer.timings.iter().map(|stage| stage.ms).sum();
    if !matches!(answer.status(), Status::Rejected | Status::Expired) {
        answered.oldest_begun_ms = answered.oldest_begun_ms.max(answer.latency_ms - work_ms);
    }
}

async fn robot(inside: &Inside, name: &str) -> RobotClient {
    inside.maps().put_robot(name, MAP).await.expect("a robot");
    let options = RobotOptions {
        delivery: Delivery::Every,
        ..RobotOptions::new(&inside.server.zenoh_endpoint, "default", name)
    };
    RobotClient::connect(&options).await.expect("connected")
}

/// Sends a frame at each intended time, whatever became of those before; how many.
async fn send(client: &RobotClient, frame: &[u8], until: Instant) -> u64 {
    let (mut at, mut sent) = (Instant::now(), 0);
    while at < until {
        tokio::time::sleep_until(at.into()).await;
        let capture = Capture::encoded(frame.to_vec()).expect("a picture").with_deadline_ms(DEADLINE_MS);
        client.publish_frame("front", capture).await.expect("sent");
        sent += 1;
        at += QUIET_EVERY;
    }
    sent
}

/// Waits until nothing waits or is in work.
async fn settled(inside: &Inside) -> FrameCounts {
    eventually("every frame has ended", || async {
        let counts = inside.server.slots.counts();
        (counts.waiting == 0 && counts.in_work == 0).then_some(counts)
    })
    .await
}

#[tokio::test(flavor = "multi_thread")]
async fn every_frame_of_a_moderate_load_is_answered_while_the_server_learns() {
    let inside = Inside::start(Limits::default()).await;
    let maps = inside.maps();
    maps.create_map(&NewMap::new(MAP)).await.expect("a map");
    for i in 0..4 {
        let (name, size) = (format!("l{i}"), Size { width_m: 0.6, height_m: 0.8 });
        maps.add_landmark(MAP, &name, Some(size), None).await.expect("a landmark");
        let view = pictures::picture(i);
        maps.upload_view(MAP, &name, view, client::LandmarkRegion::WholeImage).await.expect("a view");
    }
    let (frame, mut sending) = (jpeg(), Vec::new());
    let until = Instant::now() + LOAD;
    for i in 0..4 {
        let (client, frame) = (robot(&inside, &format!("r{i}")).await, frame.clone());
        let answered = listen(&client);
        sending.push(tokio::spawn(async move {
            let sent = send(&client, &frame, until).await;
            (client, answered, sent)
        }));
    }
    let mut lessons = 0;
    while Instant::now() < until {
        let job = maps.learn(MAP, None, None).await.expect("a lesson");
        maps.wait_for_job(job, SOON, |_| ()).await.expect("the lesson ends");
        lessons += 1;
    }
    assert!(lessons > 0);
    let (mut sent, mut all) = (0, Vec::new());
    for one in sending {
        let (client, answered, count) = one.await.expect("sent");
        sent += count;
        all.push((client, answered));
    }
    let counts = settled(&inside).await;
    assert_eq!((counts.received, counts.missing()), (sent, 0), "{counts:?}");
    assert_eq!(counts.rejected_total(), 0, "{counts:?}");
    // Of a camera that sends once a second, a busy machine supersedes few.
    assert!(10 * counts.processed >= 7 * sent, "{counts:?}");
    eventually("every answer has arrived", || async {
        let arrived: u64 = all.iter().map(|(_, a)| a.lock().expect("whole").processed()).sum();
        (arrived == counts.processed).then_some(())
    })
    .await;
    inside.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn overload_by_one_robot_takes_nothing_from_the_others_and_ends_with_it() {
    let inside = Inside::start(Limits::default()).await;
    inside.maps().create_map(&NewMap::new(MAP)).await.expect("a map");
    let (greedy, frame) = (Arc::new(robot(&inside, "greedy").await), jpeg());
    let heard = listen(&greedy);
    let stop = Arc::new(AtomicBool::new(false));
    // All cameras, as fast as the link takes them.
    let flood: Vec<_> = (0..MAX_CAMERAS_PER_ROBOT)
        .map(|camera| {
            let (greedy, frame, stop) = (greedy.clone(), frame.clone(), stop.clone());
            tokio::spawn(async move {
                let mut sent = 0_u64;
                while !stop.load(Ordering::Relaxed) {
                    let capture = Capture::encoded(frame.clone()).expect("a picture");
                    let capture = capture.with_deadline_ms(DEADLINE_MS);
                    greedy.publish_frame(&format!("c{camera}"), capture).await.expect("sent");
                    sent += 1;
                    tokio::time::sleep(Duration::from_millis(5)).await;
                }
                sent
            })
        })
        .collect();
    let until = Instant::now() + LOAD;
    let mut sending = Vec::new();
    for i in 0..4 {
        let (client, frame) = (robot(&inside, &format!("quiet-{i}")).await, frame.clone());
        let answered = listen(&client);
        sending.push(tokio::spawn(async move { (send(&client, &frame, until).await, client, answered) }));
    }
    let cameras = (MAX_CAMERAS_PER_ROBOT + 4) as u64;
    let one_each = (cameras as usize) * 2 * (frame.len() + 1_000);
    while Instant::now() < until {
        let (counts, held) = (inside.server.slots.counts(), inside.server.slots.held_bytes());
        assert_eq!(counts.missing(), 0, "{counts:?}");
        assert!(counts.waiting <= cameras, "more than one frame of a camera waits: {counts:?}");
        assert!(held <= one_each, "{held} bytes wait or are in work");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    stop.store(true, Ordering::Relaxed);
    let mut sent = 0;
    for one in flood {
        sent += one.await.expect("sent");
    }
    let mut quiet = Vec::new();
    for one in sending {
        let (count, client, answered) = one.await.expect("sent");
        sent += count;
        quiet.push((count, client, answered));
    }
    let counts = settled(&inside).await;
    assert_eq!((counts.received, counts.missing()), (sent, 0), "{counts:?}");
    assert!(counts.superseded > counts.processed, "that was no overload: {counts:?}");
    // The fair share of a robot is a fifth of the work, or all that it sends.
    for (count, _, answered) in &quiet {
        let fair = (*count).min(counts.processed / 5);
        eventually("its share", || async {
            let processed = answered.lock().expect("whole").processed();
            (10 * processed >= 9 * fair).then_some(())
        })
        .await;
    }
    let oldest = |a: &Arc<Mutex<Answered>>| a.lock().expect("whole").oldest_begun_ms;
    let oldest_ms = quiet.iter().map(|(_, _, a)| oldest(a)).fold(oldest(&heard), f64::max);
    // The deadline, and the time that a thread may stand between two clocks.
    assert!(oldest_ms <= f64::from(DEADLINE_MS) + 2_000.0, "work began on a frame of {oldest_ms} ms");
    // As if nothing had been.
    for (_, client, _) in &quiet {
        let capture = Capture::encoded(frame.clone()).expect("a picture").with_deadline_ms(60_000);
        let answer = client.recognise("front", capture, SOON).await.expect("an answer");
        assert_eq!(answer.status(), Status::NoMatch);
    }
    inside.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_beyond_its_quota_is_told_which_and_how_long_to_wait() {
    let limits = Limits { robot_frames_per_s: 2, ..Limits::default() };
    let inside = Inside::start(limits).await;
    inside.maps().create_map(&NewMap::new(MAP)).await.expect("a map");
    let (loud, other) = (robot(&inside, "loud").await, robot(&inside, "other").await);
    let mut answers = loud.answers();
    let frame = jpeg();
    let capture = || Capture::encoded(frame.clone()).expect("a picture").with_deadline_ms(60_000);
    let mut refused = None;
    for _ in 0..20 {
        loud.publish_frame("front", capture()).await.expect("sent");
    }
    while refused.is_none() {
        let received = tokio::time::timeout(SOON, answers.recv()).await.expect("in time").expect("all read");
        refused = received.answer.rejection;
    }
    let refused = refused.expect("a refusal");
    assert_eq!((refused.code.as_str(), refused.field.as_str()), ("rate_limited", "frame"));
    assert!(refused.detail.contains("limits.robot_frames_per_s") && refused.detail.contains("wait "));
    let answer = other.recognise("front", capture(), SOON).await.expect("an answer");
    assert_eq!(answer.status(), Status::NoMatch, "another robot has its own quota");
    let counts = settled(&inside).await;
    let limited = counts.rejected.get(&protos::Code::RateLimited).copied().unwrap_or(0);
    assert!(limited > 0, "{counts:?}");
    assert_eq!(counts.missing(), 0);
    inside.server.stop().await;
}
