use super::*;
use proptest::prelude::*;

/// Bytes of all frames that wait or are in work.
const BYTES: usize = 100_000;

/// In these tests a frame is a number, and takes as many bytes.
impl Held for u64 {
    fn held_bytes(&self) -> usize {
        *self as usize
    }
}

fn key(robot: &str, camera: &str) -> SlotKey {
    SlotKey { robot: Name::new(robot).unwrap(), camera: Name::new(camera).unwrap() }
}

fn whole(counts: &FrameCounts) {
    assert_eq!(counts.missing(), 0, "{counts:?}");
}

#[test]
fn one_in_work_one_waiting_newest_wins() {
    let slots = Slots::new(4, BYTES);
    let (k, now) = (key("r1", "front"), Instant::now());
    slots.offer(k.clone(), (1, 1), 1, now).unwrap();
    assert_eq!(slots.try_take(), Some((k.clone(), 1)));
    for seq in 2..=5 {
        slots.offer(k.clone(), (1, seq), seq, now).unwrap();
    }
    assert_eq!(slots.try_take(), None, "its camera is in work");
    let counts = slots.counts();
    assert_eq!((counts.waiting, counts.in_work, counts.superseded), (1, 1, 3));
    slots.finish(&k, FrameOutcome::Processed);
    assert_eq!(slots.try_take(), Some((k.clone(), 5)));
    slots.finish(&k, FrameOutcome::Rejected(Code::BadImage));
    let counts = slots.counts();
    assert_eq!((counts.received, counts.processed, counts.superseded, counts.rejected_total()), (5, 1, 3, 1));
    whole(&counts);
}

#[test]
fn old_numbers_are_refused_in_each_epoch() {
    let slots = Slots::new(4, BYTES);
    let (k, now) = (key("r1", "front"), Instant::now());
    let offer = |epoch, seq| slots.offer(k.clone(), (epoch, seq), 0, now).map_err(|r| (r.code, r.field));
    assert_eq!(offer(7, 10), Ok(()));
    assert_eq!(offer(7, 10), Err((Code::NotNewer, "seq".into())));
    assert_eq!(offer(7, 9), Err((Code::NotNewer, "seq".into())));
    assert_eq!(offer(3, 1), Ok(()), "a restart begins again, whatever its number");
    assert_eq!(offer(7, 10), Err((Code::NotNewer, "seq".into())), "at most once, also after another epoch");
    assert_eq!(offer(7, 11), Ok(()), "one that comes back goes on");
    assert_eq!(offer(3, 1), Err((Code::NotNewer, "seq".into())));
    assert_eq!(slots.counts().rejected, BTreeMap::from([(Code::NotNewer, 4)]));
    whole(&slots.counts());
}

/// Cameras with invented names must not keep the robot's own one out.
#[test]
fn the_camera_with_the_oldest_frame_is_replaced() {
    let slots = Slots::new(100, BYTES);
    let start = Instant::now();
    let offer = |camera: &str, seq, now| slots.offer(key("r1", camera), (1, seq), 0, now).map_err(|r| r.code);
    for c in 0..MAX_CAMERAS_PER_ROBOT {
        offer(&format!("invented-{c}"), 1, start + Duration::from_millis(c as u64)).unwrap();
    }
    assert_eq!(
        offer("front", 1, start + IDLE_CAMERA),
        Err(Code::TooMany),
        "every camera has a waiting frame"
    );
    while let Some((k, _)) = slots.try_take() {
        slots.finish(&k, FrameOutcome::Processed);
    }
    assert_eq!(
        offer("front", 2, start + IDLE_CAMERA.saturating_sub(Duration::from_millis(1))),
        Err(Code::TooMany)
    );
    assert_eq!(offer("front", 3, start + IDLE_CAMERA), Ok(()));
    assert_eq!(
        offer("invented-0", 2, start + IDLE_CAMERA),
        Err(Code::TooMany),
        "it was replaced; no other is idle for long enough"
    );
    // Cameras that send are not replaced.
    assert_eq!(offer("invented-1", 2, start + IDLE_CAMERA), Ok(()));
    assert_eq!(offer("front", 4, start + 2 * IDLE_CAMERA), Ok(()));
    whole(&slots.counts());
}

#[test]
fn slots_take_turns() {
    let slots = Slots::new(4, BYTES);
    let now = Instant::now();
    let (fast, slow) = (key("fast", "a"), key("slow", "a"));
    let mut turns = Vec::new();
    for seq in 1..=6 {
        slots.offer(fast.clone(), (1, 10 * seq), 0, now).unwrap();
        slots.offer(slow.clone(), (1, seq), 0, now).unwrap();
        let (k, _) = slots.try_take().unwrap();
        slots.offer(fast.clone(), (1, 10 * seq + 1), 0, now).unwrap();
        slots.finish(&k, FrameOutcome::Processed);
        turns.push(k.robot.as_str().to_owned());
    }
    assert_eq!(turns, ["fast", "slow", "fast", "slow", "fast", "slow"]);
    whole(&slots.counts());
}

