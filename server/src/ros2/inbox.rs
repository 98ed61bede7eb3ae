//! What waits for the thread of one robot: messages and tokens of the robot, answers and poses for
//! it. Bounded; whoever puts something in never waits.

use protos::{Name, v1};
use std::{
    collections::{BTreeMap, VecDeque},
    sync::{Condvar, Mutex, MutexGuard, PoisonError},
};
use zenoh::sample::Sample;

/// Most events that wait besides images: a second of a robot with many joints.
const MAX_WAITING: usize = 1024;

/// Something for the thread of a robot.
#[derive(Debug)]
pub(super) enum Event {
    /// A message on a topic, by its place in the settings.
    Message(usize, Sample),
    /// A liveliness token of the robot's graph appeared (true) or went.
    Token(String, bool),
    /// A publisher that keeps samples for late subscribers appeared, on a topic.
    Cache(usize, String),
    /// An answer to a frame of a camera.
    Answer(Name, Box<v1::Answer>),
    /// A fused pose.
    Pose(Box<v1::RobotPose>),
}

/// What was put in was not taken, or something else had to go for it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Dropped {
    /// It does not fit.
    Full,
    /// A newer image of the same topic replaced the one that waited.
    Superseded,
}

#[derive(Debug, Default)]
struct Waiting {
    events: VecDeque<Event>,
    /// The newest image of each topic.
    images: BTreeMap<usize, Sample>,
    is_closed: bool,
}

/// The queue.
#[derive(Debug, Default)]
pub(super) struct Inbox {
    waiting: Mutex<Waiting>,
    wake: Condvar,
}

impl Inbox {
    fn lock(&self) -> MutexGuard<'_, Waiting> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn put(&self, event: Event) -> Result<(), Dropped> {
        let mut waiting = self.lock();
        if waiting.events.len() >= MAX_WAITING || waiting.is_closed {
            return Err(Dropped::Full);
        }
        waiting.events.push_back(event);
        drop(waiting);
        self.wake.notify_one();
        Ok(())
    }

    /// An image: only the newest of a topic waits, and images wait until everything else is done,
    /// so that transforms and odometry that came before them are there.
    pub(super) fn put_image(&self, topic: usize, image: Sample) -> Result<(), Dropped> {
        let mut waiting = self.lock();
        if waiting.is_closed {
            return Err(Dropped::Full);
        }
        let former = waiting.images.insert(topic, image);
        drop(waiting);
        self.wake.notify_one();
        if former.is_some() { Err(Dropped::Superseded) } else { Ok(()) }
    }

    /// The next event; `None` once closed.
    pub(super) fn next(&self) -> Option<Event> {
        let mut waiting = self.lock();
        loop {
            if waiting.is_closed {
                return None;
            }
            if let Some(event) = waiting.events.pop_front() {
                return Some(event);
            }
            if let Some((topic, image)) = waiting.images.pop_first() {
                return Some(Event::Message(topic, image));
            }
            waiting = self.wake.wait(waiting).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Lets the thread end. What waits is dropped.
    pub(super) fn close(&self) {
        self.lock().is_closed = true;
        self.wake.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use zenoh::sample::SampleBuilder;

    fn image(text: &str) -> Sample {
        let key = zenoh::key_expr::KeyExpr::new("0/image").unwrap();
        SampleBuilder::put(key, text.to_owned()).into()
    }

    fn token(number: usize) -> Event {
        Event::Token(number.to_string(), true)
    }

    #[test]
    fn the_newest_image_waits_behind_everything_else() {
        let inbox = Inbox::default();
        assert_eq!(inbox.put_image(3, image("old")), Ok(()));
        assert_eq!(inbox.put_image(3, image("new")), Err(Dropped::Superseded));
        inbox.put(token(1)).unwrap();
        assert!(matches!(inbox.next(), Some(Event::Token(..))));
        let Some(Event::Message(3, sample)) = inbox.next() else { panic!("an image") };
        assert_eq!(sample.payload().try_to_string().unwrap(), "new");
    }

    #[test]
    fn the_queue_is_bounded_and_ends() {
        let inbox = Inbox::default();
        for i in 0..MAX_WAITING {
            inbox.put(token(i)).unwrap();
        }
        assert_eq!(inbox.put(token(0)), Err(Dropped::Full));
        inbox.close();
        assert!(inbox.next().is_none());
        assert_eq!(inbox.put_image(0, image("late")), Err(Dropped::Full));
    }
}
