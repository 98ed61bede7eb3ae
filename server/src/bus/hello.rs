//! `robot/{robot}/rpc/hello`: answers that the robot's messages arrive, and how large they may be.
//! A client learns by it whether its certificate gives access, and which frames would be dropped on
//! the way: neither is answered.

use super::{BusError, Receivers, caught};
use protos::{Key, Keys, prost::Message as _, v1};
use zenoh::{
    Session, Wait,
    query::{Query, Queryable},
};

pub(super) async fn answer_hellos(
    session: &Session,
    keys: &Keys,
    to: &Receivers,
) -> Result<Queryable<()>, BusError> {
    let answer = {
        let (keys, to) = (keys.clone(), to.clone());
        let hello = v1::Hello { frame_bytes: to.intake.frame_bytes as u64 }.encode_to_vec();
        move |query: Query| {
            let Ok(Key::Hello(robot)) = keys.parse(query.key_expr().as_str()) else { return };
            if !to.admits(&robot) {
                return;
            }
            if let Err(error) = query.reply(query.key_expr().clone(), hello.clone()).wait() {
                tracing::debug!(%robot, %error, "hello_not_sent");
            }
        }
    };
    let declared =
        session.declare_queryable(keys.all_hellos()).callback(caught(&to.vitals, "a hello", answer)).await;
    declared.map_err(|e| BusError::Declare { action: "answer hellos", detail: e.to_string() })
}
