//! Options of `map create` and `map locate`: where a map belongs, and its link to another map.

use crate::arg_parsers::numbers;
use client::api::{MapPatch, NewMap, Parent};

/// Location of a map.
#[derive(Debug, Clone, clap::Args)]
pub(super) struct LocationArgs {
    /// The site it belongs to.
    #[arg(long)]
    site: Option<String>,
    /// The building.
    #[arg(long)]
    building: Option<String>,
    /// The floor.
    #[arg(long)]
    floor: Option<String>,
    /// The map in whose coordinate frame it lies; with --at.
    #[arg(long = "in", value_name = "MAP", requires = "at")]
    parent: Option<String>,
    /// Position of its origin and rotation of its x axis in that map: x,y in metres, degrees.
    #[arg(long, value_name = "X,Y,DEG", value_parser = origin, requires = "parent", allow_hyphen_values = true)]
    at: Option<[f64; 3]>,
    /// Height of its floor above the floor of that map, metres.
    #[arg(long, default_value_t = 0.0, allow_hyphen_values = true)]
    level_m: f64,
}

impl LocationArgs {
    /// The map link, if it is given.
    fn link(&self) -> Option<Parent> {
        let (map, [x_m, y_m, degrees]) = self.parent.as_ref().zip(self.at)?;
        let theta_rad = degrees.to_radians();
        Some(Parent { map: map.clone(), x_m, y_m, theta_rad, level_m: self.level_m, covariance: None })
    }

    /// A map with what is given.
    pub(super) fn new_map(&self, name: &str) -> NewMap {
        NewMap {
            name: name.to_owned(),
            site: self.site.clone(),
            building: self.building.clone(),
            floor: self.floor.clone(),
            parent: self.link(),
            ..NewMap::default()
        }
    }

    /// A change to what is given; the rest stays.
    pub(super) fn patch(&self) -> MapPatch {
        MapPatch {
            site: self.site.clone().map(Some),
            building: self.building.clone().map(Some),
            floor: self.floor.clone().map(Some),
            parent: self.link().map(Some),
            ..MapPatch::default()
        }
    }
}

fn origin(text: &str) -> Result<[f64; 3], String> {
    numbers(text, ',').ok_or_else(|| "three numbers: x,y in metres, direction in degrees".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_given_stays() {
        let args = LocationArgs {
            site: None,
            building: Some("house".into()),
            floor: None,
            parent: Some("plan".into()),
            at: origin("1,2,90").ok(),
            level_m: 3.4,
        };
        let patch = args.patch();
        assert_eq!((patch.site, patch.building), (None, Some(Some("house".into()))));
        let link = patch.parent.flatten().unwrap();
        assert!((link.theta_rad - std::f64::consts::FRAC_PI_2).abs() < 1e-12, "{link:?}");
        assert_eq!((link.map.as_str(), args.new_map("a").name.as_str()), ("plan", "a"));
        assert!(origin("1,2").is_err());
    }
}
