//! Robots of simulations, whose time runs slower or faster than the server's, stands still, or
//! begins again, and clocks that drift. A robot drives along x at 1 m/s of its own time; in the map
//! it is 7 m further on than in its odometry.

use super::*;
use protos::CheckedFrame;

/// Odometry messages in a second of the robot's clock; every sixth comes with a frame.
const RATE: f64 = 30.0;
/// Most delay of a message, seconds of the server's clock.
const DELAY_S: f64 = 0.012;

/// A phase: seconds of the server's clock, and the rate of the robot's clock by it.
type Phase = (f64, f64);

struct Simulation {
    motion: MotionTracker,
    r1: Name,
    seq: u64,
    /// The server's time and the robot's.
    now_s: f64,
    robot_s: f64,
    /// Receipt of the last message, by the server's clock.
    received_s: f64,
    /// What the robot's clock shows at its start.
    stamp_s: f64,
    /// The pose is known since then, by the server's clock.
    fixed_s: Option<f64>,
    /// Ticks after which no pose was supported, once there was one.
    unsupported: u32,
    worst_m: f64,
}

impl Simulation {
    fn new(stamp_s: f64) -> Self {
        let (motion, r1) = motion();
        let (now_s, robot_s, received_s, fixed_s, unsupported, worst_m) = (0.0, 0.0, 0.0, None, 0, 0.0);
        Self { motion, r1, seq: 0, now_s, robot_s, received_s, stamp_s, fixed_s, unsupported, worst_m }
    }

    /// After all phases.
    fn of(phases: &[Phase]) -> Self {
        let mut simulation = Self::new(5.0);
        for phase in phases {
            simulation.run(*phase);
        }
        simulation
    }

    fn run(&mut self, (seconds, rate): Phase) {
        let end_s = self.now_s + seconds;
        while rate > 0.0 && self.now_s < end_s {
            self.now_s += 1.0 / (RATE * rate);
            self.robot_s += 1.0 / RATE;
            self.tick();
        }
        self.now_s = end_s.max(self.now_s);
    }

    fn tick(&mut self) {
        self.seq += 1;
        // Delays without order, and the same in each run; messages stay in their order.
        let delay_s = DELAY_S * (self.seq as f64 * 0.618).fract();
        self.received_s = self.received_s.max(self.now_s + delay_s);
        let received = time(self.received_s);
        let captured_ns = ((self.stamp_s + self.robot_s) * 1e9).round() as i64;
        let odom_from_robot = Some(v1::Pose2 { x_m: self.robot_s, ..v1::Pose2::default() });
        let message =
            v1::Odometry { epoch: 1, seq: self.seq, captured_ns, odom_from_robot, ..Default::default() };
        self.motion.odometry(&self.r1, message.encode_to_vec().into(), received);
        if self.seq.is_multiple_of(6) {
            self.frame(captured_ns, received);
        }
        let Some(fixed_s) = self.fixed_s else { return };
        match self.motion.known_pose(&self.r1, received) {
            Some(known) => {
                let off_m = (known.fused.pose.pose.x_m - 7.0 - self.robot_s).abs();
                self.worst_m = self.worst_m.max(off_m);
            }
            None if self.now_s > fixed_s => self.unsupported += 1,
            None => {}
        }
    }

    /// A frame, by which the robot is fixed.
    fn frame(&mut self, captured_ns: i64, received: Instant) {
        let (encoding, image) = (v1::ImageEncoding::Gray8.into(), vec![0; 12].into());
        let (width_px, height_px) = (4, 3);
        let wire = v1::Frame {
            epoch: 1,
            seq: self.seq,
            captured_ns,
            encoding,
            width_px,
            height_px,
            image,
            ..Default::default()
        };
        let frame = CheckedFrame::try_from(wire).unwrap();
        if self.motion.frame_stamp((&self.r1, &front()), "hall", &frame, received).is_err() {
            return;
        }
        let at = FrameStamp { odometry: None, now: received, ..at(captured_ns, 0.0) };
        if self.motion.apply_fix(&self.r1, at, &fix(self.robot_s + 7.0)).is_some() {
            self.fixed_s.get_or_insert(self.now_s);
        }
    }

    /// Share of the messages that were used.
    fn used(&self) -> f64 {
        let (odometry, frames) = (self.motion.counts().0, self.motion.frame_stamps());
        let refused: u64 = odometry.rejected.values().chain(frames.rejected.values()).sum();
        let accepted = odometry.accepted + frames.accepted;
        accepted as f64 / (accepted + refused) as f64
    }

