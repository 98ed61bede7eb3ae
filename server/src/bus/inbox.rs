//! What comes in: one subscription per kind of message, each with a callback that parses the key, checks and hands
//! over. A message that is refused costs its sender an answer and us a counter; nothing here waits or panics.

use super::{BusError, Outbox, Receivers};
use crate::engine::{slots::SlotKey, workers::Publish};
use protos::{Key, Keys, prost::bytes::Bytes};
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
            if let Ok(Key::Odometry(robot)) = keys.parse(sample.key_expr().as_str())
                && let Some(pose) = to.motion.odometry(&robot, bytes(&sample))
            {
                outbox.pose(&robot, &pose);
            }
        }
    };
    let scans = {
        let (keys, to) = (keys.clone(), to.clone());
        move |sample: Sample| {
            if let Ok(Key::Scan(robot)) = keys.parse(sample.key_expr().as_str()) {
                to.motion.scan(&robot, bytes(&sample));
            }
        }
    };
    let alive = {
        let (keys, to) = (keys.clone(), to.clone());
        move |sample: Sample| {
            if let Ok(Key::Alive(robot)) = keys.parse(sample.key_expr().as_str()) {
                let map = to.intake.snapshots.robot_map(robot.as_str());
                let alive = sample.kind() == SampleKind::Put;
                tracing::info!(%robot, alive, "robot");
                to.live.presence(&robot, map, alive);
            }
        }
    };
    let frames = session.declare_subscriber(keys.all_frames()).callback(frames);
    let odometry = session.declare_subscriber(keys.all_odometry()).callback(odometry);
    let scans = session.declare_subscriber(keys.all_scans()).callback(scans);
    let alive = session.liveliness().declare_subscriber(keys.all_alive()).history(true).callback(alive);
    Ok(vec![
        odometry.await.map_err(declared("subscribe to odometry"))?,
        scans.await.map_err(declared("subscribe to scans"))?,
        alive.await.map_err(declared("watch robots"))?,
        frames.await.map_err(declared("subscribe to frames"))?,
    ])
}

fn frame(keys: &Keys, to: &Receivers, outbox: &Outbox, sample: &Sample) {
    let key = sample.key_expr().as_str();
    let Ok(Key::Frame(robot, camera)) = keys.parse(key) else {
        // Nobody to answer: the key itself is what is wrong.
        tracing::debug!(key, "frame on a key that is none");
        return to.intake.slots.refuse(protos::Code::BadName);
    };
    let slot = SlotKey { robot, camera };
    if let Err(answer) = to.intake.receive(slot.clone(), bytes(sample)) {
        tracing::debug!(key, rejection = ?answer.rejection, "frame refused");
        outbox.answer(&slot, &answer);
        to.live.refused(&slot, answer.into());
    }
}

fn bytes(sample: &Sample) -> Bytes {
    Bytes::from(sample.payload().to_bytes().into_owned())
}
