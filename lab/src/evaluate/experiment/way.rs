//! How a robot goes from pose to pose. Out: its motions, each in the frame of the pose before.

use map::pose2::{Pose2, wrap_rad};

/// Longest motion.
const STEP_M: f64 = 0.1;
const STEP_RAD: f64 = 0.12;

/// Turns to a pose, goes there in a straight line, and turns as the pose says.
pub(crate) fn way(from: &Pose2, to: &Pose2) -> Vec<Pose2> {
    let mut way = Way { at: *from, motions: Vec::new() };
    let there = to.position() - from.position();
    if there.norm() > STEP_M {
        way.turn_to(there.y.atan2(there.x));
    }
    let motion = way.at.between(to);
    let count = (motion.position().norm() / STEP_M).ceil().max(1.0);
    for _ in 0..count as usize {
        way.step(Pose2::new(motion.x_m / count, motion.y_m / count, 0.0));
    }
    way.turn_to(to.theta_rad);
    way.motions
}

struct Way {
    at: Pose2,
    motions: Vec<Pose2>,
}

impl Way {
    fn turn_to(&mut self, heading_rad: f64) {
        let turn = wrap_rad(heading_rad - self.at.theta_rad);
        let count = (turn.abs() / STEP_RAD).ceil().max(1.0);
        for _ in 0..count as usize {
            self.step(Pose2::new(0.0, 0.0, turn / count));
        }
    }

    fn step(&mut self, motion: Pose2) {
        self.at = self.at.compose(&motion);
        self.motions.push(motion);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_way_ends_where_it_is_to_in_short_motions() {
        let (from, to) = (Pose2::new(1.0, 2.0, 0.3), Pose2::new(-3.0, 2.5, -2.0));
        let motions = way(&from, &to);
        let end = motions.iter().fold(from, |at, motion| at.compose(motion));
        assert!(
            (end.position() - to.position()).norm() < 1e-9
                && wrap_rad(end.theta_rad - to.theta_rad).abs() < 1e-9
        );
        assert!(
            motions
                .iter()
                .all(|m| m.position().norm() <= STEP_M + 1e-9 && m.theta_rad.abs() <= STEP_RAD + 1e-9)
        );
    }
}
