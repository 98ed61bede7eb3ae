//! Which frames are searched for all landmarks of their map, and which are answered by expected landmarks alone
//! (method 26.4).

/// When a frame may do without the search of the whole map. It does where [`map::guided::Schedule`] asks for none and the
/// expected landmarks are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SearchPolicy {
    /// Never: every frame is searched.
    Every,
    /// While at least so many frames wait for a worker. They would be answered late, or superseded.
    UnlessWaiting(u64),
    /// Always.
    Scheduled,
}

impl SearchPolicy {
    /// Whether a frame may do without a search while `waiting` others wait.
    pub fn may_spare(self, waiting: u64) -> bool {
        match self {
            Self::Every => false,
            Self::UnlessWaiting(least) => waiting >= least,
            Self::Scheduled => true,
        }
    }
}
