//! `waymark map visibility`: the visibility settings of a map, with angles in degrees.

use crate::arg_parsers::{height_m, numbers};
use client::{MapClient, Revised, api::VisibilitySettingsBody};

/// A camera and the limits that define "visible". Options that are absent change nothing.
#[derive(Debug, Clone, clap::Args)]
pub(super) struct VisibilityArgs {
    /// Image size, pixels.
    #[arg(long, value_name = "WxH", value_parser = image)]
    image: Option<[f64; 2]>,
    /// Focal length, pixels.
    #[arg(long)]
    focal_px: Option<f64>,
    /// Height of the camera above the floor.
    #[arg(long, value_name = "METRES", value_parser = height_m)]
    camera_height_m: Option<f64>,
    /// Lowest and highest tilt, up positive.
    #[arg(long, value_name = "LOW,HIGH", value_parser = angles, allow_hyphen_values = true)]
    tilt_deg: Option<[f64; 2]>,
    /// Rightmost and leftmost pan, left positive.
    #[arg(long, value_name = "LOW,HIGH", value_parser = angles, allow_hyphen_values = true)]
    pan_deg: Option<[f64; 2]>,
    /// Most oblique view of a landmark, against its normal.
    #[arg(long)]
    max_incidence_deg: Option<f64>,
    /// Shortest side of a landmark in the image.
    #[arg(long)]
    min_side_px: Option<f64>,
    /// Largest share of the image that a landmark may take.
    #[arg(long)]
    max_fill: Option<f64>,
    /// Distance of a landmark from its wall.
    #[arg(long)]
    standoff_m: Option<f64>,
    /// Start from the default settings instead of the present ones.
    #[arg(long)]
    defaults: bool,
}

fn image(text: &str) -> Result<[f64; 2], String> {
    numbers(text, 'x').ok_or_else(|| "two numbers: WIDTHxHEIGHT in pixels".to_owned())
}

fn angles(text: &str) -> Result<[f64; 2], String> {
    numbers(text, ',').ok_or_else(|| "two numbers: lowest,highest in degrees".to_owned())
}

impl VisibilityArgs {
    /// `settings`, with the given options in their place.
    fn over(&self, settings: &VisibilitySettingsBody) -> VisibilitySettingsBody {
        let pair = |pair: Option<[f64; 2]>, i: usize| pair.map(|p| p[i]);
        let rad = |degrees: Option<f64>| degrees.map(f64::to_radians);
        VisibilitySettingsBody {
            width_px: pair(self.image, 0).or(settings.width_px),
            height_px: pair(self.image, 1).or(settings.height_px),
            focal_px: self.focal_px.or(settings.focal_px),
            camera_height_m: self.camera_height_m.or(settings.camera_height_m),
            tilt_low_rad: rad(pair(self.tilt_deg, 0)).or(settings.tilt_low_rad),
            tilt_high_rad: rad(pair(self.tilt_deg, 1)).or(settings.tilt_high_rad),
            pan_low_rad: rad(pair(self.pan_deg, 0)).or(settings.pan_low_rad),
            pan_high_rad: rad(pair(self.pan_deg, 1)).or(settings.pan_high_rad),
            max_incidence_rad: rad(self.max_incidence_deg).or(settings.max_incidence_rad),
            min_side_px: self.min_side_px.or(settings.min_side_px),
            max_fill: self.max_fill.or(settings.max_fill),
            standoff_m: self.standoff_m.or(settings.standoff_m),
        }
    }

    /// Sets the given options, if there are any, and gives the settings after that.
    pub(super) async fn set(&self, maps: &MapClient, map: &str) -> anyhow::Result<VisibilitySettingsBody> {
        let Revised { value: now, revision } = maps.visibility_settings_revised(map).await?;
        let none = VisibilitySettingsBody::default();
        if self.over(&none) == none && !self.defaults {
            return Ok(now);
        }
        let all = self.over(if self.defaults { &none } else { &now });
        Ok(maps.if_match(&revision).set_visibility_settings(map, &all).await?)
    }
}

pub(super) fn sentences(map: &str, settings: &VisibilitySettingsBody) -> String {
    let number = Option::unwrap_or_default;
    let degrees = |angle: Option<f64>| number(angle).to_degrees();
    format!(
        "{map}: camera {} x {} px, focal length {} px, {} m up, tilts {:.1} to {:.1}, pans {:.1} to {:.1} degrees\n\
         visible: sides from {} px, at most {:.0} % of the image, up to {:.1} degrees oblique, {} m off the wall",
        number(settings.width_px),
        number(settings.height_px),
        number(settings.focal_px),
        number(settings.camera_height_m),
        degrees(settings.tilt_low_rad),
        degrees(settings.tilt_high_rad),
        degrees(settings.pan_low_rad),
        degrees(settings.pan_high_rad),
        number(settings.min_side_px),
        100.0 * number(settings.max_fill),
        degrees(settings.max_incidence_rad),
        number(settings.standoff_m),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_given_goes_in_radians() {
        let args = VisibilityArgs {
            image: image("1280x720").ok(),
            focal_px: None,
            camera_height_m: None,
            tilt_deg: angles("-10,60").ok(),
            pan_deg: None,
            max_incidence_deg: Some(60.0),
            min_side_px: None,
            max_fill: None,
            standoff_m: None,
            defaults: false,
        };
        let now = VisibilitySettingsBody {
            width_px: Some(640.0),
            focal_px: Some(512.0),
            ..VisibilitySettingsBody::default()
        };
        let expected = VisibilitySettingsBody {
            width_px: Some(1280.0),
            height_px: Some(720.0),
            tilt_low_rad: Some((-10.0_f64).to_radians()),
            tilt_high_rad: Some(60.0_f64.to_radians()),
            max_incidence_rad: Some(60.0_f64.to_radians()),
            ..now
        };
        assert_eq!(args.over(&now), expected);
        assert!(image("1280").is_err() && angles("1;2").is_err());
    }
}