/// A robot with all its cameras at 200 Hz has the share of one robot.
#[test]
fn a_robot_with_many_cameras_has_one_share() {
    let slots = Slots::new(64, BYTES);
    let now = Instant::now();
    let greedy: Vec<_> = (0..MAX_CAMERAS_PER_ROBOT).map(|c| key("greedy", &format!("c{c}"))).collect();
    let quiet: Vec<_> = (0..4).map(|r| key(&format!("quiet-{r}"), "front")).collect();
    let mut work: BTreeMap<Name, usize> = BTreeMap::new();
    let mut cameras: BTreeMap<Name, usize> = BTreeMap::new();
    for seq in 1..=1000 {
        for k in greedy.iter().chain(&quiet) {
            slots.offer(k.clone(), (1, seq), 1, now).unwrap();
        }
        // Two workers.
        let taken: Vec<_> = (0..2).filter_map(|_| slots.try_take()).collect();
        for (k, _) in taken {
            slots.finish(&k, FrameOutcome::Processed);
            *cameras.entry(k.camera).or_default() += usize::from(k.robot.as_str() == "greedy");
            *work.entry(k.robot).or_default() += 1;
        }
    }
    let fair = 2000 / 5;
    assert_eq!(work.values().sum::<usize>(), 2000);
    assert!(work.values().all(|taken| taken.abs_diff(fair) <= 2), "{work:?}");
    let of_camera = fair / MAX_CAMERAS_PER_ROBOT;
    let greedy: Vec<_> = greedy.iter().map(|k| cameras[&k.camera]).collect();
    assert!(greedy.iter().all(|taken| taken.abs_diff(of_camera) <= 2), "{greedy:?}");
    whole(&slots.counts());
}

/// Of three robots one frame a round is in time: each robot's in turn. Of cameras of one robot the
/// same holds.
#[test]
fn a_frame_that_expired_was_no_turn() {
    for keys in [["r1", "r2", "r3"].map(|robot| key(robot, "front")), ["a", "b", "c"].map(|c| key("r1", c))] {
        let slots = Slots::new(4, BYTES);
        let mut processed = BTreeMap::new();
        for round in 1..=9 {
            for key in &keys {
                slots.offer(key.clone(), (1, round), 1, Instant::now()).unwrap();
            }
            for place in 0..keys.len() {
                let (key, _) = slots.try_take().expect("every frame has a turn");
                let is_first = place == 0;
                slots.finish(&key, if is_first { FrameOutcome::Processed } else { FrameOutcome::Expired });
                *processed.entry(key).or_insert(0) += u32::from(is_first);
            }
            assert_eq!(slots.try_take(), None);
        }
        assert!(processed.values().all(|frames| *frames == 3), "{processed:?}");
        whole(&slots.counts());
    }
}

#[test]
fn frames_beyond_the_memory_for_them_are_refused() {
    let slots = Slots::new(64, 1_000);
    let now = Instant::now();
    let offer = |camera: &str, seq, bytes: u64| {
        slots.offer(key("r1", camera), (1, seq), bytes, now).map_err(|r| (r.code, r.field))
    };
    let refused = Err((Code::Overloaded, "frame".to_owned()));
    assert_eq!((offer("a", 1, 600), offer("b", 1, 400), slots.held_bytes()), (Ok(()), Ok(()), 1_000));
    assert_eq!(offer("c", 1, 1), refused);
    assert_eq!((offer("a", 2, 500), slots.held_bytes()), (Ok(()), 900), "the replaced one counts no more");
    let (k, _) = slots.try_take().unwrap();
    assert_eq!((slots.held_bytes(), offer("c", 2, 101)), (900, refused), "what is in work counts");
    slots.finish(&k, FrameOutcome::Processed);
    assert_eq!((slots.held_bytes(), offer("c", 3, 600)), (400, Ok(())));
    slots.close();
    assert_eq!(slots.held_bytes(), 0);
    whole(&slots.counts());
}

#[test]
fn cameras_at_the_bounds() {
    let slots = Slots::new(MAX_CAMERAS_PER_ROBOT + 1, BYTES);
    let now = Instant::now();
    for c in 0..MAX_CAMERAS_PER_ROBOT {
        slots.offer(key("r1", &format!("c{c}")), (1, 1), 0, now).unwrap();
    }
    let more = |robot, camera, now| slots.offer(key(robot, camera), (1, 1), 0, now).map_err(|r| r.code);
    assert_eq!(more("r1", "one-too-many", now), Err(Code::TooMany));
    assert_eq!(more("r2", "a", now), Ok(()));
    assert_eq!(more("r3", "a", now), Err(Code::TooMany));
    // An idle slot is replaced, one with work is not.
    let (k, _) = slots.try_take().unwrap();
    slots.finish(&k, FrameOutcome::Processed);
    assert_eq!(more("r3", "a", now + IDLE_SLOT / 2), Err(Code::TooMany));
    assert_eq!(more("r3", "a", now + IDLE_SLOT), Ok(()));
    assert_eq!(more("r4", "a", now + IDLE_SLOT), Err(Code::TooMany));
    whole(&slots.counts());
}

