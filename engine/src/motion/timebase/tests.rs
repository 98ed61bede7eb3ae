//! Stamps of one robot, without its messages.

use super::*;

fn camera(text: &str) -> Stream {
    Stream::Camera(Name::new(text).unwrap())
}

/// Messages of one robot; times in milliseconds.
struct Robot {
    clock: TimeBase,
    start: Instant,
}

impl Robot {
    fn new() -> Self {
        Self { clock: TimeBase::default(), start: Instant::now() }
    }

    fn check(&mut self, stream: &Stream, captured_ms: i64, received_ms: u64) -> Result<Stamp, Code> {
        let received = self.start + Duration::from_millis(received_ms);
        self.clock.check(stream, captured_ms * 1_000_000, received).map_err(|r| r.code)
    }

    /// Ten odometry messages, 100 ms apart, up to a second.
    fn driving() -> Self {
        let mut robot = Self::new();
        for ms in (100..=1000).step_by(100) {
            assert_eq!(robot.check(&Stream::Odometry, ms, ms as u64), Ok(Stamp::Good));
        }
        robot
    }
}

#[test]
fn stamps_at_the_tolerances() {
    let ahead = AHEAD_TOLERANCE.as_millis() as i64;
    let behind = BEHIND_TOLERANCE.as_millis() as i64;
    let front = camera("front");
    assert_eq!(Robot::driving().check(&front, 1100 + ahead, 1100), Ok(Stamp::Good));
    assert_eq!(Robot::driving().check(&front, 1101 + ahead, 1100), Err(Code::ClockAhead));
    assert_eq!(Robot::driving().check(&front, 1100 - behind, 1100), Ok(Stamp::Good));
    assert_eq!(Robot::driving().check(&front, 1099 - behind, 1100), Err(Code::ClockBehind));
    assert_eq!(Robot::driving().check(&front, i64::MAX / 1_000_000, 1100), Err(Code::ClockAhead));
}

/// Two leads may be further apart than 64 bits hold.
#[test]
fn stamps_at_both_ends_of_time_are_refused() {
    let mut robot = Robot::driving();
    for (i, captured_ns) in [i64::MAX, i64::MIN, i64::MAX, i64::MIN].into_iter().enumerate() {
        let received = robot.start + Duration::from_millis(1100 + 300 * i as u64);
        assert!(robot.clock.check(&Stream::Odometry, captured_ns, received).is_err(), "{captured_ns}");
    }
}

#[test]
fn strays_within_the_tolerance_do_not_move_the_reference() {
    let mut robot = Robot::driving();
    let ahead = AHEAD_TOLERANCE.as_millis() as i64;
    for (i, received) in (1100..1300).step_by(100).enumerate() {
        let stream = camera(&format!("c{i}"));
        assert_eq!(robot.check(&stream, received + ahead, received as u64), Ok(Stamp::Good));
    }
    assert_eq!(robot.check(&camera("third"), 1301 + ahead, 1300), Err(Code::ClockAhead));
}

#[test]
fn of_two_readings_out_of_order_the_one_further_off_is_wrong() {
    let mut robot = Robot::driving();
    assert_eq!(robot.check(&Stream::Odometry, 1250, 1100), Ok(Stamp::Good));
    assert_eq!(robot.check(&Stream::Odometry, 1200, 1200), Ok(Stamp::GoodAfterStray(1_250_000_000)));
    assert_eq!(robot.check(&Stream::Odometry, 500, 1300), Err(Code::ClockBehind));
    assert_eq!(robot.check(&Stream::Odometry, 1400, 1400), Ok(Stamp::Good));
    // Two lasers need not send in order.
    assert_eq!(robot.check(&Stream::Scan, 1400, 1400), Ok(Stamp::Good));
    assert_eq!(robot.check(&Stream::Scan, 1380, 1400), Ok(Stamp::Good));
}

#[test]
fn a_clock_is_set_by_several_that_agree_over_a_time() {
    let set = |count: u32, step_ms: u64, spread_ms: i64| {
        let mut robot = Robot::driving();
        (0..count)
            .map(|i| {
                let received = 1100 + u64::from(i) * step_ms;
                let spread = if i % 2 == 0 { 0 } else { spread_ms };
                robot.check(&Stream::Odometry, received as i64 + 60_000 + spread, received)
            })
            .filter(|result| *result == Ok(Stamp::ClockSet))
            .count()
    };
    let spread = CLOCK_SET_SPREAD.as_millis() as i64;
    assert_eq!(set(CLOCK_SET_COUNT, 250, 0), 1);
    assert_eq!(set(CLOCK_SET_COUNT - 1, 250, 0), 0, "too few");
    assert_eq!(set(CLOCK_SET_COUNT, 249, 0), 0, "too soon");
    assert_eq!(set(CLOCK_SET_COUNT, 250, spread), 1);
    assert_eq!(set(CLOCK_SET_COUNT, 250, spread + 1), 0, "they do not agree");
    assert_eq!(set(200, 10, 0), 1, "then it is the clock");
}

#[test]
fn of_two_cameras_by_two_clocks_the_first_stays() {
    let mut robot = Robot::new();
    let (a, b) = (camera("a"), camera("b"));
    for ms in (0..5000).step_by(200) {
        assert_eq!(robot.check(&a, ms, ms as u64), Ok(Stamp::Good));
        assert_eq!(robot.check(&b, ms + 10_000, ms as u64), Err(Code::ClockAhead));
    }
    // It is silent: the other goes on.
    let later = (5000..8000).step_by(200).map(|ms| robot.check(&b, ms + 10_000, ms as u64));
    assert_eq!(later.filter(|result| *result == Ok(Stamp::ClockSet)).count(), 1);
}

#[test]
fn a_stream_that_is_silent_leads_no_longer() {
    let mut robot = Robot::driving();
    let silent = 1000 + LEADER_SILENT.as_millis() as i64;
    let front = camera("front");
    let (mut set, mut ms) = (None, 1200);
    while set.is_none() && ms < 3 * silent {
        if robot.check(&front, ms + 60_000, ms as u64) == Ok(Stamp::ClockSet) {
            set = Some(ms);
        }
        ms += 200;
    }
    assert!(set.is_some_and(|ms| ms > silent && ms < silent + 1500), "{set:?}");
}

#[test]
fn ages_are_by_the_robots_clock() {
    let robot = Robot::driving();
    let now = robot.start + Duration::from_millis(1700);
    assert_eq!(robot.clock.age(1_000_000_000, now), Some(Duration::from_millis(700)));
    assert_eq!(robot.clock.age(9_000_000_000, now), Some(Duration::ZERO));
    assert_eq!(TimeBase::default().age(0, now), None);
}

#[test]
fn what_is_kept_is_bounded() {
    let mut robot = Robot::new();
    for ms in 0..1000_i64 {
        let stream = camera(&format!("c{}", ms % 50));
        robot.check(&stream, ms, ms as u64).unwrap();
    }
    assert_eq!((robot.clock.leads.len(), robot.clock.streams.len()), (MAX_LEADS, MAX_STREAMS));
    // Old leads go, but for the last.
    robot.check(&camera("c1"), 100_000, 100_000).unwrap();
    assert_eq!(robot.clock.leads.len(), 1);
}
