//! Lists of numbers of one length, for the OpenAPI document alone: the fields themselves are
//! arrays.

/// Two numbers: x and y in metres, or columns and rows in pixels.
#[derive(Debug, utoipa::ToSchema)]
#[schema(min_items = 2, max_items = 2)]
pub struct Pair(pub [f64; 2]);

/// Three numbers: x and y in metres and a heading in radians, or their errors; variances of a line.
#[derive(Debug, utoipa::ToSchema)]
#[schema(min_items = 3, max_items = 3)]
pub struct Triple(pub [f64; 3]);

/// Least x, least y, greatest x, greatest y, in metres.
#[derive(Debug, utoipa::ToSchema)]
#[schema(min_items = 4, max_items = 4)]
pub struct Bounds(pub [f64; 4]);

/// Corners in pixels: top-left, top-right, bottom-right, bottom-left.
#[derive(Debug, utoipa::ToSchema)]
#[schema(min_items = 4, max_items = 4, value_type = Vec<Pair>)]
pub struct Corners(pub [Pair; 4]);

/// A covariance over (x, y, theta), row-major, in m and rad.
#[derive(Debug, utoipa::ToSchema)]
#[schema(min_items = 9, max_items = 9)]
pub struct Covariance(pub [f64; 9]);

/// Two times in nanoseconds since the Unix epoch: from, to.
#[derive(Debug, utoipa::ToSchema)]
#[schema(min_items = 2, max_items = 2)]
pub struct Span(pub [i64; 2]);

/// Covariances of the four corners of a quad in square pixels, each (uu, uv, vv).
#[derive(Debug, utoipa::ToSchema)]
#[schema(min_items = 4, max_items = 4, value_type = Vec<Triple>)]
pub struct CornerCovariances(pub [Triple; 4]);
