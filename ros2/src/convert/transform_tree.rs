//! The tree of transforms that robots send on `/tf_static`, and sums along it.
//!
//! A broadcaster repeats all its transforms in its last message
//! (`ros2/geometry2 tf2_ros/src/static_transform_broadcaster.cpp`), and there are several: they are
//! merged by child frame, and the newest wins, as in tf2. A leading slash is taken off, as tf2 does
//! where it receives (`ros2/geometry2 tf2/src/buffer_core.cpp`).

use super::pose::{PoseError, isometry_of_transform};
use crate::messages::{TFMessage, TransformStamped};
use nalgebra::Isometry3;
use std::collections::BTreeMap;

/// Most frames with a parent.
pub const MAX_FRAMES: usize = 512;
/// Longest name of a frame, in bytes.
pub const MAX_FRAME_NAME_BYTES: usize = 128;

/// Links between frames, each from a child to its only parent.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TransformTree {
    by_child: BTreeMap<String, Link>,
}

#[derive(Debug, Clone, PartialEq)]
struct Link {
    parent: String,
    parent_from_child: Isometry3<f64>,
}

/// Why a transform is left out.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TransformError {
    /// A name is empty or longer than [`MAX_FRAME_NAME_BYTES`].
    #[error("the name of a frame has {0} bytes, 1 to {MAX_FRAME_NAME_BYTES} are taken")]
    Name(usize),
    /// The numbers.
    #[error("the transform of `{child}`: {fault}")]
    Pose {
        /// The child frame.
        child: String,
        /// What is wrong.
        fault: PoseError,
    },
    /// The parent is the child or hangs below it.
    #[error("`{child}` cannot hang below `{parent}`, which hangs below it")]
    Loop {
        /// The child frame.
        child: String,
        /// The parent frame.
        parent: String,
    },
    /// There are [`MAX_FRAMES`] already.
    #[error("`{0}` is one frame more than {MAX_FRAMES}")]
    Full(String),
}

/// Why there is no transform between two frames.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum LookupError {
    /// No transform names the frame.
    #[error("no transform names the frame `{0}`")]
    Unknown(String),
    /// Both frames are known, and nothing links the trees that they are in.
    #[error("nothing links `{source_root}`, above `{from}`, with `{target_root}`, above `{to}`")]
    NotLinked {
        /// The frame that coordinates are in.
        from: String,
        /// The frame that has no parent above `from`.
        source_root: String,
        /// The frame that coordinates are wanted in.
        to: String,
        /// The frame that has no parent above `to`.
        target_root: String,
    },
}

impl TransformTree {
    /// Takes over the transforms of a message. Returns how many changed the tree, and what was left
    /// out.
    pub fn merge(&mut self, message: &TFMessage<'_>) -> (usize, Vec<TransformError>) {
        let (mut changed, mut errors) = (0, Vec::new());
        for transform in &message.transforms {
            match self.insert(transform) {
                Ok(is_change) => changed += usize::from(is_change),
                Err(error) => errors.push(error),
            }
        }
        (changed, errors)
    }

    /// Takes over one transform in place of the child's former one. Returns whether that changed
    /// the tree.
    pub fn insert(&mut self, transform: &TransformStamped<'_>) -> Result<bool, TransformError> {
        let (child, parent) = (plain(transform.child_frame_id), plain(transform.header.frame_id));
        for name in [child, parent] {
            if name.is_empty() || name.len() > MAX_FRAME_NAME_BYTES {
                return Err(TransformError::Name(name.len()));
            }
        }
        let parent_from_child = isometry_of_transform(&transform.transform)
            .map_err(|fault| TransformError::Pose { child: child.to_owned(), fault })?;
        if child == parent || self.chain(parent).any(|(_, link)| link.parent == child) {
            return Err(TransformError::Loop { child: child.to_owned(), parent: parent.to_owned() });
        }
        if self.by_child.len() >= MAX_FRAMES && !self.by_child.contains_key(child) {
            return Err(TransformError::Full(child.to_owned()));
        }
        let link = Link { parent: parent.to_owned(), parent_from_child };
        let former = self.by_child.insert(child.to_owned(), link.clone());
        Ok(former != Some(link))
    }

    /// `target_from_source`: takes coordinates of `source` to those of `target`. For a camera,
    /// `target` is the robot's base and `source` the frame of the image's header.
    pub fn lookup(&self, target: &str, source: &str) -> Result<Isometry3<f64>, LookupError> {
        let (target, source) = (plain(target), plain(source));
        for frame in [source, target] {
            if !self.is_known(frame) {
                return Err(LookupError::Unknown(frame.to_owned()));
            }
        }
        let (source_root, root_from_source) = self.to_root(source);
        let (target_root, root_from_target) = self.to_root(target);
        if source_root == target_root {
            return Ok(root_from_target.inverse() * root_from_source);
        }
        Err(LookupError::NotLinked {
            from: source.to_owned(),
            source_root: source_root.to_owned(),
            to: target.to_owned(),
            target_root: target_root.to_owned(),
        })
    }

    /// Number of frames with a parent.
    pub fn len(&self) -> usize {
        self.by_child.len()
    }

    /// Whether there is no transform.
    pub fn is_empty(&self) -> bool {
        self.by_child.is_empty()
    }

    fn is_known(&self, frame: &str) -> bool {
        self.by_child.contains_key(frame) || self.by_child.values().any(|link| link.parent == frame)
    }

    /// The links from a frame upwards. There are no loops, so it ends.
    fn chain<'a>(&'a self, frame: &'a str) -> impl Iterator<Item = (&'a str, &'a Link)> {
        let step = |frame: &'a str| self.by_child.get(frame).map(|link| (frame, link));
        std::iter::successors(step(frame), move |(_, link)| step(&link.parent))
    }

    fn to_root<'a>(&'a self, frame: &'a str) -> (&'a str, Isometry3<f64>) {
        let begin = (frame, Isometry3::identity());
        self.chain(frame)
            .fold(begin, |(_, sum), (_, link)| (link.parent.as_str(), link.parent_from_child * sum))
    }
}

fn plain(frame: &str) -> &str {
    frame.strip_prefix('/').unwrap_or(frame)
}
