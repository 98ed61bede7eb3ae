//! Why a connection is refused or ended: a word for counters, a sentence, and what to do.

use super::{LINKS_OF_ROBOT, admission::NotAdmitted, inspection::Violation};

/// Why a connection is refused, or ended by the server.
#[derive(Debug, thiserror::Error)]
pub(super) enum Refusal {
    #[error("it sends nothing")]
    Silent,
    #[error("the encrypted connection does not come about: {0}")]
    NoHandshake(String),
    #[error(transparent)]
    NotAdmitted(#[from] NotAdmitted),
    #[error("it has {LINKS_OF_ROBOT} connections")]
    ManyOfRobot,
    #[error("there are as many connections as `limits.robots` allows")]
    NoPlace,
    #[error("{0}")]
    CertificateEnded(&'static str),
    #[error(transparent)]
    Violation(#[from] Violation),
}

impl Refusal {
    pub(super) fn word(&self) -> &'static str {
        match self {
            Self::Silent => "silent",
            Self::NoHandshake(_) => "no_handshake",
            Self::NotAdmitted(_) => "not_admitted",
            Self::ManyOfRobot => "too_many_connections",
            Self::NoPlace => "no_place",
            Self::CertificateEnded(_) => "certificate_ended",
            Self::Violation(Violation::LongKey) => "long_key",
            Self::Violation(Violation::BadKey) => "no_key_expression",
            Self::Violation(Violation::ManyDeclared) => "too_many_declared",
            Self::Violation(Violation::ManyInterests) => "too_many_interests",
            Self::Violation(Violation::Protocol) => "not_zenoh",
            Self::Violation(Violation::UnmarkedFragments) => "old_zenoh",
        }
    }
}

/// What whoever runs the robot or the server can do about a word; empty where the sentence says it.
pub(crate) fn advice(word: &str) -> &'static str {
    match word {
        "too_many_connections" => "End some of the robot's programs.",
        "no_place" => "Raise `limits.robots`, or end connections that are not needed.",
        "certificate_ended" => "Give the robot a new certificate: `waymark robot enrol`.",
        "long_key" | "no_key_expression" | "not_zenoh" => {
            "Look at the program that connects by this robot's certificate: no client of zenoh sends that."
        }
        "too_many_declared" => "Declare subscribers and queryables once, not for each message.",
        "too_many_interests" => {
            "Publish and ask under fixed keys. A restart of the server, or of the gate when robots change, forgets them."
        }
        "old_zenoh" => "Use zenoh 1.1 or later on the robot.",
        _ => "",
    }
}
