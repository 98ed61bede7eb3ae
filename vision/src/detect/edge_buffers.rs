//! Edge maps whose memory is reused from image to image.

use crate::{
    detect::edges::edge_map::{self, EdgeMap, EdgeParams},
    frame::PictureRef,
};

/// Memory of earlier images, for callers with many images: fresh planes cost more than a tenth of
/// the time to segments. Results do not depend on it.
#[derive(Debug, Default)]
pub struct DetectBuffers {
    pub(crate) maps: Vec<EdgeMap>,
}

impl DetectBuffers {
    /// The edges of a picture, in the memory of the map that was given back last.
    pub(crate) fn edges(&mut self, image: PictureRef, p: &EdgeParams) -> EdgeMap {
        let mut map = self.maps.pop().unwrap_or_default();
        edge_map::edges_into(image, p, &mut map);
        map
    }

    pub(crate) fn give_back(&mut self, map: EdgeMap) {
        // One map a scale; the default detector returns the finest last and takes it first.
        if self.maps.len() < MAX_SCALES {
            self.maps.push(map);
        }
    }
}

/// Most scales of the default detector.
pub const MAX_SCALES: usize = 4;
