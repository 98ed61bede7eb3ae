//! End-to-end claims, one file each, against a real server.

mod api_client;
mod bad_frames;
mod clocks;
mod command_line;
mod demo;
mod earlier_database;
mod gathered_drive;
mod guided;
mod hang_ups;
mod http_contract;
mod imports;
mod laser;
mod live_mapping;
mod look_alikes;
mod moved_landmark;
mod other_map;
mod recordings;
mod restart;
mod several_maps;
mod style;
mod teach_and_recognise;
mod tidy;
mod two_programs;
mod visibility_settings;
