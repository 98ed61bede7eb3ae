//! `robot/{robot}/rpc/gaze`: answers gaze queries of robots on zenoh's thread, in less than a
//! millisecond.

use super::{BusError, Receivers, caught};
use crate::fleet::Responsibility;
use engine::{gaze::GazeQuery, panics::Edge};
use map::gaze::GazeParams;
use protos::{
    Code, Key, Keys, Name, Rejection,
    convert::{CheckedGaze, gaze::advice, geometry::refused},
    named_map,
    prost::Message,
    v1,
};
use std::time::Instant;
use zenoh::{
    Session, Wait,
    query::{Query, Queryable},
};

/// Largest query, in bytes: it has some thirty numbers and a name.
const MAX_BYTES: usize = 1024;

pub(super) async fn answer_gaze(
    session: &Session,
    keys: &Keys,
    to: &Receivers,
) -> Result<Queryable<()>, BusError> {
    let callback = {
        let (keys, to) = (keys.clone(), to.clone());
        move |query: Query| {
            let Ok(Key::Gaze(robot)) = keys.parse(query.key_expr().as_str()) else { return };
            let payload = || query.payload().map(|p| p.to_bytes().into_owned()).unwrap_or_default();
            let refusal = match to.responsibility(&robot, || named_map::of_gaze(&payload())) {
                Responsibility::Take => None,
                Responsibility::Silent => return,
                Responsibility::Refuse(rejection) => Some(rejection),
            };
            let panics = to.vitals.panics();
            let advice = panics.catch(Edge::Message, "a gaze query", "it is refused as internal", || {
                refusal.map_or_else(|| advise(&to, &robot, &payload()), Err)
            });
            let failed =
                || Err(Rejection::new(Code::Internal, "message", "the server failed on it; see its log"));
            let advice = advice.unwrap_or_else(failed).unwrap_or_else(|rejection| v1::GazeAdvice {
                rejection: Some((&rejection).into()),
                ..v1::GazeAdvice::default()
            });
            let advice = v1::GazeAdvice { server: to.server.to_string(), ..advice };
            if let Err(error) = query.reply(query.key_expr().clone(), advice.encode_to_vec()).wait() {
                tracing::debug!(%robot, %error, "gaze_advice_not_sent");
            }
        }
    };
    let declared = session
        .declare_queryable(keys.all_gaze())
        .callback(caught(&to.vitals, "a gaze query", callback))
        .await;
    declared.map_err(|e| BusError::Declare { action: "answer gaze queries", detail: e.to_string() })
}

fn advise(to: &Receivers, robot: &Name, bytes: &[u8]) -> Result<v1::GazeAdvice, Rejection> {
    let name = to.intake.snapshots.robot_map(robot.as_str()).filter(|_| to.admits(robot));
    let name = name.ok_or_else(|| Rejection::new(Code::UnknownRobot, "robot", "not registered"))?;
    let map = to.intake.snapshots.get(&name);
    let map = map.ok_or_else(|| Rejection::new(Code::UnknownMap, "map", "not loaded"))?;
    if bytes.len() > MAX_BYTES {
        return Err(Rejection::new(Code::TooLarge, "message", format!("more than {MAX_BYTES} bytes")));
    }
    let wire = v1::GazeRequest::decode(bytes);
    let wire = wire.map_err(|e| Rejection::new(Code::BadMessage, "message", e.to_string()))?;
    if !wire.map.is_empty() && wire.map != name {
        let detail = format!("the robot is registered on {name}: its gaze is advised there");
        return Err(Rejection::new(Code::UnknownMap, "map", detail));
    }
    let request = CheckedGaze::try_from(wire)?;
    let pose = request.pose.or_else(|| to.motion.pose(robot, &name, Instant::now())).ok_or_else(|| {
        Rejection::new(Code::Missing, "map_from_robot", "the robot's pose is not known here either")
    })?;
    let camera = request.viewer(&map.visibility_settings.viewer);
    let number = |text: &str| map.landmarks.iter().find(|(_, l)| l.name == text).map(|(id, _)| *id);
    let outcome = request.looked.and_then(|(text, recognised)| Some((number(&text)?, recognised)));
    let params = GazeParams { criterion: request.criterion, ..GazeParams::default() };
    let query = GazeQuery { pose, camera, pan_tilt: request.head, params };
    let action = to.gazes.choose(robot, request.at_ns, outcome, &map, &query).map_err(|e| refused(&e))?;
    let name_of = |c: &map::gaze::GazeTarget| {
        map.landmarks.get(&c.landmark).map(|l| l.name.clone()).unwrap_or_default()
    };
    let advice = advice(&action, name_of);
    Ok(v1::GazeAdvice { map: map.name.clone(), map_version: map.version, ..advice })
}
