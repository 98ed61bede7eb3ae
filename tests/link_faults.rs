//! Claim: whatever the link between a robot and its server does, the robot goes on by itself, gets
//! no answer twice, none out of order and none to work that began too late; every frame ends in one
//! way, and those that were lost are counted; memory stays level, and another robot notices
//! nothing. So it is on plain links and on encrypted ones. A process of its own: it counts the
//! panics of all threads.

use client::{
    Capture, RobotClient, RobotOptions,
    api::NewMap,
    v1::{self, Status},
};
use engine::slots::FrameCounts;
use server::config::{RawConfig, RawTls};
use std::{
    collections::BTreeMap,
    fs, panic,
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    time::{Duration, Instant},
};
use tests::{
    Inside, SOON,
    command::waymark,
    eventually, http, pictures,
    proxy::{Link, Proxy},
    robots,
};
use tokio::task::JoinHandle;
use vision::frame::GrayImage;

const MAP: &str = "hall";
/// Between two frames of a robot.
const EVERY: Duration = Duration::from_millis(100);
/// Deadline of frames, counted from their receipt.
const DEADLINE_MS: u32 = 2_000;
/// A thread may stand so long between two clocks.
const SLACK_MS: f64 = 2_000.0;
/// The most that memory may grow over all faults: messages that wait, and pages that the allocator
/// keeps.
const GROWTH_BYTES: u64 = 64 << 20;
/// 1 Mbit/s: less than a robot sends.
const SLOW: Link = Link::Slow(125_000);

static PANICS: AtomicU64 = AtomicU64::new(0);

fn count_panics() {
    let before = panic::take_hook();
    panic::set_hook(Box::new(move |what| {
        PANICS.fetch_add(1, Ordering::Relaxed);
        before(what);
    }));
}

/// What a robot was told.
#[derive(Debug, Default)]
struct Heard {
    /// How often, by number.
    answers: BTreeMap<u64, u64>,
    newest: u64,
    faults: Vec<String>,
}

impl Heard {
    fn note(&mut self, answer: &v1::Answer) {
        let seq = answer.seq;
        *self.answers.entry(seq).or_default() += 1;
        if matches!(answer.status(), Status::Rejected | Status::Expired) {
            return;
        }
        if seq <= self.newest {
            self.faults.push(format!("frame {seq} is answered after {}", self.newest));
        }
        self.newest = seq;
        let work_ms: f64 = answer.timings.iter().map(|stage| stage.ms).sum();
        let begun_ms = answer.latency_ms - work_ms;
        if begun_ms > f64::from(DEADLINE_MS) + SLACK_MS {
            self.faults.push(format!("work on frame {seq} began after {begun_ms} ms"));
        }
    }
}

/// A robot that sends one frame after another.
struct Sender {
    client: Arc<RobotClient>,
    heard: Arc<Mutex<Heard>>,
    sent: Arc<AtomicU64>,
    stop: Arc<AtomicBool>,
    sending: JoinHandle<()>,
}

impl Sender {
    async fn start(inside: &Inside, endpoint: &str, name: &str, frame: &[u8]) -> Self {
        inside.maps().put_robot(name, MAP).await.expect("robot");
        let options = options(inside, name);
        let options = RobotOptions { timeout: SOON, endpoint: endpoint.to_owned(), ..options };
        let client = Arc::new(RobotClient::connect(&options).await.expect("connected"));
        let (heard, sent, stop) = <(Arc<Mutex<Heard>>, Arc<AtomicU64>, Arc<AtomicBool>)>::default();
        let (mut answers, noted) = (client.answers(), heard.clone());
        tokio::spawn(async move {
            while let Ok(received) = answers.recv().await {
                noted.lock().expect("whole").note(&received.answer);
            }
        });
        let (sends, count, stopped, frame) = (client.clone(), sent.clone(), stop.clone(), frame.to_vec());
        let sending = tokio::spawn(async move {
            while !stopped.load(Ordering::Relaxed) {
                if let Ok(seq) = sends.publish_frame("front", capture(&frame)).await {
                    count.store(seq, Ordering::Relaxed);
                }
                tokio::time::sleep(EVERY).await;
            }
        });
        Self { client, heard, sent, stop, sending }
    }

