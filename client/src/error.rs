//! Errors of the client. Every message says what to do next.

use std::time::Duration;

/// A failure of the client.
#[derive(Debug, thiserror::Error)]
pub enum ClientError {
    /// A text that is no valid name.
    #[error("{field} {text:?}: {error}")]
    Name {
        /// Which name: `fleet`, `robot`, `camera`.
        field: &'static str,
        /// The text given.
        text: String,
        /// What is wrong with it.
        error: protos::NameError,
    },
    /// No session with the server's router.
    #[error(
        "timeout, or no server reachable at {endpoint}: is `waymark serve` running, is this its zenoh endpoint? ({detail})"
    )]
    Unreachable {
        /// The endpoint that was tried.
        endpoint: String,
        /// The transport's message.
        detail: String,
    },
    /// Something listens, and there is no encrypted session.
    #[error(
        "{endpoint} refuses the encrypted connection: the robot's certificate is not valid there (revoked, expired, or \
         signed by another authority), or the server's own is not signed by the authority in the robot's file, or is for another \
         name; enrol the robot again (waymark robot enrol), and name the server by one of its tls.names ({detail})"
    )]
    TlsRefused {
        /// The endpoint that was tried.
        endpoint: String,
        /// The transport's message.
        detail: String,
    },
    /// The files of an encrypted connection cannot be used.
    #[error("no encrypted connection to {endpoint}: {detail}; enrol the robot again: waymark robot enrol")]
    Encryption {
        /// The endpoint.
        endpoint: String,
        /// What is wrong.
        detail: String,
    },
    /// The robot's certificate has ended.
    #[error(
        "{path}: the certificate of robot {robot} has expired; enrol it again: waymark robot enrol {robot}"
    )]
    CertificateExpired {
        /// The robot.
        robot: String,
        /// The certificate.
        path: String,
    },
    /// The session is open, and the server takes nothing of this robot.
    #[error(
        "the server at {endpoint} takes no messages of robot {robot} with this certificate: it was revoked, is another \
         robot's, or the robot was removed; waymark robot certificates {robot} lists what there is"
    )]
    NotAdmitted {
        /// The robot.
        robot: String,
        /// The server.
        endpoint: String,
    },
    /// The file of `waymark robot enrol` cannot be used.
    #[error("{path} is not a file of `waymark robot enrol`: {detail}")]
    RobotFile {
        /// Which.
        path: String,
        /// What is wrong with it.
        detail: String,
    },
    /// The transport refused an action on an open session.
    #[error("zenoh could not {action}: {detail}")]
    Transport {
        /// The action.
        action: &'static str,
        /// The transport's message.
        detail: String,
    },
    /// The server refused what this robot asked or sent.
    #[error("{code}{}{detail}", if field.is_empty() { ": ".to_owned() } else { format!(" in {field}: ") })]
    Rejected {
        /// Stable code, of [`protos::Code`].
        code: String,
        /// Field at fault, or empty.
        field: String,
        /// A sentence.
        detail: String,
    },
    /// No answer came in time.
    #[error(
        "no answer to frame {seq} within {waited:?}: the frame or its answer was dropped, the server is not reachable at {endpoint}, or its work takes longer; send again or wait longer"
    )]
    NoAnswer {
        /// The frame.
        seq: u64,
        /// How long we waited.
        waited: Duration,
        /// The server.
        endpoint: String,
    },
    /// The server of the robot's map is gone: nobody answers until it is back.
    #[error(
        "server {server} is gone{}: is it running, and has it a connection to the router? \
         `RobotClient::server_events` tells when it is back", if map.is_empty() { String::new() } else { format!(", which serves map {map}") }
    )]
    ServerGone {
        /// The server.
        server: String,
        /// The map that messages name; empty for the robot's own.
        map: String,
    },
    /// A newer frame of the same camera replaced this one.
    #[error(
        "frame {seq} was superseded by a newer one of the same camera: send the next when the last is answered"
    )]
    Superseded {
        /// The frame.
        seq: u64,
    },
    /// Neither JPEG nor PNG, or raw pixels of another number.
    #[error("not a JPEG or PNG image, a damaged header, or raw pixels of another size: {0}")]
    Image(String),
    /// The HTTP server cannot be reached or broke off.
    #[error("no answer from {url}: is `waymark serve` running there? ({detail})")]
    Http {
        /// Address asked.
        url: String,
        /// What went wrong.
        detail: String,
    },
    /// The server's certificate is not signed by whom this client believes, or not for this name.
    #[error(
        "the certificate of {url} is not trusted: {detail}. Give the certificate of its authority: \
         MapClient::with_authority, in commands --authority"
    )]
    Untrusted {
        /// Address asked.
        url: String,
        /// What is wrong with it.
        detail: String,
    },
    /// A file of authorities that cannot be used.
    #[error("the authority is no certificate in PEM: {0}")]
    Authority(String),
    /// The server refused, and said why.
    #[error("{status} {code}{}{detail}", if field.is_empty() { ": ".to_owned() } else { format!(" in {field}: ") })]
    Refused {
        /// HTTP status.
        status: u16,
        /// Stable code.
        code: String,
        /// Field at fault, or empty.
        field: String,
        /// A sentence.
        detail: String,
        /// More, by code, such as the `quads` that were found: [`protos::api::Problem::more`].
        more: serde_json::Map<String, serde_json::Value>,
    },
    /// The answer does not fit this version of the client.
    #[error("{url} answered something unexpected ({detail}): are client and server of the same version?")]
    Unexpected {
        /// Address asked.
        url: String,
        /// What was not understood.
        detail: String,
    },
    /// A job ended without success.
    #[error("job {id} {state}: {message}")]
    Job {
        /// Its number.
        id: i64,
        /// `failed` or `cancelled`.
        state: &'static str,
        /// Why.
        message: String,
    },
    /// A job did not end in time; it goes on at the server.
    #[error("job {id} is not done after {waited:?}; it goes on, ask again for it")]
    JobTimeout {
        /// Its number.
        id: i64,
        /// How long we waited.
        waited: Duration,
    },
    /// The file could not be read.
    #[error("{path}: {error}")]
    File {
        /// Which.
        path: String,
        /// Why.
        error: std::io::Error,
    },
}

/// What zenoh says when it cannot do something.
pub(crate) fn fault(action: &'static str) -> impl Fn(zenoh::Error) -> ClientError + Copy {
    move |error| ClientError::Transport { action, detail: in_words(&error) }
}

/// What zenoh says, without the places in its source: those are paths of the machine that built it.
pub(crate) fn in_words(error: &zenoh::Error) -> String {
    let text = error.to_string();
    let mut words: Vec<&str> = Vec::new();
    for word in text.split_whitespace() {
        if word.contains(".rs:") && words.last() == Some(&"at") {
            words.pop();
        } else {
            words.push(word);
        }
    }
    words.join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_path_of_a_builder_is_told() {
        let error: zenoh::Error = "Unable to connect to any of [tcp/h:1] at zenoh/src/orchestrator.rs:480. \
            Stay at home"
            .into();
        assert_eq!(in_words(&error), "Unable to connect to any of [tcp/h:1] Stay at home");
    }
}
