//! Exclusive use of a recording while statistics are learnt from it. The recording stays in place
//! until they are stored; if that fails, it can be used again.

use super::{
    MotionTracker, lock_robot,
    run_recording::{RecordingError, RunRecording},
};
use protos::Name;
use std::sync::{Arc, PoisonError};

/// A copy of a robot's recording. One exists at a time; dropping it releases the recording.
#[derive(Debug)]
pub struct ExclusiveRecording {
    motion: Arc<MotionTracker>,
    robot: Name,
    /// The copy.
    pub recording: Box<RunRecording>,
}

impl MotionTracker {
    /// Copies the recording of a robot, up to about 70 MB: not for an async thread. Errors: there
    /// is none, or it is in use.
    pub fn lend_recording(self: &Arc<Self>, robot: &Name) -> Result<ExclusiveRecording, RecordingError> {
        let state = self.lock().robots.get(robot).cloned().ok_or(RecordingError::None)?;
        let mut state = lock_robot(&state);
        let recording = state.recording.as_mut().ok_or(RecordingError::None)?;
        if recording.lent {
            return Err(RecordingError::Lent);
        }
        recording.lent = true;
        Ok(ExclusiveRecording { motion: self.clone(), robot: robot.clone(), recording: recording.clone() })
    }

    /// Whether the recording of a robot is lent.
    #[cfg(any(test, feature = "scene"))]
    pub fn is_lent(&self, robot: &Name) -> bool {
        let state = self.lock().robots.get(robot).cloned();
        state.is_some_and(|state| lock_robot(&state).recording.as_ref().is_some_and(|r| r.lent))
    }
}

impl ExclusiveRecording {
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

impl Drop for ExclusiveRecording {
    fn drop(&mut self) {
        let Some(state) = self.motion.lock().robots.get(&self.robot).cloned() else { return };
        let mut state = lock_robot(&state);
        if let Some(recording) = state.recording.as_mut().filter(|r| r.number == self.recording.number) {
            recording.lent = false;
        }
    }
}
