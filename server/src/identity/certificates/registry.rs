//! Robots' certificates in memory. In: the rows after each commit. Out: which of them are valid,
//! and robots that have lost theirs.

use super::common_name;
use arc_swap::ArcSwap;
use protos::{Name, api::RobotCertificate};
use std::{collections::BTreeMap, sync::Arc, time::Duration};
use tokio::sync::watch;

/// All certificates of robots.
#[derive(Debug, Default)]
pub(crate) struct CertificateRegistry {
    by_robot: ArcSwap<BTreeMap<String, Vec<RobotCertificate>>>,
    /// Counts the changes.
    changes: watch::Sender<u64>,
    /// Of those, the last that access control follows.
    applied: watch::Sender<u64>,
}

/// Longest wait for access control.
const APPLY: Duration = Duration::from_secs(10);

fn is_valid(certificate: &RobotCertificate, now_ms: i64) -> bool {
    certificate.revoked_ms.is_none() && now_ms < certificate.expires_ms
}

impl CertificateRegistry {
    /// Replaces all.
    pub(crate) fn publish(&self, all: impl IntoIterator<Item = RobotCertificate>) {
        let mut by_robot = BTreeMap::<String, Vec<_>>::new();
        for certificate in all {
            by_robot.entry(certificate.robot.clone()).or_default().push(certificate);
        }
        self.by_robot.store(Arc::new(by_robot));
        self.touch();
    }

    /// Robots, their maps, or links of maps have changed.
    pub(crate) fn touch(&self) {
        self.changes.send_modify(|count| *count += 1);
    }

    /// Each [`CertificateRegistry::publish`] and [`CertificateRegistry::touch`] from now on.
    pub(crate) fn changes(&self) -> watch::Receiver<u64> {
        self.changes.subscribe()
    }

    /// Access control follows this change and all before it.
    pub(crate) fn set_applied(&self, change: u64) {
        self.applied.send_replace(change);
    }

    /// Waits until access control follows what was published, for ten seconds at most. Whether it
    /// does.
    pub(crate) async fn applied(&self) -> bool {
        let (wanted, mut applied) = (*self.changes.borrow(), self.applied.subscribe());
        matches!(tokio::time::timeout(APPLY, applied.wait_for(|count| *count >= wanted)).await, Ok(Ok(_)))
    }

    /// Robots that have, or had, a certificate.
    pub(crate) fn holders(&self) -> Vec<String> {
        self.by_robot.load().keys().cloned().collect()
    }

    /// The robot with a valid certificate of this common name.
    pub(crate) fn holder(&self, name: &str, now_ms: i64) -> Option<String> {
        let all = self.by_robot.load();
        let of = |certificate: &&RobotCertificate| {
            is_valid(certificate, now_ms) && common_name(&certificate.robot, &certificate.serial) == name
        };
        all.values().flatten().find(of).map(|certificate| certificate.robot.clone())
    }

    /// Whether messages of a robot are taken: not where it had certificates and none is valid any
    /// more. One that never had one comes by a listener that asks for none.
    pub(crate) fn admits(&self, robot: &Name, now_ms: i64) -> bool {
        let all = self.by_robot.load();
        all.get(robot.as_str()).is_none_or(|all| all.iter().any(|c| is_valid(c, now_ms)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_robot_without_a_valid_certificate_is_not_admitted_and_one_that_never_had_one_is() {
        let registry = CertificateRegistry::default();
        let certificate = |robot: &str, serial: &str, expires_ms, revoked_ms| RobotCertificate {
            serial: serial.into(),
            robot: robot.into(),
            sha256: String::new(),
            issued_ms: 0,
            expires_ms,
            revoked_ms,
        };
        registry.publish([
            certificate("r1", "a", 100, Some(5)),
            certificate("r1", "b", 100, None),
            certificate("r2", "c", 100, Some(5)),
        ]);
        let admits = |robot: &str, now_ms| registry.admits(&Name::new(robot).unwrap(), now_ms);
        assert_eq!((admits("r1", 99), admits("r1", 100)), (true, false));
        assert_eq!((admits("r2", 1), admits("r3", 1)), (false, true));
        let holder = |name: &str, now_ms| registry.holder(name, now_ms);
        assert_eq!((holder("r1.b", 99), holder("r1.b", 100)), (Some("r1".into()), None));
        assert_eq!((holder("r1.a", 1), holder("r1", 1), holder("r2.c", 1)), (None, None, None));
        assert_eq!(registry.holders(), ["r1", "r2"]);
    }
}
