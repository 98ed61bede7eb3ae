//! `waymark map sight`: the camera that looks for a map's landmarks, with angles in degrees, as people have them.

use super::arg_parsers::numbers;
use client::MapClient;
use serde_json::{Map, Value};

/// A camera, and what counts as seen. What is not given stays as it is.
#[derive(Debug, Clone, clap::Args)]
pub(crate) struct SightArgs {
    /// Image size, pixels.
    #[arg(long, value_name = "WxH", value_parser = image)]
    image: Option<[f64; 2]>,
    /// Focal length, pixels.
    #[arg(long)]
    focal_px: Option<f64>,
    /// Height of the camera above the floor.
    #[arg(long)]
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
    /// How far before its wall a landmark is taken to hang.
    #[arg(long)]
    standoff_m: Option<f64>,
    /// Begin with the camera of a usual robot instead of the one that is set.
    #[arg(long)]
    usual: bool,
}

fn image(text: &str) -> Result<[f64; 2], String> {
    numbers(text, 'x').ok_or_else(|| "two numbers: WIDTHxHEIGHT in pixels".to_owned())
}

fn angles(text: &str) -> Result<[f64; 2], String> {
    numbers(text, ',').ok_or_else(|| "two numbers: lowest,highest in degrees".to_owned())
}

impl SightArgs {
    /// The numbers that are given, as the server calls them.
    fn given(&self) -> Map<String, Value> {
        let pair = |pair: Option<[f64; 2]>, i: usize| pair.map(|p| p[i]);
        let rad = |degrees: Option<f64>| degrees.map(f64::to_radians);
        let all = [
            ("width_px", pair(self.image, 0)),
            ("height_px", pair(self.image, 1)),
            ("focal_px", self.focal_px),
            ("camera_height_m", self.camera_height_m),
            ("tilt_low_rad", rad(pair(self.tilt_deg, 0))),
            ("tilt_high_rad", rad(pair(self.tilt_deg, 1))),
            ("pan_low_rad", rad(pair(self.pan_deg, 0))),
            ("pan_high_rad", rad(pair(self.pan_deg, 1))),
            ("max_incidence_rad", rad(self.max_incidence_deg)),
            ("min_side_px", self.min_side_px),
            ("max_fill", self.max_fill),
            ("standoff_m", self.standoff_m),
        ];
        all.into_iter().filter_map(|(name, value)| Some((name.to_owned(), value?.into()))).collect()
    }

    /// Sets what is given, if anything is, and gives what holds then.
    pub(super) async fn set(&self, maps: &MapClient, map: &str) -> anyhow::Result<Value> {
        let now = maps.visibility_settings(map).await?;
        let given = self.given();
        if given.is_empty() && !self.usual {
            return Ok(now);
        }
        let mut all = if self.usual { Map::new() } else { now.as_object().cloned().unwrap_or_default() };
        all.extend(given);
        Ok(maps.set_visibility_settings(map, &all.into()).await?)
    }
}

/// A setting for people.
pub(super) fn sentences(map: &str, sight: &Value) -> String {
    let number = |name: &str| sight[name].as_f64().unwrap_or_default();
    let degrees = |name: &str| number(name).to_degrees();
    format!(
        "{map}: camera {} x {} px, focal length {} px, {} m up, tilts {:.1} to {:.1}, pans {:.1} to {:.1} degrees\n\
         seen: sides from {} px, at most {:.0} % of the image, up to {:.1} degrees oblique, {} m off the wall",
        number("width_px"),
        number("height_px"),
        number("focal_px"),
        number("camera_height_m"),
        degrees("tilt_low_rad"),
        degrees("tilt_high_rad"),
        degrees("pan_low_rad"),
        degrees("pan_high_rad"),
        number("min_side_px"),
        100.0 * number("max_fill"),
        degrees("max_incidence_rad"),
        number("standoff_m"),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn what_is_given_goes_in_radians() {
        let args = SightArgs {
            image: image("1280x720").ok(),
            focal_px: None,
            camera_height_m: None,
            tilt_deg: angles("-10,60").ok(),
            pan_deg: None,
            max_incidence_deg: Some(60.0),
            min_side_px: None,
            max_fill: None,
            standoff_m: None,
            usual: false,
        };
        let expected = json!({ "width_px": 1280.0, "height_px": 720.0, "tilt_low_rad": (-10.0_f64).to_radians(),
            "tilt_high_rad": 60.0_f64.to_radians(), "max_incidence_rad": 60.0_f64.to_radians() });
        assert_eq!(Value::from(args.given()), expected);
        assert!(image("1280").is_err() && angles("1;2").is_err());
    }
}
