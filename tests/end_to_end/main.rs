//! End-to-end claims, one file each, against a real server.

mod bad_frames;
mod http_contract;
mod restart;
mod teach_and_recognise;
