//! Incoming messages: one subscription for each kind, with a callback that parses the key, checks
//! the message and passes it on. A refused frame is answered; every refusal is counted. Nothing
//! here waits or panics.

use super::{BusError, Outbox, Receivers, caught};
use crate::fleet::Responsibility;
use engine::{
    intake::{FrameKind, refusal_unread},
    panics::Edge,
    slots::SlotKey,
    workers::{Publish, failed},
};
use protos::{Key, Keys, Name, named_map, prost::bytes::Bytes, v1};
use std::{cell::LazyCell, sync::Arc, time::Instant};
use zenoh::{
    Session,
    pubsub::Subscriber,
    sample::{Sample, SampleKind},
};

pub(super) async fn subscribe(
    session: &Session,
    keys: &Keys,
    to: &Receivers,
    outbox: &Outbox,
) -> Result<Vec<Subscriber<()>>, BusError> {
    let declared = |kind| move |e: zenoh::Error| BusError::Declare { action: kind, detail: e.to_string() };
    let frames = {
        let (keys, to, outbox) = (keys.clone(), to.clone(), outbox.clone());
        move |sample: Sample| frame(&keys, &to, &outbox, &sample)
    };
    let odometry = {
        let (keys, to, outbox) = (keys.clone(), to.clone(), outbox.clone());
        move |sample: Sample| {
            let Ok(Key::Odometry(robot)) = keys.parse(sample.key_expr().as_str()) else { return };
            let message = bytes(&sample);
            if accepts(&to, &robot, || named_map::of_odometry(&message))
                && let Some(pose) = to.motion.odometry(&robot, message.clone(), Instant::now())
            {
                outbox.pose(&robot, &pose);
            }
        }
    };
    let scans = {
        let (keys, to) = (keys.clone(), to.clone());
        move |sample: Sample| {
            let Ok(Key::Scan(robot)) = keys.parse(sample.key_expr().as_str()) else { return };
            let message = bytes(&sample);
            if accepts(&to, &robot, || named_map::of_scan(&message)) {
                to.motion.scan(&robot, message, Instant::now());
            }
        }
    };
    let alive = {
        let (keys, to) = (keys.clone(), to.clone());
        move |sample: Sample| {
            if let Ok(Key::Alive(robot, slot)) = keys.parse(sample.key_expr().as_str()) {
                announce_presence(&to, &robot, (slot, sample.kind() == SampleKind::Put));
            }
        }
    };
    let quads =
        session.declare_subscriber(keys.all_quads()).callback(caught(&to.vitals, "quads", frames.clone()));
    let frames = session.declare_subscriber(keys.all_frames()).callback(caught(&to.vitals, "frame", frames));
    let odometry =
        session.declare_subscriber(keys.all_odometry()).callback(caught(&to.vitals, "odometry", odometry));
    let scans = session.declare_subscriber(keys.all_scans()).callback(caught(&to.vitals, "scan", scans));
    let alive = session
        .liveliness()
        .declare_subscriber(keys.all_alive())
        .history(true)
        .callback(caught(&to.vitals, "presence", alive));
    Ok(vec![
        odometry.await.map_err(declared("subscribe to odometry"))?,
        scans.await.map_err(declared("subscribe to scans"))?,
        alive.await.map_err(declared("watch robots"))?,
        frames.await.map_err(declared("subscribe to frames"))?,
        quads.await.map_err(declared("subscribe to quads"))?,
    ])
}

/// Whether this server takes a message that is not answered.
fn accepts(to: &Receivers, robot: &Name, map: impl FnOnce() -> String) -> bool {
    to.admits(robot) && to.responsibility(robot, map) == Responsibility::Take
}

/// A liveliness token of a robot, in this slot, appeared or went.
pub(crate) fn announce_presence(to: &Receivers, robot: &Name, token: (u8, bool)) {
    let map_of = |robot: &Name| to.intake.snapshots.robot_map(robot.as_str());
    let is_registered = |robot: &Name| map_of(robot).is_some();
    let came = to.motion.epochs().token(robot, token, Instant::now(), is_registered);
    let Some(alive) = came else { return };
    let map = map_of(robot);
    match (&map, alive) {
        (Some(map), true) => tracing::info!(%robot, map, "robot_connected"),
        (Some(map), false) => tracing::info!(%robot, map, "robot_disconnected"),
        (None, _) => tracing::debug!(%robot, alive, "robot_not_registered"),
    }
    to.live.presence(robot, map, alive);
}

fn frame(keys: &Keys, to: &Receivers, outbox: &Outbox, sample: &Sample) {
    let key = sample.key_expr().as_str();
    let attached = sample.attachment().map(|attached| attached.to_bytes());
    let (kind, robot, camera) = match keys.received(key, attached.as_deref()) {
        Ok(Key::Frame(robot, camera)) => (FrameKind::Image, robot, camera),
        Ok(Key::Quads(robot, camera)) => (FrameKind::Quads, robot, camera),
        _ => {
            // No camera is named, so there is nobody to answer.
            tracing::debug!(key, "frame_key_invalid");
            return to.intake.slots.refuse(protos::Code::BadName);
        }
    };
    take_frame(to, outbox, kind, &SlotKey { robot, camera }, &bytes(sample));
}

/// Passes a message of a camera image to the intake. A refusal is answered.
pub(crate) fn take_frame(to: &Receivers, outbox: &Outbox, kind: FrameKind, slot: &SlotKey, message: &Bytes) {
    let _span = tracing::debug_span!("camera", robot = %slot.robot, camera = %slot.camera).entered();
    let head = LazyCell::new(|| kind.head(message));
    match to.responsibility(&slot.robot, || head.map.clone()) {
        Responsibility::Take => {}
        Responsibility::Silent => return,
        Responsibility::Refuse(rejection) => {
            to.intake.slots.refuse(rejection.code);
            return refuse(to, outbox, slot, refusal_unread(&head, &rejection));
        }
    }
    if !to.admits(&slot.robot) {
        tracing::debug!(?slot, "frame_of_a_revoked_robot");
        return to.intake.slots.refuse(protos::Code::UnknownRobot);
    }
    let panics = to.vitals.panics();
    let follows = "it is refused as internal";
    let received = panics.catch(Edge::Message, "frame", follows, || {
        to.intake.take(kind, slot.clone(), message.clone(), Instant::now())
    });
    // The answer to a frame on which the intake panicked.
    let internal = || Err(Box::new(refusal_unread(&head, &failed())));
    if let Err(answer) = received.unwrap_or_else(internal) {
        refuse(to, outbox, slot, *answer);
    }
}

/// Answers with a refusal, which is counted already.
fn refuse(to: &Receivers, outbox: &Outbox, slot: &SlotKey, answer: v1::Answer) {
    tracing::debug!(?slot, rejection = ?answer.rejection, "frame_refused");
    let answer = Arc::new(answer);
    to.live.publish_refusal(slot, answer.clone(), Instant::now());
    // Last, so that who has the answer finds it counted.
    outbox.answer(slot, &answer);
}

fn bytes(sample: &Sample) -> Bytes {
    Bytes::from(sample.payload().to_bytes().into_owned())
}
