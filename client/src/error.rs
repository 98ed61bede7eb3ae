//! Errors of the robot's and the teacher's side. Every message says what to do next.

use std::time::Duration;

/// An error of the client.
#[derive(Debug, thiserror::Error)]
pub enum ClientError {
    /// A name has a wrong length or character.
    #[error("{field} {text:?}: {error}")]
    Name {
        /// Which name: `fleet`, `robot`, `camera`.
        field: &'static str,
        /// The refused text.
        text: String,
        /// What is wrong with it.
        error: protos::NameError,
    },
    /// No session with the server's router.
    #[error(
        "timeout, or no server reachable at {endpoint}: is `waymark serve` running, is this its zenoh endpoint? ({detail})"
    )]
    Unreachable {
        /// The zenoh endpoint that was tried.
        endpoint: String,
        /// The error of the transport.
        detail: String,
    },
    /// The transport refused an action on an open session.
    #[error("zenoh could not {action}: {detail}")]
    Transport {
        /// The action that failed.
        action: &'static str,
        /// The error of the transport.
        detail: String,
    },
    /// No answer came in time.
    #[error(
        "no answer to frame {seq} within {waited:?}: the frame or its answer was dropped, the server is not reachable at {endpoint}, or its work takes longer; send again or wait longer"
    )]
    NoAnswer {
        /// Number of the frame.
        seq: u64,
        /// Time waited.
        waited: Duration,
        /// The server's zenoh endpoint.
        endpoint: String,
    },
    /// A newer frame of the same camera took this one's place; its own answer tells more.
    #[error(
        "frame {seq} was superseded by a newer one of the same camera: send the next when the last is answered"
    )]
    Superseded {
        /// Number of the frame.
        seq: u64,
    },
    /// The image is neither JPEG nor PNG, or its header is damaged.
    #[error("not a JPEG or PNG image, or its header is damaged: {0}")]
    Image(String),
    /// The HTTP server cannot be reached, or the connection broke.
    #[error("no answer from {url}: is `waymark serve` running there? ({detail})")]
    Http {
        /// The requested address.
        url: String,
        /// The error of the connection.
        detail: String,
    },
    /// The server refused the request.
    #[error("{status} {code}{}{detail}", if field.is_empty() { ": ".to_owned() } else { format!(" in {field}: ") })]
    Refused {
        /// HTTP status.
        status: u16,
        /// Stable code of the problem.
        code: String,
        /// The field at fault, or empty.
        field: String,
        /// A sentence for a person.
        detail: String,
    },
    /// This version of the client does not understand the answer.
    #[error("{url} answered something unexpected ({detail}): are client and server of the same version?")]
    Unexpected {
        /// The requested address.
        url: String,
        /// What was not understood.
        detail: String,
    },
    /// A job ended without success.
    #[error("job {id} {state}: {message}")]
    Job {
        /// Number of the job.
        id: String,
        /// `failed` or `cancelled`.
        state: &'static str,
        /// The server's reason.
        message: String,
    },
    /// A job did not end in time; it goes on at the server.
    #[error("job {id} is not done after {waited:?}; it goes on, ask again for it")]
    JobTimeout {
        /// Number of the job.
        id: String,
        /// Time waited.
        waited: Duration,
    },
    /// The file could not be read.
    #[error("{path}: {error}")]
    File {
        /// Path of the file.
        path: String,
        /// The error of the file system.
        error: std::io::Error,
    },
}
