//! What can go wrong with the store, sorted by what the caller can do about it.

use super::{
    db::{self, ErrorClass, class},
    disk_guard::DiskSpace,
    kind::Kind,
};
use vision::pose::LandmarkSize;

/// Why a read or a write did not happen. Nothing was changed, except with
/// [`StoreError::NotPublished`].
#[derive(Debug, thiserror::Error)]
pub(crate) enum StoreError {
    /// It does not exist.
    #[error("there is no {what} `{name}`")]
    NotFound {
        /// Kind of the object.
        what: Kind,
        /// The name asked for.
        name: String,
    },
    /// The name is taken.
    #[error("{what} `{name}` exists already")]
    Exists {
        /// Kind of the object.
        what: Kind,
        name: String,
    },
    /// A bound is reached.
    #[error("at most {max} {what}")]
    Limit {
        /// What there would be too many of.
        what: &'static str,
        /// The bound.
        max: usize,
    },
    /// The landmark has another size by hand.
    #[error("landmark `{landmark}` is {} m, not {} m", size_text(stored), size_text(given))]
    SizeDiffers {
        /// Name of the landmark.
        landmark: String,
        /// The size that it has.
        stored: LandmarkSize,
        /// The size that was given.
        given: LandmarkSize,
    },
    /// One of several did not go, so none did.
    #[error("{source}")]
    At {
        /// Which one.
        index: usize,
        /// Why.
        source: Box<StoreError>,
    },
    /// Something else rests on it.
    #[error("{0}")]
    InUse(String),
    /// A commit cannot be taken back, because a later one has changed the same.
    #[error(
        "commit {by} has changed {what} since: take that back first, or roll back to a commit before both"
    )]
    ChangedSince {
        /// What it has changed.
        what: String,
        /// Number of the later commit.
        by: i64,
    },
    /// A draft cannot be published, because its map has changed the same since it began.
    #[error(
        "draft `{draft}` and its map have both changed: {}. Take that back on one side, or discard the draft",
        .with.join("; ")
    )]
    Conflicts {
        /// Name of the draft.
        draft: String,
        /// What both have changed, in words.
        with: Vec<String>,
    },
    /// The map links are impossible.
    #[error(transparent)]
    Frames(#[from] map::map_links::MapLinkError),
    /// The database cannot be reached; reading what is in memory goes on. Nothing was changed.
    #[error("the store cannot be reached: robots are served and nothing is stored; try again")]
    Away,
    /// The disk is full; reading goes on.
    #[error("the disk of the data directory is full: free some space, then this goes on by itself")]
    Full,
    /// The disk has no room for what adds data; everything else goes on.
    #[error("{0}")]
    NearlyFull(Box<DiskSpace>),
    /// The data directory is mounted read-only; reading goes on.
    #[error(
        "the data directory is on a read-only file system: robots are served and nothing is stored; mount it writable, \
             then start the server again"
    )]
    ReadOnly,
    /// The write panicked: it was rolled back.
    #[error("the server failed on this write; nothing was changed")]
    Panicked,
    /// The write is on the disk, but the map cannot be published with it: its previous version
    /// stays in use.
    #[error("the change is stored, but map `{map}` cannot be made ready with it; see the server's log")]
    NotPublished {
        /// Name of the map.
        map: String,
    },
    /// What a prepared write rests on has changed: it must be prepared again.
    #[error("it changed meanwhile")]
    Changed,
    /// What a write rests on changed after each preparation.
    #[error("others change the same things at this moment; try again")]
    Busy,
    /// A change is meant for another revision.
    #[error("somebody else has changed it since it was read: read it again, and change that")]
    ChangedMeanwhile {
        /// The present revision.
        present: String,
    },
    /// A creation with this key is at work.
    #[error("a request with this key is at work: repeat it when that has ended")]
    KeyAtWork,
    /// The key was used for another request.
    #[error(
        "this key was used for another request: take a fresh one for each creation, the same one to repeat it"
    )]
    KeyReused,
    /// The writer has stopped: after an I/O error nothing may be written any more.
    #[error("storage failed; the server stops: check the disk, then restart it")]
    Closed,
    /// A stored row cannot be read.
    #[error("{what} is damaged: {reason}")]
    Damaged {
        /// Which row.
        what: String,
        /// What is wrong.
        reason: String,
    },
    /// The bytes of a stored picture are not those that were stored.
    #[error("picture {picture} is damaged: {reason}; upload the same photograph again, or delete the view")]
    PictureDamaged {
        /// Its digest, hexadecimal.
        picture: String,
        /// What is wrong.
        reason: String,
    },
    /// Any other error of the database, with the operation that met it.
    #[error("{operation} failed")]
    Database {
        operation: &'static str,
        /// What the database says.
        source: db::Error,
    },
}

fn size_text(size: &LandmarkSize) -> String {
    format!("{} x {}", size.width_m, size.height_m)
}

impl StoreError {
    /// Names the operation. For `map_err`.
    pub(crate) fn during(operation: &'static str) -> impl FnOnce(db::Error) -> Self {
        move |source| match class(&source) {
            ErrorClass::Full => Self::Full,
            ErrorClass::ReadOnly => Self::ReadOnly,
            ErrorClass::Away => Self::Away,
            ErrorClass::Busy => Self::Busy,
            _ => Self::Database { operation, source },
        }
    }

    /// Like [`StoreError::during`], for an insertion whose only unique constraint is the name.
    pub(crate) fn inserting(
        operation: &'static str,
        what: Kind,
        name: &str,
    ) -> impl FnOnce(db::Error) -> Self {
        move |source| match class(&source) {
            ErrorClass::Taken => Self::Exists { what, name: name.to_owned() },
            _ => Self::during(operation)(source),
        }
    }

    /// Whether the state on disk is unknown after this, or damaged: the server stops.
    pub(crate) fn is_fatal(&self) -> bool {
        match self {
            Self::Database { source, .. } => {
                matches!(class(source), ErrorClass::Damaged | ErrorClass::Lost)
            }
            Self::At { source, .. } => source.is_fatal(),
            Self::Closed => true,
            _ => false,
        }
    }

    /// That of one of several.
    pub(crate) fn at(self, index: usize) -> Self {
        Self::At { index, source: Box::new(self) }
    }
}
