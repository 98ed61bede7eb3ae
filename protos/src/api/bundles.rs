//! `/bundles`: a map as one file.

use serde::{Deserialize, Serialize};

/// How a bundle becomes a map.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::IntoParams))]
#[cfg_attr(feature = "openapi", into_params(parameter_in = Query))]
#[serde(deny_unknown_fields)]
pub struct BundleQuery {
    /// Name of the new map, `[a-z0-9_-]{1,64}`; left out, that of the bundle.
    pub name: Option<String>,
    /// Leave out the link to the map that it lies in; otherwise a map of that name must be there.
    #[serde(default)]
    pub without_link: bool,
}
