//! Applies odometry and fixes to a filter in the order of their capture.

use crate::{
    fuse::{
        filter::Filter,
        outcome::{FixOutcome, FixRole},
        rules::Rules,
    },
    localise::Fix,
    pose2::{Pose2, wrap_rad},
};
use nalgebra::Vector3;

#[derive(Debug, Clone)]
pub(super) enum Event {
    Odometry(Pose2),
    Fix(Box<Fix>, FixRole),
}

/// Result of applying an event.
pub(super) enum Step {
    /// Odometry moved the filter.
    Moved,
    /// A fix was applied or refused.
    Fixed(FixOutcome),
    /// A fix waits for odometry.
    Waits,
}

/// Applies event `i`.
pub(super) fn apply(
    filter: &mut Filter,
    filter_ns: &mut Option<i64>,
    events: &[(i64, Event)],
    i: usize,
    rules: &Rules,
) -> Step {
    let (at_ns, event) = &events[i];
    match event {
        Event::Odometry(pose) => {
            filter.predict(pose, rules);
            *filter_ns = Some(*at_ns);
            Step::Moved
        }
        Event::Fix(fix, role) => {
            let odometry_follows = events[i..].iter().any(|(_, e)| matches!(e, Event::Odometry(_)));
            if filter.odometry().is_none() && odometry_follows {
                // The motion from here to the first odometry is unknown.
                return Step::Fixed(FixOutcome::TooOld);
            }
            match reach(filter, filter_ns, &events[i + 1..], *at_ns, rules) {
                Some(()) => Step::Fixed(filter.correct(fix, *role, rules)),
                None => Step::Waits,
            }
        }
    }
}

/// Moves the filter on to `at_ns`, between its last odometry and the next one among the `later`
/// events. `None` if there is no later odometry.
pub(super) fn reach(
    filter: &mut Filter,
    filter_ns: &mut Option<i64>,
    later: &[(i64, Event)],
    at_ns: i64,
    rules: &Rules,
) -> Option<()> {
    let (from_ns, from) = ((*filter_ns)?, *filter.odometry()?);
    if from_ns == at_ns {
        return Some(());
    }
    let next = later.iter().find_map(|(t, e)| match e {
        Event::Odometry(pose) => Some((*t, pose)),
        Event::Fix(..) => None,
    });
    let (to_ns, to) = next?;
    if at_ns < from_ns || to_ns <= from_ns {
        return None;
    }
    let share = at_ns.saturating_sub(from_ns) as f64 / to_ns.saturating_sub(from_ns) as f64;
    let d = to.minus(&from);
    let turn = wrap_rad(d.z) * share;
    filter.predict(&from.plus(&Vector3::new(d.x * share, d.y * share, turn)), rules);
    *filter_ns = Some(at_ns);
    Some(())
}
