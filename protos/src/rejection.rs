//! Why a message was refused: a stable code for programs, the field at fault, and a sentence for a
//! person. The codes are part of the wire: none is renamed, new ones are added.

use crate::v1;

/// Stable reasons of refusal, the same over zenoh and HTTP.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Code {
    /// The bytes are not the message that the key promises.
    BadMessage,
    /// A name is not `[a-z0-9_-]{1,64}`.
    BadName,
    /// A needed field is absent.
    Missing,
    /// A number is NaN or infinite.
    NotFinite,
    /// A number, a count or an enumeration is outside its range.
    OutOfRange,
    /// More bytes or elements than allowed.
    TooLarge,
    /// The image is not of the claimed size.
    SizeMismatch,
    /// The image is not of the claimed encoding.
    WrongEncoding,
    /// The image cannot be decoded.
    BadImage,
    /// The robot is not registered.
    UnknownRobot,
    /// There is no such map.
    UnknownMap,
    /// Several servers have the robot registered, and its message names no map.
    RobotContested,
    /// Several servers claim the map: it is served by none of those that say so.
    MapContested,
    /// The server of the robot, or of the map, is not there any more.
    ServerGone,
    /// Not newer than the last message of this robot and camera.
    NotNewer,
    /// Another start of the robot's software (epoch) is live.
    EpochConflict,
    /// The capture time runs ahead of the time that has passed since the robot's messages before.
    ClockAhead,
    /// The capture time is too far behind the robot's messages before.
    ClockBehind,
    /// The deadline passed before work began.
    Expired,
    /// More cameras, robots, elements or questions at a time than the server serves.
    TooMany,
    /// More messages or bytes a second than one robot may send; the detail names the limit and how
    /// long to wait.
    RateLimited,
    /// The frames of all robots that wait take more memory than the server gives them.
    Overloaded,
    /// The server failed on this input; reported, counted, and the server goes on.
    Internal,
}

impl Code {
    /// All codes.
    pub const ALL: [Code; 23] = [
        Code::BadMessage,
        Code::BadName,
        Code::Missing,
        Code::NotFinite,
        Code::OutOfRange,
        Code::TooLarge,
        Code::SizeMismatch,
        Code::WrongEncoding,
        Code::BadImage,
        Code::UnknownRobot,
        Code::UnknownMap,
        Code::RobotContested,
        Code::MapContested,
        Code::ServerGone,
        Code::NotNewer,
        Code::EpochConflict,
        Code::ClockAhead,
        Code::ClockBehind,
        Code::Expired,
        Code::TooMany,
        Code::RateLimited,
        Code::Overloaded,
        Code::Internal,
    ];

    /// The word of the code on the wire.
    pub fn as_str(self) -> &'static str {
        match self {
            Code::BadMessage => "bad_message",
            Code::BadName => "bad_name",
            Code::Missing => "missing",
            Code::NotFinite => "not_finite",
            Code::OutOfRange => "out_of_range",
            Code::TooLarge => "too_large",
            Code::SizeMismatch => "size_mismatch",
            Code::WrongEncoding => "wrong_encoding",
            Code::BadImage => "bad_image",
            Code::UnknownRobot => "unknown_robot",
            Code::UnknownMap => "unknown_map",
            Code::RobotContested => "robot_contested",
            Code::MapContested => "map_contested",
            Code::ServerGone => "server_gone",
            Code::NotNewer => "not_newer",
            Code::EpochConflict => "epoch_conflict",
            Code::ClockAhead => "clock_ahead",
            Code::ClockBehind => "clock_behind",
            Code::Expired => "expired",
            Code::TooMany => "too_many",
            Code::RateLimited => "rate_limited",
            Code::Overloaded => "overloaded",
            Code::Internal => "internal",
        }
    }
}

