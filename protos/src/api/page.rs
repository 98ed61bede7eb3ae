//! Lists in pages.

use serde::{Deserialize, Serialize};

/// Which page of a list.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::IntoParams))]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", into_params(parameter_in = Query))]
pub struct PageQuery {
    /// Most items; 100 by default, bounded by `limits.page`.
    pub limit: Option<usize>,
    /// The `next` of the page before; absent for the first page.
    pub cursor: Option<String>,
}

/// A page of a list.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Page<T> {
    /// The items, in order.
    pub items: Vec<T>,
    /// Give this as `cursor` for the next page; null on the last.
    pub next: Option<String>,
    /// Items of all pages together.
    #[serde(default)]
    pub total: u64,
}

/// The order of a list: by name, or by the time of the last edit or lesson; `-` reverses it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub enum ListOrder {
    /// By name.
    #[default]
    #[serde(rename = "name")]
    Name,
    /// By name, from the end.
    #[serde(rename = "-name")]
    NameReversed,
    /// The one that was changed longest ago first.
    #[serde(rename = "changed")]
    Changed,
    /// The one that was changed last first.
    #[serde(rename = "-changed")]
    ChangedReversed,
}

/// Which items of a list with names, in which order, and which page of them.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::IntoParams))]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", into_params(parameter_in = Query))]
pub struct ListQuery {
    /// Most items; 100 by default, bounded by `limits.page`.
    pub limit: Option<usize>,
    /// The `next` of the page before; absent for the first page.
    pub cursor: Option<String>,
    /// Only those whose name contains this.
    pub name: Option<String>,
    /// `name` by default.
    pub sort: Option<ListOrder>,
}
