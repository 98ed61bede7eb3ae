//! The messages by the name of their type, for who learns the type from a key, a token or a
//! setting.

use super::{
    CameraInfo, CompressedImage, Detection2DArray, Header, Image, LaserScan, Message, Odometry,
    PoseWithCovarianceStamped, TFMessage,
};
use crate::{
    cdr::{ByteOrder, CdrError},
    type_name::TypeName,
};

macro_rules! messages {
    ($($kind:ident),*) => {
        /// The types of messages that this crate knows.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum MessageKind {
            $(#[doc = concat!("[`", stringify!($kind), "`].")] $kind),*
        }

        impl MessageKind {
            /// Every kind.
            pub const ALL: &[Self] = &[$(Self::$kind),*];

            /// The name of the type.
            pub const fn name(self) -> TypeName<'static> {
                match self {
                    $(Self::$kind => <$kind<'static> as Message<'static>>::NAME),*
                }
            }

            /// The hash of the definition, `RIHS01_` and 64 hexadecimal digits.
            pub const fn hash(self) -> &'static str {
                match self {
                    $(Self::$kind => <$kind<'static> as Message<'static>>::HASH),*
                }
            }

            /// Reads a payload of this type.
            pub fn decode(self, payload: &[u8]) -> Result<AnyMessage<'_>, CdrError> {
                Ok(match self {
                    $(Self::$kind => AnyMessage::$kind($kind::decode(payload)?)),*
                })
            }
        }

        /// A message of one of the known types.
        #[derive(Debug, Clone, PartialEq)]
        #[allow(clippy::large_enum_variant, reason = "it is matched where it is made, never stored")]
        pub enum AnyMessage<'a> {
            $(#[doc = concat!("[`", stringify!($kind), "`].")] $kind($kind<'a>)),*
        }

        impl AnyMessage<'_> {
            /// Its type.
            pub fn kind(&self) -> MessageKind {
                match self {
                    $(Self::$kind(_) => MessageKind::$kind),*
                }
            }

            /// The payload in a given byte order.
            pub fn encode_in(&self, order: ByteOrder) -> Vec<u8> {
                match self {
                    $(Self::$kind(message) => message.encode_in(order)),*
                }
            }
        }
    };
}

messages!(
    Image,
    CompressedImage,
    CameraInfo,
    LaserScan,
    Odometry,
    TFMessage,
    PoseWithCovarianceStamped,
    Detection2DArray
);

impl MessageKind {
    /// The kind of a type; `None` for a type that is not known.
    pub fn of(name: TypeName<'_>) -> Option<Self> {
        Self::ALL.iter().copied().find(|kind| kind.name() == name)
    }

    /// Whether the message itself has a field of type `uint8[]`, which publishers since Lyrical
    /// send as a buffer.
    pub fn has_bytes(self) -> bool {
        matches!(self, Self::Image | Self::CompressedImage)
    }
}

impl<'a> AnyMessage<'a> {
    /// Its header; a `TFMessage` has one for each transform and none of its own.
    pub fn header(&self) -> Option<&Header<'a>> {
        match self {
            Self::Image(message) => Some(&message.header),
            Self::CompressedImage(message) => Some(&message.header),
            Self::CameraInfo(message) => Some(&message.header),
            Self::LaserScan(message) => Some(&message.header),
            Self::Odometry(message) => Some(&message.header),
            Self::PoseWithCovarianceStamped(message) => Some(&message.header),
            Self::Detection2DArray(message) => Some(&message.header),
            Self::TFMessage(_) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_is_found_by_its_name() {
        for kind in MessageKind::ALL {
            assert_eq!(MessageKind::of(kind.name()), Some(*kind));
            assert_eq!(kind.hash().len(), "RIHS01_".len() + 64);
        }
        assert_eq!(MessageKind::of(TypeName::from_ros("std_msgs/msg/Image").unwrap()), None);
    }
}
