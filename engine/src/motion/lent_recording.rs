//! A recording that is being learnt from. The recording stays where it is until what was learnt is
//! stored: until then it can be learnt from again.

use super::{
    MotionTracker, lock_robot,
    run_recording::{RecordingError, RunRecording},
};
use protos::Name;
use std::sync::{Arc, PoisonError};

/// A copy of a robot's recording. One exists at a time; dropping it leaves the recording as it was.
#[derive(Debug)]
pub struct LentRecording {
    motion: Arc<MotionTracker>,
    robot: Name,
    /// The copy.
    pub recording: Box<RunRecording>,
}

impl MotionTracker {
    /// Lends the recording of a robot. Copies up to some 70 MB: not for an async thread. Errors:
    /// there is none, or it is lent.
    pub fn lend_recording(self: &Arc<Self>, robot: &Name) -> Result<LentRecording, RecordingError> {
        let state = self.lock().robots.get(robot).cloned().ok_or(RecordingError::None)?;
        let mut state = lock_robot(&state);
        let recording = state.recording.as_mut().ok_or(RecordingError::None)?;
        if recording.lent {
            return Err(RecordingError::Lent);
        }
        recording.lent = true;
        Ok(LentRecording { motion: self.clone(), robot: robot.clone(), recording: recording.clone() })
    }

    /// Whether the recording of a robot is lent.
    #[cfg(any(test, feature = "scene"))]
    pub fn is_lent(&self, robot: &Name) -> bool {
        let state = self.lock().robots.get(robot).cloned();
        state.is_some_and(|state| lock_robot(&state).recording.as_ref().is_some_and(|r| r.lent))
    }
}

impl LentRecording {
    /// What was learnt is stored: ends the recording, unless it was cancelled and another has
    /// started.
    pub fn finish(self) {
        let mut recording = self.motion.recording_robots.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(state) = self.motion.lock().robots.get(&self.robot).cloned() else { return };
        let mut state = lock_robot(&state);
        if state.recording.as_ref().is_some_and(|r| r.number == self.recording.number) {
            state.recording = None;
            recording.remove(&self.robot);
        }
    }
}

impl Drop for LentRecording {
    fn drop(&mut self) {
        let Some(state) = self.motion.lock().robots.get(&self.robot).cloned() else { return };
        let mut state = lock_robot(&state);
        if let Some(recording) = state.recording.as_mut().filter(|r| r.number == self.recording.number) {
            recording.lent = false;
        }
    }
}
