//! Keys of types with a `uint8[]` since Lyrical 0.10.5 and Rolling 0.12.0.
//!
//! Source: `buffer_endpoint_helpers.hpp`, `rmw_publisher_data.cpp`, `rmw_subscription_data.cpp`. A
//! volatile publisher of such a type publishes nothing before it knows a subscription's token.
//! Where every known subscription counts as aware of buffers, it publishes on `<key>/_buf_cpu`
//! only. So a subscriber declares its token with [`CPU_BACKEND`] and listens to both keys; older
//! nodes ignore the addition.

use super::data_key::CPU_BUFFERS;

/// The backends of a subscription that takes plain CDR only, for [`super::Endpoint::backends`].
pub const CPU_BACKEND: &str = "cpu:";

/// The key, or pattern, of plain CDR beside that of a topic.
pub fn cpu_buffers_of(key: &str) -> String {
    format!("{key}/{CPU_BUFFERS}")
}
