//! Grey image in, edges one pixel wide out (method 1.1, 1.2).

pub(crate) mod row_transpose;
pub(crate) mod deriche;
pub(crate) mod strongest_plane;
pub(crate) mod maxima;
pub(crate) mod edge_thinning;
pub mod edge_map;
