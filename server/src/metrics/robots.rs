//! Metrics of robots, frames and maps. Series by robot and by map are those of the registered ones,
//! which the settings bound.

use super::exposition::Exposition;
use crate::http::App;
use protos::Name;
use std::time::{Duration, Instant};

/// Writes the families of frames.
pub(super) fn write_frames(all: &mut Exposition<'_>, app: &App, now: Instant) {
    let counts = app.slots.counts();
    all.counter("waymark_frames_received_total", "Frames that arrived.").value(&[], counts.received);
    all.counter(
        "waymark_frames_total",
        "Frames by how they ended; with those waiting and in work, all received.",
    )
    .value(&[("outcome", "processed")], counts.processed)
    .value(&[("outcome", "superseded")], counts.superseded)
    .value(&[("outcome", "expired")], counts.expired)
    .value(&[("outcome", "rejected")], counts.rejected_total());
    let mut rejected = all.counter("waymark_frames_rejected_total", "Refused frames by code.");
    for (code, count) in &counts.rejected {
        rejected.value(&[("code", code.as_str())], *count);
    }
    all.gauge("waymark_frames_waiting", "Frames that wait for a worker.").value(&[], counts.waiting);
    all.gauge("waymark_frames_in_work", "Frames in work.").value(&[], counts.in_work);
    let oldest = app.slots.oldest_wait(now).unwrap_or_default();
    all.gauge(
        "waymark_frame_oldest_wait_seconds",
        "Time that the oldest waiting frame has waited; 0 without one.",
    )
    .value(&[], oldest.as_secs_f64());
    all.gauge("waymark_cameras", "Cameras with a slot.").value(&[], app.slots.cameras());
    let missed = app.slots.missed();
    all.counter("waymark_frames_missed_total", "Frames whose numbers were left out: sent, and not arrived.")
        .value(&[], missed.total);
    let mut by_robot = all.counter("waymark_robot_frames_missed_total", "The same by robot.");
    for (robot, count) in missed.by_robot {
        if app.store.snapshots().robot_map(robot.as_str()).is_some() {
            by_robot.value(&[("robot", robot.as_str())], count);
        }
    }
    let mut latency =
        all.histogram("waymark_frame_duration_seconds", "From receipt of a frame to its answer, by status.");
    for (status, times) in app.frame_times.latencies() {
        latency.times(&[("status", status)], &times);
    }
    let mut stages = all.histogram("waymark_frame_stage_duration_seconds", "Stages of the work on frames.");
    for (stage, times) in app.frame_times.stage_times() {
        stages.times(&[("stage", &stage)], &times);
    }
}

/// Writes the families of other messages.
pub(super) fn write_messages(all: &mut Exposition<'_>, app: &App) {
    let (odometry, scans) = app.motion.counts();
    let kinds = [("odometry", odometry), ("scan", scans), ("capture_time", app.motion.frame_stamps())];
    let mut accepted = all.counter(
        "waymark_messages_accepted_total",
        "Messages that were taken; capture_time: frames whose capture time is used.",
    );
    for (kind, counts) in &kinds {
        accepted.value(&[("kind", kind)], counts.accepted);
    }
    let mut rejected = all.counter("waymark_messages_rejected_total", "The same, refused, by code.");
    for (kind, counts) in &kinds {
        for (code, count) in &counts.rejected {
            rejected.value(&[("kind", kind), ("code", code.as_str())], *count);
        }
    }
    all.gauge("waymark_scans_waiting", "Scans that wait for the laser thread.")
        .value(&[], app.motion.scans().waiting());
}

/// Writes the families of robots.
pub(super) fn write_robots(all: &mut Exposition<'_>, app: &App, now: Instant) {
    let names = app.store.snapshots().robots().into_keys().filter_map(|name| Name::new(name).ok());
    let robots: Vec<_> = names
        .map(|name| {
            let is_connected = app.motion.epochs().status(&name, now).alive;
            let activity = app.live.activity(&name, now);
            (name, is_connected, activity)
        })
        .collect();
    all.gauge("waymark_robots", "Registered robots.").value(&[], robots.len());
    let mut connected = all.gauge("waymark_robot_connected", "1 while the robot's software is connected.");
    for (robot, is_connected, _) in &robots {
        connected.value(&[("robot", robot.as_str())], u32::from(*is_connected));
    }
    let mut answered = all.counter("waymark_robot_frames_answered_total", "Answered frames by robot.");
    for (robot, _, activity) in &robots {
        answered.known(&[("robot", robot.as_str())], activity.as_ref().map(|a| a.answered));
    }
    let seconds = |ago: Option<Duration>| ago.map(|ago| ago.as_secs_f64());
    let mut message = all.gauge(
        "waymark_robot_last_message_age_seconds",
        "Time since the robot's last message; absent before the first.",
    );
    for (robot, _, activity) in &robots {
        message.known(&[("robot", robot.as_str())], seconds(activity.as_ref().and_then(|a| a.last_message)));
    }
    let mut fix = all.gauge(
        "waymark_robot_last_fix_age_seconds",
        "Time since the robot's last fix by landmarks; absent before the first.",
    );
    for (robot, _, activity) in &robots {
        fix.known(&[("robot", robot.as_str())], seconds(activity.as_ref().and_then(|a| a.last_fix)));
    }
}

/// Writes the families of maps.
pub(super) fn write_maps(all: &mut Exposition<'_>, app: &App) {
    let maps = app.store.snapshots().all();
    let mut versions = all.gauge("waymark_map_version", "Version of the map that is in use.");
    for map in &maps {
        versions.value(&[("map", &map.name)], map.version);
    }
    let mut landmarks = all.gauge("waymark_map_landmarks", "Landmarks of the map.");
    for map in &maps {
        landmarks.value(&[("map", &map.name)], map.landmarks.len());
    }
    let unused = app.store.vitals().all_unpublished().len();
    all.gauge("waymark_maps_not_in_use", "Maps whose stored version is not in use.").value(&[], unused);
    all.counter("waymark_publications_total", "Published versions of maps.")
        .value(&[], app.store.snapshots().publications());
}
