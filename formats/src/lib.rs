//! Files of other programs: logs of laser scans, walls of buildings, and the drawing of a laser
//! map.
//!
//! In: paths. Out: checked types of `map`, or an error that names the line and the field. Every
//! file has a largest size.

pub mod map_svg;
pub mod scan_log;
pub mod svg;
pub mod walls;
