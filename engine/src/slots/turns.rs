//! Whose turn it is: of robots, and of the cameras of each. In: slots with work. Out: the next slot.

use super::SlotKey;
use protos::Name;
use std::collections::{BTreeMap, BTreeSet};

/// Slots with a waiting frame and none in work. The robot whose last turn was longest ago is next, and of its cameras the one
/// whose last turn was: a robot that has always something to do gains nothing on one whose next frame is on its way.
#[derive(Debug, Default)]
pub(super) struct Turns {
    turn: u64,
    /// Last turn of every robot with a slot.
    pub(super) of_robots: BTreeMap<Name, u64>,
    robots: BTreeSet<(u64, Name)>,
    /// Of each of these robots, with the last turn of the camera.
    cameras: BTreeMap<Name, BTreeSet<(u64, Name)>>,
}

impl Turns {
    /// A slot is ready.
    pub(super) fn push(&mut self, SlotKey { robot, camera }: SlotKey, last_turn: u64) {
        let last = *self.of_robots.entry(robot.clone()).or_default();
        self.robots.insert((last, robot.clone()));
        self.cameras.entry(robot).or_default().insert((last_turn, camera));
    }

    /// The next slot, and the number of this turn.
    pub(super) fn pop(&mut self) -> Option<(SlotKey, u64)> {
        let (_, robot) = self.robots.pop_first()?;
        let cameras = self.cameras.get_mut(&robot)?;
        let (_, camera) = cameras.pop_first()?;
        self.turn += 1;
        self.of_robots.insert(robot.clone(), self.turn);
        if cameras.is_empty() {
            self.cameras.remove(&robot);
        } else {
            self.robots.insert((self.turn, robot.clone()));
        }
        Some((SlotKey { robot, camera }, self.turn))
    }

    /// Nothing is ready any more.
    pub(super) fn clear(&mut self) {
        (self.robots, self.cameras) = Default::default();
    }
}