    fn is_supported(&self, name: &str) {
        let used = self.used();
        assert!(used >= 0.99, "{name}: {used} of the messages were used");
        assert!(self.fixed_s.is_some_and(|s| s < 3.0), "{name}: fixed at {:?} s", self.fixed_s);
        assert_eq!(self.unsupported, 0, "{name}: ticks without a pose");
        assert!(self.worst_m < 0.05, "{name}: {} m off", self.worst_m);
    }
}

#[test]
fn a_simulation_at_any_factor_has_its_pose() {
    for factor in [0.1, 0.2, 0.3, 0.45, 0.6, 0.8, 0.95, 1.0, 1.05, 1.2, 1.5, 2.0, 3.0, 5.0, 10.0] {
        Simulation::of(&[(60.0, factor)]).is_supported(&format!("factor {factor}"));
    }
}

#[test]
fn a_simulation_whose_factor_changes_keeps_its_pose() {
    for phases in [
        [(20.0, 1.0), (20.0, 0.3), (20.0, 1.0)],
        [(20.0, 0.3), (20.0, 0.9), (20.0, 0.1)],
        [(20.0, 2.0), (20.0, 0.5), (20.0, 2.0)],
        [(20.0, 10.0), (20.0, 1.0), (20.0, 10.0)],
    ] {
        let simulation = Simulation::of(&phases);
        assert!(simulation.used() >= 0.97, "{phases:?}: {} were used", simulation.used());
        assert!(simulation.worst_m < 0.05, "{phases:?}: {} m off", simulation.worst_m);
        let ticks = simulation.seq;
        assert!(
            f64::from(simulation.unsupported) < 0.05 * ticks as f64,
            "{phases:?}: {}",
            simulation.unsupported
        );
    }
}

/// A pause ends the pose's age, not its messages.
#[test]
fn a_simulation_that_stood_still_goes_on() {
    for factor in [0.3, 1.0, 2.0] {
        for pause_s in [1.0, 5.0, 60.0] {
            let mut simulation = Simulation::of(&[(20.0, factor), (pause_s, 0.0), (2.0, factor)]);
            simulation.unsupported = 0;
            simulation.run((20.0, factor));
            simulation.is_supported(&format!("factor {factor}, pause of {pause_s} s"));
        }
    }
}

#[test]
fn a_simulation_that_begins_again_is_heard_after_a_second() {
    for factors in [[1.0, 1.0], [0.3, 0.3], [0.3, 2.0], [2.0, 0.5]] {
        let mut simulation = Simulation::of(&[(20.0, factors[0])]);
        simulation.stamp_s = -simulation.robot_s;
        let before = simulation.motion.counts().0.rejected;
        simulation.run((2.0, factors[1]));
        let refused: u64 = simulation.motion.counts().0.rejected.values().sum();
        let refused = refused - before.values().sum::<u64>();
        assert!(refused as f64 <= 1.3 * RATE * factors[1], "{factors:?}: {refused}");
        simulation.unsupported = 0;
        simulation.run((20.0, factors[1]));
        assert_eq!(simulation.unsupported, 0, "{factors:?}");
    }
}

#[test]
fn a_clock_that_drifts_is_followed() {
    for rate in [0.99, 0.9999, 1.0001, 1.01] {
        Simulation::of(&[(600.0, rate)]).is_supported(&format!("rate {rate}"));
    }
}

/// What was learnt of a simulation's clock lets no stray stamp through.
#[test]
fn a_stray_stamp_of_a_simulation_changes_nothing() {
    for factor in [0.3, 2.0] {
        for off_s in [3600.0, 10.0, -30.0, -3600.0] {
            let mut simulation = Simulation::of(&[(20.0, factor)]);
            let stamp_s = simulation.stamp_s;
            for _ in 0..3 {
                simulation.stamp_s = stamp_s + off_s;
                simulation.tick();
                simulation.stamp_s = stamp_s;
                simulation.run((3.0, factor));
            }
            let refused: u64 = simulation.motion.counts().0.rejected.values().sum();
            assert_eq!(refused, 3, "factor {factor}, {off_s} s");
            assert_eq!(simulation.unsupported, 0, "factor {factor}, {off_s} s");
            assert!(simulation.worst_m < 0.05, "factor {factor}, {off_s} s: {} m off", simulation.worst_m);
        }
    }
}
