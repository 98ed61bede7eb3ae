//! Laser scans that wait to be matched with the walls: one a robot, the newest wins, robots take
//! turns. In: checked scans from the transport's threads, which never wait. Out: work for the laser
//! thread.

use crate::scan_job::ScanJob;
use protos::Name;
use std::{
    collections::{BTreeMap, VecDeque},
    sync::{Condvar, Mutex, MutexGuard, PoisonError},
};

#[derive(Debug, Default)]
struct State {
    waiting: BTreeMap<Name, ScanJob>,
    /// Robots with a waiting scan, in turn.
    turn: VecDeque<Name>,
    closed: bool,
}

/// The waiting scans of all robots. Bounded by the number of robots.
#[derive(Debug, Default)]
pub struct Scans {
    state: Mutex<State>,
    ready: Condvar,
}

impl Scans {
    /// Queues a robot's scan; true if it supersedes one that waited.
    pub fn offer(&self, robot: &Name, job: ScanJob) -> bool {
        let mut state = self.lock();
        if state.closed {
            return false;
        }
        let superseded = state.waiting.insert(robot.clone(), job).is_some();
        if !superseded {
            state.turn.push_back(robot.clone());
            self.ready.notify_one();
        }
        superseded
    }

    /// The next scan in turn; waits for one. `None` after [`Scans::close`].
    pub fn take(&self) -> Option<(Name, ScanJob)> {
        let mut state = self.lock();
        loop {
            if state.closed {
                return None;
            }
            if let Some(robot) = state.turn.pop_front()
                && let Some(job) = state.waiting.remove(&robot)
            {
                return Some((robot, job));
            }
            state = self.ready.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Scans that wait.
    pub fn waiting(&self) -> usize {
        self.lock().waiting.len()
    }

    /// Ends the wait and drops the scans that wait.
    pub fn close(&self) {
        let mut state = self.lock();
        (state.closed, state.waiting, state.turn) = (true, BTreeMap::new(), VecDeque::new());
        self.ready.notify_all();
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // No code inside can panic halfway through a change.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use map::{laser::Scan, pose2::Pose2};

    #[test]
    fn the_newest_wins_and_robots_take_turns() {
        let scans = Scans::default();
        let name = |text: &str| Name::new(text).unwrap();
        let job = |captured_ns| ScanJob {
            map: "hall".into(),
            epoch: 1,
            captured_ns,
            odom_from_robot: Pose2::default(),
            scan: Scan::new(Pose2::default(), 0.0, 0.1, 9.0, vec![1.0; 3]).unwrap(),
        };
        assert!(!scans.offer(&name("a"), job(1)));
        assert!(scans.offer(&name("a"), job(2)));
        assert!(!scans.offer(&name("b"), job(3)));
        let taken = |scans: &Scans| scans.take().map(|(robot, job)| (robot.to_string(), job.captured_ns));
        assert_eq!(taken(&scans), Some(("a".into(), 2)));
        assert!(!scans.offer(&name("a"), job(4)));
        assert_eq!(taken(&scans), Some(("b".into(), 3)));
        assert_eq!(taken(&scans), Some(("a".into(), 4)));
        scans.close();
        assert_eq!((scans.offer(&name("a"), job(5)), scans.take().is_none()), (false, true));
    }
}
