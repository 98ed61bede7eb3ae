use super::*;

fn name(text: &str) -> Name {
    Name::new(text).unwrap()
}

/// One robot, `r1`, and times in milliseconds.
struct World {
    epochs: Epochs,
    start: Instant,
}

impl World {
    fn new() -> Self {
        Self { epochs: Epochs::default(), start: Instant::now() }
    }

    fn at(&self, ms: u64) -> Instant {
        self.start + Duration::from_millis(ms)
    }

    fn message(&self, epoch: u64, ms: u64) -> Result<(), Code> {
        self.epochs.admit(&name("r1"), epoch, self.at(ms)).map_err(|r| r.code)
    }

    fn token(&self, epoch: u64, appeared: bool, ms: u64) -> Option<bool> {
        self.epochs.token(&name("r1"), (alive_slot(epoch), appeared), self.at(ms), |_| true)
    }

    fn status(&self, ms: u64) -> Status {
        self.epochs.status(&name("r1"), self.at(ms))
    }
}

#[test]
fn while_messages_come_another_epoch_is_refused_and_shown() {
    let world = World::new();
    assert_eq!(world.message(7, 0), Ok(()));
    assert_eq!(world.message(8, 100), Err(Code::EpochConflict));
    assert_eq!(world.message(7, 200), Ok(()), "the first goes on");
    assert_eq!(world.message(8, 300), Err(Code::EpochConflict));
    let status = world.status(400);
    assert_eq!((status.alive, status.epoch), (true, Some(7)));
    assert_eq!(status.conflict, Some(Conflict { epoch: 8, refused: 2, last_ms: 100 }));
    assert_eq!(world.status(300 + CONFLICT_SHOWN.as_millis() as u64).conflict, None);
}

#[test]
fn without_a_token_the_wait_is_the_named_time() {
    let world = World::new();
    let live = MESSAGE_LIVE.as_millis() as u64;
    world.message(7, 0).unwrap();
    assert_eq!(world.message(8, live - 1), Err(Code::EpochConflict));
    assert_eq!(world.message(8, live), Ok(()));
    assert_eq!(world.status(live).conflict, None, "it is the live one now");
    // The first one's late messages are refused, and are no conflict.
    assert_eq!(world.message(7, live + 10), Err(Code::NotNewer));
    assert_eq!(world.status(live + 10).conflict, None);
    // When the second is silent in its turn, the first may come back.
    assert_eq!(world.message(7, 2 * live), Ok(()));
}

#[test]
fn a_token_keeps_an_epoch_live_and_its_end_is_at_once() {
    let world = World::new();
    assert_eq!(world.token(7, true, 0), Some(true));
    assert_eq!(world.message(7, 10), Ok(()));
    assert_eq!(world.message(8, 100_000), Err(Code::EpochConflict), "silent, but there");
    assert_eq!(world.token(8, true, 100_000), None, "the robot was present before");
    assert_eq!(world.message(8, 100_001), Err(Code::EpochConflict));
    assert_eq!(world.token(7, false, 100_002), None);
    assert_eq!(world.epochs.current(&name("r1")), None);
    assert_eq!(world.message(8, 100_003), Ok(()));
    assert_eq!(world.message(7, 100_004), Err(Code::NotNewer), "a straggler");
    assert_eq!(world.token(8, false, 100_005), Some(false));
    assert!(!world.status(100_005).alive);
}

#[test]
fn a_straggler_does_not_bring_its_epoch_back() {
    let world = World::new();
    world.token(7, true, 0);
    world.message(7, 10).unwrap();
    world.token(7, false, 20);
    assert_eq!(world.message(7, 30), Err(Code::NotNewer));
    assert_eq!(world.message(8, 40), Ok(()), "at once");
    world.token(8, false, 50);
    // A link that was lost comes back: the token says so.
    world.token(7, true, 60);
    assert_eq!(world.message(7, 70), Ok(()));
}

#[test]
fn a_token_is_presence_until_its_epoch_sends() {
    let world = World::new();
    assert_eq!(world.token(7, true, 0), Some(true));
    assert_eq!((world.status(0).alive, world.status(0).epoch), (true, None));
    assert_eq!(world.message(8, 10), Ok(()), "the first that sends is live");
    assert_eq!(world.message(7, 20), Err(Code::EpochConflict));
}

#[test]
fn an_epoch_in_the_same_slot_waits_for_the_messages_alone() {
    let world = World::new();
    let (live, other) = (MESSAGE_LIVE.as_millis() as u64, 7 + u64::from(ALIVE_SLOTS));
    world.token(7, true, 0);
    assert_eq!(world.message(7, 10), Ok(()));
    assert_eq!(world.message(other, 10 + live - 1), Err(Code::EpochConflict));
    assert_eq!(world.message(other, 10 + live), Ok(()), "the token may be its own");
    assert_eq!(world.token(other, false, 20_000), Some(false));
    assert_eq!(world.status(20_000).epoch, None);
}

#[test]
fn ended_epochs_are_bounded() {
    let world = World::new();
    for epoch in 100..200 {
        world.message(epoch, epoch * 10_000).ok();
    }
    assert!(world.epochs.lock()[&name("r1")].ended.len() <= MAX_ENDED);
}

#[test]
fn robots_are_bounded() {
    let world = World::new();
    for i in 0..MAX_TRACKED_ROBOTS as u64 + 5 {
        world.epochs.admit(&name(&format!("robot-{i}")), 1, world.at(i)).unwrap();
    }
    assert_eq!(world.epochs.lock().len(), MAX_TRACKED_ROBOTS);
}

/// Names that are not registered neither grow the list without bound nor replace a registered
/// robot.
#[test]
fn names_that_nobody_registered_are_bounded() {
    let world = World::new();
    let registered = |n: &Name| n.as_str() == "r1";
    let token = |robot: &str, ms| world.epochs.token(&name(robot), (0, true), world.at(ms), registered);
    token("r1", 0);
    for i in 0..3 * MAX_UNREGISTERED as u64 {
        token(&format!("made-up-{i}"), i + 1);
    }
    assert_eq!(world.epochs.lock().len(), MAX_UNREGISTERED + 1);
    assert!(world.status(0).alive, "the registered robot is shown");
    // A registered robot is let in when the list is full, and one whose token came before its
    // registration is alive.
    world.epochs.token(&name("r2"), (1, true), world.at(9), |n| n.as_str() == "r2");
    assert!(world.epochs.status(&name("r2"), world.at(9)).alive);
    let latest = format!("made-up-{}", 3 * MAX_UNREGISTERED - 1);
    assert!(world.epochs.status(&name(&latest), world.at(9)).alive);
}

#[test]
fn epochs_are_remembered_up_to_the_bound() {
    let mut order = SequenceTracker::default();
    for epoch in 0..=PAST_EPOCHS as u64 {
        order.advance(epoch, 5).unwrap();
    }
    assert!(order.advance(0, 5).is_err());
    order.advance(99, 1).unwrap();
    assert_eq!(order.past.len(), PAST_EPOCHS);
    assert!(order.advance(1, 5).is_err());
    assert!(order.advance(0, 5).is_ok(), "the oldest of {PAST_EPOCHS} is forgotten");
}
