//! Where the camera is, from a recognised landmark of known size (method 13).

pub mod reproject;
mod refine;
mod spread;
pub mod pose;
