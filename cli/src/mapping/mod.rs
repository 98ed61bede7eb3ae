//! Laser maps from files: `waymark map build`, `import` and `export`. Files are read by `formats`; the mapping itself is
//! `map::slam`.

pub mod build;
pub(crate) mod import;

use formats::scan_log::LaserDefaults;

/// What is known of the laser where a log does not say it.
#[derive(Debug, Clone, Copy, clap::Args)]
pub struct LaserArgs {
    /// Ranges from here on are "no return", metres.
    #[arg(long, default_value_t = LaserDefaults::default().max_range_m)]
    max_range_m: f64,
    /// Angle of the fan, degrees, where the log gives none (CARMEN FLASER, numbered scans).
    #[arg(long, default_value_t = LaserDefaults::default().field_deg)]
    field_deg: f64,
}

impl LaserArgs {
    /// The values for reading logs.
    pub fn defaults(&self) -> LaserDefaults {
        LaserDefaults { max_range_m: self.max_range_m, field_deg: self.field_deg }
    }
}
