//! Keys, liveliness tokens and attachments of `rmw_zenoh`, the middleware of ROS 2 over zenoh.
//!
//! Sources: `ros2/rmw_zenoh`, its design document and its folder `rmw_zenoh_cpp/src/detail`, as
//! released for Humble 0.1.9, Jazzy 0.2.10, Kilted 0.6.7, Lyrical 0.10.5 and Rolling 0.12.0. The
//! sources that modules name are files of that folder where no other repository stands before them.
//!
//! A topic is one key of domain, name, type and hash of the definition; data match by that key
//! alone. Who publishes and subscribes stands in liveliness tokens, which delivery does not need.
//! Publishers of images wait for the token of a subscription, though: an entity that wants images
//! declares a node and, for each topic, a subscription.

mod domain;
mod data_key;
mod namespace;
mod buffers;
mod history;
mod qos;
mod token;
mod gid;
mod attachment;
mod local_node;

pub use attachment::{Attachment, AttachmentError};
pub use buffers::{CPU_BACKEND, cpu_buffers_of};
pub use data_key::{Channel, DataKey, DataKeyError, HASH_NOT_SUPPORTED, MAX_KEY_BYTES};
pub use gid::Gid;
pub use history::{ACCEPT_ANY_KEY, CacheKey, newest, publishers_of};
pub use local_node::{LocalNode, Sender};
pub use namespace::{inside_namespace, strip_namespace};
pub use qos::{Durability, History, Liveliness, Qos, QosDuration, QosError, Reliability};
pub use token::{Endpoint, EntityKind, MAX_TOKEN_BYTES, Token, TokenError};
