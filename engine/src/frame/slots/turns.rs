//! Whose frame is next. In: slots with a waiting frame. Out: one after another, robots in turns,
//! then the cameras of each.

use super::SlotKey;
use protos::Name;
use std::collections::{BTreeMap, BTreeSet};

/// Number of a robot's turn, and of the one before; 0 for none.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Turn {
    pub(super) number: u64,
    pub(super) before: u64,
}

/// Slots with a waiting frame and none in work. The robot whose last turn was longest ago is next,
/// and of its cameras the one whose last turn was: a robot that has always something to do gains
/// nothing on one whose next frame is on its way.
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
    pub(super) fn push(&mut self, SlotKey { robot, camera }: SlotKey, last_turn: u64) {
        let last = *self.of_robots.entry(robot.clone()).or_default();
        self.robots.insert((last, robot.clone()));
        self.cameras.entry(robot).or_default().insert((last_turn, camera));
    }

    /// The next slot, and its robot's turn.
    pub(super) fn pop(&mut self) -> Option<(SlotKey, Turn)> {
        let (_, robot) = self.robots.pop_first()?;
        let cameras = self.cameras.get_mut(&robot)?;
        let (_, camera) = cameras.pop_first()?;
        self.turn += 1;
        let before = self.of_robots.insert(robot.clone(), self.turn).unwrap_or_default();
        if cameras.is_empty() {
            self.cameras.remove(&robot);
        } else {
            self.robots.insert((self.turn, robot.clone()));
        }
        Some((SlotKey { robot, camera }, Turn { number: self.turn, before }))
    }

    /// A turn came to nothing: the robot's next frame has the place that this one had. Not where it
    /// has had another turn since.
    pub(super) fn give_back(&mut self, robot: &Name, turn: Turn) {
        let Some(last) = self.of_robots.get_mut(robot).filter(|last| **last == turn.number) else { return };
        if self.robots.remove(&(*last, robot.clone())) {
            self.robots.insert((turn.before, robot.clone()));
        }
        *last = turn.before;
    }

    /// Nothing is ready any more.
    pub(super) fn clear(&mut self) {
        (self.robots, self.cameras) = Default::default();
    }
}