    /// Waits until a frame is answered that is sent from now on; how long that took.
    async fn answered(&self, when: &str) -> Duration {
        let (from, sent) = (Instant::now(), self.sent.load(Ordering::Relaxed));
        let newer = || async { (self.heard.lock().expect("whole").newest > sent + 1).then_some(()) };
        eventually(&format!("an answer {when}"), newer).await;
        from.elapsed()
    }

    /// Sends frames until the last one is answered. Its number: as many were sent.
    async fn finish(&mut self, frame: &[u8]) -> u64 {
        self.stop.store(true, Ordering::Relaxed);
        (&mut self.sending).await.expect("no panic");
        let last = || async { self.client.recognise("front", capture(frame), SOON).await.ok() };
        eventually("the last answer", last).await.seq
    }

    fn check(&self, sent: u64) {
        let heard = self.heard.lock().expect("whole");
        assert_eq!(heard.faults, [""; 0]);
        let wrong: Vec<_> =
            heard.answers.iter().filter(|(seq, times)| **times != 1 || **seq > sent).collect();
        assert!(wrong.is_empty(), "answered twice, or never sent: {wrong:?}");
    }
}

/// How a robot connects; with a certificate where the server asks for one.
fn options(inside: &Inside, name: &str) -> RobotOptions {
    let endpoint = &inside.server.zenoh_endpoint;
    if !endpoint.starts_with("tls/") {
        return RobotOptions::new(endpoint, "default", name);
    }
    let out = inside.data().join(format!("folder-of-{name}"));
    let run = waymark(
        ["robot", "enrol", name, "--out", out.to_str().expect("a path"), "--server", &inside.url()],
        SOON,
    );
    assert_eq!(run.status, 0, "{run:?}");
    RobotOptions::from_file(out.join("robot.json")).expect("the robot's file")
}

fn capture(frame: &[u8]) -> Capture {
    Capture::encoded(frame.to_vec()).expect("a picture").with_deadline_ms(DEADLINE_MS)
}

/// A fault of the link, and for how long. One that leaves new connections alone lasts until the
/// robot has one.
struct Fault {
    name: &'static str,
    link: Link,
    lasts: Option<Duration>,
}

fn faults() -> Vec<Fault> {
    let lasting = |name, link, ms| Fault { name, link, lasts: Some(Duration::from_millis(ms)) };
    let mut all = vec![
        lasting("a stall of 300 ms", Link::Down, 300),
        lasting("down for 1 s", Link::Down, 1_000),
        lasting("down for 5 s", Link::Down, 5_000),
        lasting("1 Mbit/s for 3 s", SLOW, 3_000),
        Fault { name: "half-open", link: Link::HalfOpen, lasts: None },
        lasting("dead for 6 s, and every new connection, too", Link::Dead, 6_000),
    ];
    all.extend([1, 700, 9_000].map(|bytes| Fault {
        name: "reset in the middle of a message",
        link: Link::ResetAfter(bytes),
        lasts: None,
    }));
    if std::env::var_os("WAYMARK_LONG").is_some() {
        all.push(lasting("down for 30 s", Link::Down, 30_000));
        all.push(lasting("1 Mbit/s for 30 s", SLOW, 30_000));
    }
    all
}

/// One fault, and how long the robot needs after it, or from its beginning where new connections
/// pass.
async fn fault(proxy: &Proxy, robot: &Sender, neighbour: &Sender, fault: &Fault) -> Duration {
    let connections = proxy.connections();
    let begun = Instant::now();
    proxy.set(fault.link);
    let Some(lasts) = fault.lasts else {
        let again = || async { (proxy.connections() > connections).then_some(()) };
        eventually(&format!("{}: a new connection", fault.name), again).await;
        robot.answered(fault.name).await;
        let took = begun.elapsed();
        proxy.set(Link::Up);
        return took;
    };
    tokio::time::sleep(lasts).await;
    neighbour.answered(fault.name).await;
    proxy.set(Link::Up);
    robot.answered(fault.name).await
}

