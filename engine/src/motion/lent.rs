//! A recording that is learnt from. The recording itself stays where it is until what it taught is stored: whatever
//! happens before that, it can be learnt from again.

use super::{
    MotionTracker, own,
    run::{RecordingError, RunRecording},
};
use protos::Name;
use std::sync::{Arc, PoisonError};

/// A copy of a robot's recording. While it lives nobody else gets one; dropping it leaves the recording as it was.
#[derive(Debug)]
pub struct Lent {
    motion: Arc<MotionTracker>,
    robot: Name,
    /// The copy.
    pub recording: Box<RunRecording>,
}

impl MotionTracker {
    /// Lends the recording of a robot. Copies up to some 70 MB: not for an async thread.
    pub fn lend_recording(self: &Arc<Self>, robot: &Name) -> Result<Lent, RecordingError> {
        let followed = self.lock().robots.get(robot).cloned().ok_or(RecordingError::None)?;
        let mut followed = own(&followed);
        let run = followed.run.as_mut().ok_or(RecordingError::None)?;
        if run.lent {
            return Err(RecordingError::Lent);
        }
        run.lent = true;
        Ok(Lent { motion: self.clone(), robot: robot.clone(), recording: run.clone() })
    }

    /// Whether the recording of a robot is lent.
    #[cfg(any(test, feature = "scene"))]
    pub fn is_lent(&self, robot: &Name) -> bool {
        let followed = self.lock().robots.get(robot).cloned();
        followed.is_some_and(|followed| own(&followed).run.as_ref().is_some_and(|run| run.lent))
    }
}

impl Lent {
    /// What it taught is stored: the recording is over, unless it was given up and another has begun meanwhile.
    pub fn learnt(self) {
        let mut recorded = self.motion.recorded.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(followed) = self.motion.lock().robots.get(&self.robot).cloned() else { return };
        let mut followed = own(&followed);
        if followed.run.as_ref().is_some_and(|run| run.number == self.recording.number) {
            followed.run = None;
            recorded.remove(&self.robot);
        }
    }
}

impl Drop for Lent {
    fn drop(&mut self) {
        let Some(followed) = self.motion.lock().robots.get(&self.robot).cloned() else { return };
        if let Some(run) = own(&followed).run.as_mut().filter(|run| run.number == self.recording.number) {
            run.lent = false;
        }
    }
}
