//! The fusion of one robot in one map: a window of events, replayed when a late one arrives.

use crate::{
    check::{self, OutOfRange},
    fuse::{
        belief::SystematicOdometryError,
        filter::Filter,
        outcome::{FixOutcome, FixRole, FusedPose, OdometryOutcome},
        params::FuseParams,
        replay::{Event, Step, apply, reach},
        rules::Rules,
    },
    localise::Fix,
    modality_stats::ModalityMap,
    pose2::{Pose2, Pose2Covariance},
};
use std::sync::Arc;

/// Most odometry readings and fixes kept for replay, whatever the window.
pub const MAX_EVENTS: usize = 1024;

/// Fuses odometry and fixes of one robot in one map.
#[derive(Debug, Clone)]
pub struct Fuser {
    rules: Rules,
    /// State just before the first kept event.
    anchor: Filter,
    /// Time of the last odometry in `anchor`, ns.
    anchor_ns: Option<i64>,
    /// Kept events by time; odometry before a fix of the same time.
    pub(super) events: Vec<(i64, Event)>,
    /// State after the first `applied` events.
    now: Filter,
    now_ns: Option<i64>,
    applied: usize,
}

impl Fuser {
    /// A fusion without pose.
    pub fn new(params: FuseParams) -> Self {
        Self {
            rules: Rules { params, areas: Arc::default() },
            anchor: Filter::default(),
            anchor_ns: None,
            events: Vec::new(),
            now: Filter::default(),
            now_ns: None,
            applied: 0,
        }
    }

    /// Applies these modality statistics to later and replayed events.
    pub fn set_modality_map(&mut self, areas: Arc<ModalityMap>) {
        self.rules.areas = areas;
    }

    /// Sets the pose at the last odometry and forgets everything before.
    pub fn start(&mut self, map_from_robot: &Pose2Covariance) -> Result<(), OutOfRange> {
        map_from_robot.check()?;
        self.now.start(map_from_robot, &self.rules.params);
        self.events.drain(..self.applied);
        self.applied = 0;
        (self.anchor, self.anchor_ns) = (self.now.clone(), self.now_ns);
        Ok(())
    }

    /// The fused pose at the last odometry.
    pub fn pose(&self) -> Option<FusedPose> {
        let (at_ns, pose) = (self.now_ns?, self.now.pose()?);
        let (corrections, contradictions) = (self.now.corrections, self.now.doubts());
        let laser_corrections = self.now.laser_corrections;
        Some(FusedPose { at_ns, pose, corrections, laser_corrections, contradictions })
    }

    /// Estimate of the systematic odometry errors; `None` before the first pose.
    pub fn odometry_errors(&self) -> Option<SystematicOdometryError> {
        self.now.odometry_errors()
    }

    /// The pose at a time within the window, by earlier events only: the prior of a frame.
    pub fn pose_at(&self, at_ns: i64) -> Option<Pose2Covariance> {
        if self.now_ns == Some(at_ns) && self.events.last().is_none_or(|(t, _)| *t <= at_ns) {
            return self.now.pose();
        }
        let (mut filter, mut filter_ns) = (self.anchor.clone(), self.anchor_ns);
        let end = self.events.partition_point(|(t, _)| *t <= at_ns);
        for i in 0..end {
            apply(&mut filter, &mut filter_ns, &self.events, i, &self.rules);
        }
        reach(&mut filter, &mut filter_ns, &self.events[end..], at_ns, &self.rules)?;
        filter.pose()
    }

    /// Applies an odometry reading.
    pub fn apply_odometry(
        &mut self,
        at_ns: i64,
        odom_from_robot: Pose2,
    ) -> Result<OdometryOutcome, OutOfRange> {
        self.apply_odometry_after(at_ns, odom_from_robot, 0.0)
    }

    /// Applies an odometry reading that was received `elapsed_s` after the one before it. The
    /// longer of stamped and received time counts, so that a slightly wrong stamp is not taken for
    /// a jump.
    pub fn apply_odometry_after(
        &mut self,
        at_ns: i64,
        odom_from_robot: Pose2,
        elapsed_s: f64,
    ) -> Result<OdometryOutcome, OutOfRange> {
        odom_from_robot.check()?;
        let known = |(t, e): &(i64, Event)| *t == at_ns && matches!(e, Event::Odometry(_));
        if self.is_too_old(at_ns) || self.anchor_ns == Some(at_ns) || self.events.iter().any(known) {
            return Ok(OdometryOutcome::TooOld);
        }
        if self.jumps(at_ns, &odom_from_robot, elapsed_s) {
            self.restart(at_ns, &odom_from_robot);
            return Ok(OdometryOutcome::Jumped);
        }
        self.insert(at_ns, Event::Odometry(odom_from_robot));
        Ok(OdometryOutcome::Moved)
    }

    /// Starts the window again after the robot's clock was set: `odom_from_robot` was received
    /// `elapsed_s` after the last reading and has the new time `at_ns`. Odometry carries the pose
    /// along, unless the robot cannot have moved so far. Replayable events and waiting fixes are
    /// forgotten.
    pub fn set_clock(
        &mut self,
        at_ns: i64,
        odom_from_robot: Pose2,
        elapsed_s: f64,
    ) -> Result<OdometryOutcome, OutOfRange> {
        odom_from_robot.check()?;
        if self.is_too_far(&odom_from_robot, elapsed_s) {
            self.restart(at_ns, &odom_from_robot);
            return Ok(OdometryOutcome::Jumped);
        }
        self.now.predict(&odom_from_robot, &self.rules);
        self.begin_window(at_ns);
        Ok(OdometryOutcome::Moved)
    }

