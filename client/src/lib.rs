//! Robot SDK over zenoh and HTTP.
