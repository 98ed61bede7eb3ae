//! End-to-end claims, one file each, against a real server.

mod http_contract;
mod restart;