impl Code {
    /// The code of a word.
    pub fn of(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|code| code.as_str() == word)
    }

    /// What whoever runs the robot or the server can do, in a sentence.
    pub fn advice(self) -> &'static str {
        match self {
            Code::BadMessage => {
                "Send the message that belongs to this key, by the SDK or by `protos/waymark/v1`."
            }
            Code::BadName => "Use lower-case letters, digits, `-` and `_`, at most 64.",
            Code::Missing => "Set the field.",
            Code::NotFinite | Code::OutOfRange => "Correct the field; the sentence says what it may be.",
            Code::TooLarge => "Send a JPEG or a smaller picture, or raise the limit that the sentence names.",
            Code::SizeMismatch => "Send width, height and step of the picture that is sent.",
            Code::WrongEncoding => "Name the encoding that the bytes have.",
            Code::BadImage => "Open a picture of this camera in a viewer; send JPEG, PNG or raw pixels.",
            Code::UnknownRobot => "Register it: `waymark robot add NAME MAP`.",
            Code::UnknownMap => "Name the map that the robot is registered on, or none.",
            Code::RobotContested | Code::MapContested => {
                "See `waymark server list`: take the map or the robot from all servers but one."
            }
            Code::ServerGone => "Start that server, or look at its connection to the router.",
            Code::NotNewer => "Let `seq` rise with each message of a start and a camera.",
            Code::EpochConflict => "Two programs use this robot's name: stop one of them.",
            Code::ClockAhead | Code::ClockBehind => "Stamp all messages of a robot by one clock, at capture.",
            Code::Expired => "Send fewer frames, give a longer deadline, or give the server more cores.",
            Code::TooMany => "Use fewer, or raise the limit that the sentence names.",
            Code::RateLimited => "Send less often, or raise the limit that the sentence names.",
            Code::Overloaded => "Send smaller frames, less often.",
            Code::Internal => "This is a fault of the server: its log says where. Please report it.",
        }
    }
}

impl std::fmt::Display for Code {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.as_str())
    }
}

/// A refusal of one message.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{code}: {field}: {detail}")]
pub struct Rejection {
    /// The stable code.
    pub code: Code,
    /// The field at fault, with dots and indices (`intrinsics.fx_px`, `prior.covariance[4]`).
    pub field: String,
    /// A sentence for a person.
    pub detail: String,
}

impl Rejection {
    /// Longest detail sent, in bytes.
    pub const MAX_DETAIL_BYTES: usize = 300;

    /// A refusal; a longer detail is cut at [`Self::MAX_DETAIL_BYTES`].
    pub fn new(code: Code, field: impl Into<String>, detail: impl Into<String>) -> Self {
        let mut detail = detail.into();
        detail.truncate(detail.floor_char_boundary(Self::MAX_DETAIL_BYTES));
        Self { code, field: field.into(), detail }
    }

    /// The same refusal, its field named from one level further out.
    #[must_use]
    pub fn inside(mut self, outer: &str) -> Self {
        self.field = if self.field.is_empty() { outer.to_owned() } else { format!("{outer}.{}", self.field) };
        self
    }
}

impl From<&Rejection> for v1::Rejection {
    fn from(r: &Rejection) -> Self {
        Self { code: r.code.as_str().to_owned(), field: r.field.clone(), detail: r.detail.clone() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_distinct_words() {
        let mut words: Vec<_> = Code::ALL.iter().map(|c| c.as_str()).collect();
        assert!(Code::ALL.iter().all(|code| Code::of(code.as_str()) == Some(*code)));
        assert_eq!(Code::of("bad_scan"), None);
        words.sort_unstable();
        words.dedup();
        assert_eq!(words.len(), Code::ALL.len());
        assert!(words.iter().all(|w| w.bytes().all(|b| b.is_ascii_lowercase() || b == b'_')));
    }

    #[test]
    fn a_long_detail_is_cut_between_letters() {
        let r = Rejection::new(Code::BadName, "map", "é".repeat(Rejection::MAX_DETAIL_BYTES));
        assert!(
            r.detail.len() <= Rejection::MAX_DETAIL_BYTES && r.detail.len() + 2 > Rejection::MAX_DETAIL_BYTES
        );
        let exact = "x".repeat(Rejection::MAX_DETAIL_BYTES);
        assert_eq!(Rejection::new(Code::BadName, "map", exact.clone()).detail, exact);
    }

    #[test]
    fn fields_nest() {
        let r = Rejection::new(Code::Missing, "pose", "absent").inside("prior");
        assert_eq!(r.field, "prior.pose");
        assert_eq!(v1::Rejection::from(&r).code, "missing");
    }
}
