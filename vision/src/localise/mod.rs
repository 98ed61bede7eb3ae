//! Where the camera is, from a recognised landmark of known size (method 13), and what the camera is, from several
//! views of one (method 16).

pub mod reproject;
mod refine;
mod spread;
pub mod pose;
pub mod calibrate;
