//! Why a command did not do what was asked: a class with its own exit status, one sentence, and
//! what to do next.

use client::ClientError;
use serde_json::{Value, json};
use std::{fmt, process::ExitCode};

/// Refusals that are about the content of a picture, not about how it was sent.
const PICTURE_CODES: [&str; 6] =
    ["quad_not_found", "quad_ambiguous", "bad_image", "too_small", "too_large", "outside"];

/// Classes of failure. The number is the exit status of the program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Class {
    /// Anything that is none of the others.
    Failed = 1,
    /// The command line is wrong, or a value in it.
    Usage = 2,
    /// What is named does not exist.
    NotFound = 3,
    /// It contradicts what is there.
    Conflict = 4,
    /// A check refuses it: a photograph, a model or a pose that fails a gate.
    Refused = 5,
    /// No server answers.
    Unreachable = 6,
    /// The server does not know who asks, or does not let them.
    Denied = 7,
}

/// What `--help` says of exit statuses.
pub(crate) const EXIT_STATUSES: &str = "Exit status: 0 done, 1 failed, 2 wrong use, 3 not found, 4 conflict,\n\
    5 refused by a check (a photograph or a model that fails a gate), 6 no server answers,\n\
    7 not signed in, or not allowed.";

impl Class {
    pub(crate) fn exit_code(self) -> ExitCode {
        ExitCode::from(self as u8)
    }

    fn of_status(status: u16, code: &str) -> Self {
        match (status, code) {
            (401 | 403, _) => Self::Denied,
            (404, _) => Self::NotFound,
            (409 | 412, _) => Self::Conflict,
            (422, code) if PICTURE_CODES.contains(&code) => Self::Refused,
            (400 | 413 | 415 | 422, _) => Self::Usage,
            _ => Self::Failed,
        }
    }
}

/// A failure as it is shown.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Failure {
    /// Decides the exit status.
    pub(crate) class: Class,
    /// Stable word for programs: that of the server, or one of the command line.
    pub(crate) code: String,
    /// One sentence: what happened, to what.
    pub(crate) sentence: String,
    /// What to do next; empty where nothing is known.
    pub(crate) advice: String,
    /// More, by code.
    pub(crate) more: serde_json::Map<String, Value>,
}

impl Failure {
    /// A failure without advice.
    pub(crate) fn new(class: Class, code: &str, sentence: impl Into<String>) -> Self {
        Self {
            class,
            code: code.to_owned(),
            sentence: sentence.into(),
            advice: String::new(),
            more: serde_json::Map::new(),
        }
    }

    /// With what to do next.
    pub(crate) fn advise(self, advice: impl Into<String>) -> Self {
        Self { advice: advice.into(), ..self }
    }

    /// A wrong value on the command line.
    pub(crate) fn usage(sentence: impl Into<String>) -> Self {
        Self::new(Class::Usage, "usage", sentence)
    }

    /// One failure for several of one command, of the class of the first. `sentence` is about all
    /// of them.
    pub(crate) fn of_several(sentence: impl Into<String>, code: &str, all: &[Self]) -> Self {
        let class = all.first().map_or(Class::Failed, |first| first.class);
        let lines: Vec<String> = all.iter().map(ToString::to_string).collect();
        let mut failure = Self::new(class, code, sentence).advise(lines.join("\n"));
        failure.more.insert("failures".into(), all.iter().map(|f| f.to_json()["error"].clone()).collect());
        failure
    }

    /// As JSON: `code`, `detail`, `advice`, `exit_status` and what else is known.
    pub(crate) fn to_json(&self) -> Value {
        let mut error = self.more.clone();
        error.insert("code".into(), json!(self.code));
        error.insert("detail".into(), json!(self.sentence));
        error.insert("advice".into(), json!(self.advice));
        error.insert("exit_status".into(), json!(self.class as u8));
        json!({ "error": error })
    }

    /// Of any error: a failure as it is, a refusal by its code, everything else by its text.
    pub(crate) fn of(error: &anyhow::Error) -> Self {
        if let Some(failure) = error.downcast_ref::<Self>() {
            return failure.clone();
        }
        match error.downcast_ref::<ClientError>() {
            Some(client) => Self::of_client(client),
            None => Self::new(Class::Failed, "failed", with_causes(error)),
        }
    }

