//! What rows are of, for errors.

use std::fmt;

/// A kind of row that is named in requests.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Map,
    Landmark,
    Model,
    View,
    Picture,
    Robot,
    Camera,
    Job,
    Gathering,
    Track,
    ReferenceRun,
    Underlay,
    Token,
    Certificate,
    Backup,
    Commit,
    Draft,
    Answer,
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Map => "map",
            Self::Landmark => "landmark",
            Self::Model => "model of landmark",
            Self::View => "view",
            Self::Picture => "picture",
            Self::Robot => "robot",
            Self::Camera => "camera",
            Self::Job => "job",
            Self::Gathering => "gathering",
            Self::Track => "track",
            Self::ReferenceRun => "reference run",
            Self::Underlay => "underlay of map",
            Self::Token => "token",
            Self::Certificate => "certificate",
            Self::Backup => "backup",
            Self::Commit => "commit",
            Self::Draft => "draft",
            Self::Answer => "stored answer",
        })
    }
}