    /// Removes the odometry reading of this time, which proved wrong. Odometry is cumulative, so
    /// the next reading contains its motion. No effect if the reading cannot be replayed any more.
    pub fn retract(&mut self, at_ns: i64) {
        let found = self.events.iter().position(|(t, e)| *t == at_ns && matches!(e, Event::Odometry(_)));
        let Some(place) = found else { return };
        self.events.remove(place);
        if place < self.applied {
            (self.now, self.now_ns, self.applied) = (self.anchor.clone(), self.anchor_ns, 0);
            self.advance(usize::MAX);
        }
    }

    /// The pose by an odometry reading that is newer than that of [`Self::pose`] although its time
    /// is not.
    pub fn pose_by(&self, at_ns: i64, odom_from_robot: &Pose2) -> Option<FusedPose> {
        let mut filter = self.now.clone();
        filter.predict(odom_from_robot, &self.rules);
        Some(FusedPose { at_ns, pose: filter.pose()?, ..self.pose()? })
    }

    /// Applies a fix that was made without the pose, at the capture time of its frame.
    pub fn apply_fix(&mut self, at_ns: i64, fix: &Fix) -> Result<FixOutcome, OutOfRange> {
        self.apply_fix_as(at_ns, fix, FixRole::Independent)
    }

    /// As [`Fuser::apply_fix`], with a role.
    pub fn apply_fix_as(&mut self, at_ns: i64, fix: &Fix, role: FixRole) -> Result<FixOutcome, OutOfRange> {
        fix.pose.check()?;
        check::covariance("noise", &fix.noise)?;
        for nuisance in &fix.nuisances {
            check::covariance("nuisance.covariance", &nuisance.covariance)?;
            if let Some(value) = nuisance.jacobian.iter().find(|v| !v.is_finite()) {
                return Err(OutOfRange { field: "nuisance.jacobian", value: *value });
            }
        }
        if self.is_too_old(at_ns) {
            return Ok(FixOutcome::TooOld);
        }
        Ok(self.insert(at_ns, Event::Fix(Box::new(fix.clone()), role)).unwrap_or(FixOutcome::Waiting))
    }

    /// Forgets all but the counts: the pose is unknown.
    fn restart(&mut self, at_ns: i64, odom_from_robot: &Pose2) {
        self.now.lose(odom_from_robot);
        self.begin_window(at_ns);
    }

    /// Starts the replay window here.
    fn begin_window(&mut self, at_ns: i64) {
        self.now_ns = Some(at_ns);
        self.events.clear();
        self.applied = 0;
        (self.anchor, self.anchor_ns) = (self.now.clone(), self.now_ns);
    }

    /// Whether a time is before every event that can be replayed.
    fn is_too_old(&self, at_ns: i64) -> bool {
        self.anchor_ns.is_some_and(|t| at_ns < t)
    }

    /// Whether the newest reading cannot follow the one before it.
    fn jumps(&self, at_ns: i64, odom_from_robot: &Pose2, elapsed_s: f64) -> bool {
        let Some(t) = self.now_ns else { return false };
        let stamped_s = at_ns.saturating_sub(t) as f64 * 1e-9;
        at_ns > t && self.is_too_far(odom_from_robot, stamped_s.max(elapsed_s))
    }

    /// Whether the robot cannot have moved so far since the last reading.
    fn is_too_far(&self, odom_from_robot: &Pose2, elapsed_s: f64) -> bool {
        let Some(before) = self.now.odometry() else { return false };
        // A little slack for jitter of the clock.
        let limit = self.rules.params.max_speed_mps * (elapsed_s + 0.1);
        before.between(odom_from_robot).position().norm() > limit
    }

    /// Inserts an event by time and updates `now`. Gives its outcome if it was applied.
    fn insert(&mut self, at_ns: i64, event: Event) -> Option<FixOutcome> {
        let rank = |t: i64, e: &Event| (t, matches!(e, Event::Fix(..)));
        let key = rank(at_ns, &event);
        let place = self.events.partition_point(|(t, e)| rank(*t, e) <= key);
        self.events.insert(place, (at_ns, event));
        if place < self.applied {
            (self.now, self.now_ns, self.applied) = (self.anchor.clone(), self.anchor_ns, 0);
        }
        let outcome = self.advance(place);
        self.prune();
        outcome
    }

    /// Applies pending events; gives the outcome of the event at `place`.
    fn advance(&mut self, place: usize) -> Option<FixOutcome> {
        let mut outcome = None;
        while self.applied < self.events.len() {
            match apply(&mut self.now, &mut self.now_ns, &self.events, self.applied, &self.rules) {
                Step::Fixed(result) if self.applied == place => outcome = Some(result),
                Step::Fixed(_) | Step::Moved => {}
                Step::Waits => break,
            }
            self.applied += 1;
        }
        outcome
    }

    /// Moves the anchor past events outside of the window or beyond the limit.
    fn prune(&mut self) {
        let newest = self.events.last().map_or(0, |(t, _)| *t);
        let oldest = newest.saturating_sub((self.rules.params.window_s * 1e9) as i64);
        let mut gone = 0;
        // The last odometry stays: later fixes are interpolated from it.
        while gone + 1 < self.applied
            && (self.events[gone].0 < oldest || self.events.len() - gone > MAX_EVENTS)
        {
            apply(&mut self.anchor, &mut self.anchor_ns, &self.events, gone, &self.rules);
            gone += 1;
        }
        self.events.drain(..gone);
        self.applied -= gone;
        // Waiting fixes are bounded too: the oldest are dropped.
        while self.events.len() > MAX_EVENTS {
            self.events.remove(self.applied);
        }
    }
}