    pub(crate) fn of_client(error: &ClientError) -> Self {
        match error {
            ClientError::Refused { status, code, field, detail, more } => {
                let at = if field.is_empty() { String::new() } else { format!("{field}: ") };
                let mut failure = Self::new(Class::of_status(*status, code), code, format!("{at}{detail}"));
                failure.more.clone_from(more);
                failure
            }
            ClientError::Http { url, .. } => {
                Self::new(Class::Unreachable, "unreachable", format!("No server answers at {url}.")).advise(
                    "Start one with `waymark serve`, or name its address with --server or WAYMARK_SERVER.",
                )
            }
            ClientError::Unreachable { endpoint, .. } => Self::new(
                Class::Unreachable,
                "unreachable",
                format!("No server answers at {endpoint} (zenoh)."),
            )
            .advise("Start one with `waymark serve`, or name its endpoint with --zenoh or WAYMARK_ZENOH."),
            ClientError::Untrusted { url, detail } => {
                let sentence = format!("The certificate of {url} is not trusted: {detail}.");
                Self::new(Class::Denied, "untrusted", sentence).advise(
                    "Give the certificate of its authority with --authority FILE, or once with waymark login --authority FILE.\n\
                     The server's administrator has it: tls/authority.pem in the data directory.",
                )
            }
            other => Self::new(Class::Failed, "failed", other.to_string()),
        }
    }
}

/// An error and its causes in a line. Many errors say their cause themselves: it is not said again.
fn with_causes(error: &anyhow::Error) -> String {
    error.chain().map(ToString::to_string).fold(String::new(), |said, cause| match said.as_str() {
        "" => cause,
        said if said.ends_with(&cause) => said.to_owned(),
        said => format!("{said}: {cause}"),
    })
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.sentence)?;
        self.advice.lines().try_for_each(|line| write!(f, "\n  {line}"))
    }
}

impl std::error::Error for Failure {}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(status: u16, code: &str) -> anyhow::Error {
        let (code, field, detail) = (code.to_owned(), String::new(), "so it is".to_owned());
        ClientError::Refused { status, code, field, detail, more: serde_json::Map::new() }.into()
    }

    #[test]
    fn a_cause_is_said_once() {
        #[derive(Debug, thiserror::Error)]
        #[error("directory x: {source}")]
        struct Directory {
            source: std::io::Error,
        }
        let denied = || std::io::Error::other("permission denied");
        let told = |error: anyhow::Error| Failure::of(&error.context("no start")).to_string();
        assert_eq!(told(Directory { source: denied() }.into()), "no start: directory x: permission denied");
        assert_eq!(told(denied().into()), "no start: permission denied");
    }

    #[test]
    fn every_class_has_its_own_exit_status() {
        for (error, wanted) in [
            (refused(401, "unauthenticated"), 7),
            (refused(403, "forbidden"), 7),
            (refused(404, "unknown_map"), 3),
            (refused(409, "exists"), 4),
            (refused(422, "quad_ambiguous"), 5),
            (refused(422, "bad_image"), 5),
            (refused(422, "out_of_range"), 2),
            (refused(503, "busy"), 1),
            (Failure::usage("no").into(), 2),
            (ClientError::Http { url: "http://x".into(), detail: String::new() }.into(), 6),
            (ClientError::Unreachable { endpoint: "tcp/x:1".into(), detail: String::new() }.into(), 6),
            (ClientError::Untrusted { url: "https://x".into(), detail: String::new() }.into(), 7),
            (anyhow::anyhow!("else"), 1),
        ] {
            let failure = Failure::of(&error);
            assert_eq!(failure.class as u8, wanted, "{failure:?}");
            assert_eq!(failure.to_json()["error"]["exit_status"], wanted);
        }
    }

    #[test]
    fn several_failures_keep_their_sentences_and_the_class_of_the_first() {
        let all = [Failure::new(Class::Refused, "a", "A.").advise("Do a."), Failure::usage("B.")];
        let failure = Failure::of_several("Two.", "photographs_refused", &all);
        assert_eq!(failure.to_string(), "Two.\n  A.\n    Do a.\n  B.");
        assert_eq!(failure.class, Class::Refused);
        assert_eq!(failure.to_json()["error"]["failures"][1]["code"], "usage");
    }

    #[test]
    fn advice_stands_on_its_own_line() {
        let failure = Failure::usage("Which map?").advise("Name it with --map.");
        assert_eq!(failure.to_string(), "Which map?\n  Name it with --map.");
    }
}
