//! `waymark robot certificates` and `waymark robot revoke`.

use crate::{
    screen::Table,
    session::{Consent, Session},
};
use client::api::RobotCertificate;
use serde_json::json;

/// What is revoked.
#[derive(Debug, clap::Args)]
pub(super) struct RevokeArgs {
    /// The robot.
    robot: String,
    /// A certificate's serial; may be given several times [default: all of the robot].
    #[arg(long = "serial", value_name = "SERIAL")]
    serials: Vec<String>,
    #[command(flatten)]
    consent: Consent,
}

/// Lists a robot's certificates.
pub(super) async fn list(session: &Session, robot: &str) -> anyhow::Result<()> {
    let all = session.maps().robot_certificates(robot).await?;
    let now_ms = crate::validity::now_ms();
    let table = |all: &[RobotCertificate]| {
        Table::of(["serial", "valid", "sha256"], all, |c| {
            let valid = crate::validity::validity(c.revoked_ms, Some(c.expires_ms), now_ms);
            [c.serial.clone(), valid, c.sha256.clone()]
        })
    };
    session.list(
        &all,
        table,
        &format!("Robot {robot} has no certificate. Make one: waymark robot enrol {robot} --out DIR"),
    )
}

/// Revokes a robot's certificates.
pub(super) async fn revoke(session: &Session, args: &RevokeArgs) -> anyhow::Result<()> {
    let RevokeArgs { robot, serials, consent } = args;
    let maps = session.maps();
    let chosen = if serials.is_empty() {
        let all = maps.robot_certificates(robot).await?;
        all.into_iter().filter(|c| c.revoked_ms.is_none()).map(|c| c.serial).collect()
    } else {
        serials.clone()
    };
    if !chosen.is_empty() {
        let shown = chosen.join(", ");
        consent
            .ask(&format!("Revoke {shown} of robot {robot}? Its connection ends. This cannot be undone."))?;
    }
    for serial in &chosen {
        maps.revoke_robot_certificate(robot, serial).await?;
    }
    let sentence = match chosen.as_slice() {
        [] => format!("robot {robot} has no certificate that is not revoked"),
        chosen => format!("robot {robot}: revoked {}", chosen.join(", ")),
    };
    session.show(&json!({ "robot": robot, "revoked": chosen }), &sentence)
}
