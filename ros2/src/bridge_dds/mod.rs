//! Keys and liveliness tokens of zenoh-bridge-ros2dds, which joins robots of DDS to zenoh.
//!
//! Source: `eclipse-zenoh/zenoh-plugin-ros2dds zenoh-plugin-ros2dds/src`, 2026-08; each file names
//! its own. Not interoperable with `rmw_zenoh`. The payload is that of DDS, with its header, and
//! topics have no attachment. A key names no domain, type or hash: the type of a topic stands in
//! the tokens of its publishers. Transient local topics are asked for as with `rmw_zenoh`
//! ([`crate::rmw_zenoh::publishers_of`]), by bridges since 1.5.1.

mod key;
mod qos;
mod token;

pub use key::key_of;
pub use qos::{DdsDurability, DdsHistory, DdsHistoryKind, DdsQos, DdsQosError, DdsReliability};
pub use token::{BridgeEndpoint, BridgeKind, BridgeToken, BridgeTokenError, MAX_BRIDGE_TOKEN_BYTES};