/// Memory of this process, bytes; 0 where the system does not say.
fn memory_bytes() -> u64 {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap_or("0");
    let kb: u64 = line.trim().trim_end_matches("kB").trim().parse().unwrap_or(0);
    kb << 10
}

/// Waits until nothing waits or is in work.
async fn settled(inside: &Inside) -> FrameCounts {
    eventually("every frame has ended", || async {
        let counts = inside.server.slots.counts();
        (counts.waiting == 0 && counts.in_work == 0).then_some(counts)
    })
    .await
}

/// Sum of the series whose names begin so.
fn sum(metrics: &str, series: &str) -> u64 {
    let of = |line: &str| line.starts_with(series).then(|| line.rsplit_once(' ')?.1.parse::<f64>().ok())?;
    metrics.lines().filter_map(of).sum::<f64>() as u64
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_goes_on_after_every_fault_of_its_link_and_is_told_nothing_stale() {
    count_panics();
    for is_encrypted in [false, true] {
        println!("{} links", if is_encrypted { "encrypted" } else { "plain" });
        let tls = RawTls { enabled: is_encrypted, ..RawTls::default() };
        goes_on(Inside::start_with(RawConfig { tls, ..RawConfig::default() }).await).await;
    }
}

#[expect(clippy::print_stdout, reason = "what a fault costs is read in the output of the test")]
async fn goes_on(inside: Inside) {
    inside.maps().create_map(&NewMap::new(MAP)).await.expect("map");
    let blocks = pictures::blocks(7, 320, 240);
    let frame = robots::jpeg(&GrayImage::from_fn(320, 240, |u, v| blocks[v * 320 + u]));
    assert!(frame.len() > 9_000, "a message of several pieces");
    let proxy = Proxy::start(&inside.server.zenoh_endpoint).await;
    let mut robot = Sender::start(&inside, &proxy.endpoint(), "rover", &frame).await;
    let mut neighbour = Sender::start(&inside, &inside.server.zenoh_endpoint, "neighbour", &frame).await;
    robot.answered("at first").await;
    neighbour.answered("at first").await;
    let (memory, most_held) = (memory_bytes(), 2 * 2 * (frame.len() + 1_000));
    for one in faults() {
        let took = fault(&proxy, &robot, &neighbour, &one).await;
        let (counts, held) = (inside.server.slots.counts(), inside.server.slots.held_bytes());
        assert!(counts.missing() == 0 && counts.waiting <= 2, "{}: {counts:?}", one.name);
        assert!(held <= most_held, "{}: {held} bytes wait or are in work", one.name);
        println!("{}: answered again after {:.1} s", one.name, took.as_secs_f64());
    }
    let sent = (robot.finish(&frame).await, neighbour.finish(&frame).await);
    robot.check(sent.0);
    neighbour.check(sent.1);

    let (counts, missed) = (settled(&inside).await, inside.server.slots.missed());
    println!("{sent:?} frames sent, {counts:?}, {} lost on the way", missed.total);
    assert_eq!(counts.missing(), 0, "{counts:?}");
    assert_eq!(
        counts.received - counts.rejected_total() + missed.total,
        sent.0 + sent.1,
        "{counts:?} {missed:?}"
    );
    assert!(missed.total > 0, "no fault has cost a frame");
    let metrics = http(&inside.url()).await.get(format!("{}/metrics", inside.url())).send().await;
    let metrics = metrics.expect("metrics").text().await.expect("text");
    assert_eq!(sum(&metrics, "waymark_frames_received_total"), counts.received);
    assert_eq!(sum(&metrics, "waymark_frames_total"), counts.received);
    assert_eq!(sum(&metrics, "waymark_frames_missed_total"), missed.total);
    let grown = memory_bytes().saturating_sub(memory);
    println!("memory has grown by {:.1} MB", grown as f64 / f64::from(1 << 20));
    assert!(grown < GROWTH_BYTES, "{grown} bytes");
    assert_eq!((PANICS.load(Ordering::Relaxed), inside.server.vitals().failure()), (0, None));
    inside.server.stop().await;
}