#[test]
fn closing_wakes_workers_and_counts_what_waited() {
    let slots = std::sync::Arc::new(Slots::new(2, BYTES));
    let waiting = std::thread::spawn({
        let slots = slots.clone();
        move || slots.take()
    });
    std::thread::sleep(Duration::from_millis(20));
    slots.close();
    assert_eq!(waiting.join().unwrap(), None);
    assert_eq!(slots.offer(key("r1", "a"), (1, 1), 0, Instant::now()).unwrap_err().code, Code::Expired);

    let slots = Slots::new(2, BYTES);
    slots.offer(key("r1", "a"), (1, 1), 0, Instant::now()).unwrap();
    slots.close();
    assert_eq!((slots.counts().expired, slots.take()), (1, None));
    whole(&slots.counts());
}

#[derive(Debug, Clone)]
enum Step {
    Offer { camera: u8, epoch: u64, seq: u64 },
    Refuse,
    Take,
    Finish(u8),
    Close,
}

fn steps() -> impl Strategy<Value = Vec<Step>> {
    let step = prop_oneof![
        8 => (0..4_u8, 0..3_u64, 0..40_u64).prop_map(|(camera, epoch, seq)| Step::Offer { camera, epoch, seq }),
        1 => Just(Step::Refuse),
        4 => Just(Step::Take),
        4 => (0..3_u8).prop_map(Step::Finish),
        1 => Just(Step::Close),
    ];
    prop::collection::vec(step, 0..200)
}

proptest! {
    /// Whatever happens in whatever order: nothing is lost, nothing counted twice, never two of one
    /// camera in work, and what is taken is the newest of its camera.
    #[test]
    fn every_frame_ends_exactly_once(steps in steps()) {
        let slots = Slots::new(3, BYTES);
        let now = Instant::now();
        let mut held: Vec<(SlotKey, FrameOutcome)> = Vec::new();
        let mut newest: BTreeMap<SlotKey, u64> = BTreeMap::new();
        for (i, step) in steps.into_iter().enumerate() {
            match step {
                Step::Offer { camera, epoch, seq } => {
                    let k = key("r1", &format!("c{camera}"));
                    if slots.offer(k.clone(), (epoch, seq), i as u64, now).is_ok() {
                        newest.insert(k, i as u64);
                    }
                }
                Step::Refuse => slots.refuse(Code::BadMessage),
                Step::Take => if let Some((k, job)) = slots.try_take() {
                    prop_assert!(held.iter().all(|(h, _)| *h != k));
                    prop_assert_eq!(newest[&k], job);
                    held.push((k, [FrameOutcome::Processed, FrameOutcome::Expired, FrameOutcome::Rejected(Code::BadImage)][i % 3]));
                },
                Step::Finish(which) => if !held.is_empty() {
                    let (k, outcome) = held.remove(usize::from(which) % held.len());
                    slots.finish(&k, outcome);
                },
                Step::Close => slots.close(),
            }
            let counts = slots.counts();
            prop_assert_eq!(counts.missing(), 0);
            prop_assert_eq!(counts.in_work, held.len() as u64);
            prop_assert!(counts.waiting <= 3);
            prop_assert!(slots.held_bytes() <= BYTES && (counts.waiting + counts.in_work > 0 || slots.held_bytes() == 0));
        }
    }
}

#[test]
fn numbers_that_are_left_out_are_counted_in_their_epoch_and_by_robot() {
    let slots = Slots::new(4, BYTES);
    let now = Instant::now();
    for (epoch, seq) in [(1, 5), (1, 6), (1, 9), (2, 40), (2, 41), (1, 12)] {
        slots.offer(key("r1", "front"), (epoch, seq), 0, now).unwrap();
    }
    assert!(slots.offer(key("r1", "front"), (1, 3), 0, now).is_err(), "old");
    let missed = slots.missed();
    // 7 and 8; a first number, another epoch and one that comes back say nothing.
    assert_eq!((missed.total, missed.by_robot.into_values().collect()), (2, vec![2]));
    let mut many = MissedFrames::default();
    for i in 0..=MAX_ROBOTS {
        many.add(&Name::new(format!("r{i}")).unwrap(), 1);
    }
    assert_eq!((many.total, many.by_robot.len()), (MAX_ROBOTS as u64 + 1, MAX_ROBOTS));
}

#[test]
fn the_oldest_wait_is_that_of_a_frame_that_waits_now() {
    let slots = Slots::new(4, BYTES);
    let now = Instant::now();
    let at = |ms| now + Duration::from_millis(ms);
    assert_eq!(slots.oldest_wait(at(9)), None);
    slots.offer(key("r1", "front"), (1, 1), 0, at(0)).unwrap();
    slots.offer(key("r2", "front"), (1, 1), 0, at(3)).unwrap();
    assert_eq!(slots.oldest_wait(at(10)), Some(Duration::from_millis(10)));
    slots.offer(key("r1", "front"), (1, 2), 0, at(6)).unwrap();
    assert_eq!(slots.oldest_wait(at(10)), Some(Duration::from_millis(7)), "a newer one replaced the oldest");
    while slots.try_take().is_some() {}
    assert_eq!(slots.oldest_wait(at(10)), None);
}
