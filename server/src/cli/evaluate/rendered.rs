//! The rendered sets: pictures of `sim` with exact truth, written as a folder in the evaluation format, so that they
//! are evaluated, looked at and kept like any other set.

use crate::cli::screen;
use anyhow::Context as _;
use image::{ExtendedColorType, ImageEncoder as _, codecs::png};
use sim::views::{Views, ViewsParams};
use std::path::Path;
use vision::frame::GrayImage;

/// Name by which the rendered corridor is asked for in place of a folder.
pub(crate) const CORRIDOR: &str = "corridor";

/// Renders the corridor's views into `folder`, which is made if it is not there.
pub(crate) fn write_corridor(folder: &Path, params: &ViewsParams) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    let views = Views::new(params);
    let progress = screen::progress(views.size_hint().0, "rendering");
    let mut entries = Vec::new();
    for view in views {
        let path = folder.join(&view.entry.file);
        std::fs::write(&path, png(&view.image)?)
            .with_context(|| format!("cannot write {}", path.display()))?;
        entries.push(view.entry);
        progress.inc(1);
    }
    progress.finish_and_clear();
    let path = folder.join("truth.json");
    std::fs::write(&path, serde_json::to_vec(&Views::data_set(entries))?)
        .with_context(|| format!("cannot write {}", path.display()))
}

/// A grey image as PNG, packed quickly: noise does not get smaller.
fn png(image: &GrayImage) -> Result<Vec<u8>, image::ImageError> {
    let mut out = Vec::new();
    png::PngEncoder::new_with_quality(&mut out, png::CompressionType::Fast, png::FilterType::Sub)
        .write_image(image.data(), image.width() as u32, image.height() as u32, ExtendedColorType::L8)?;
    Ok(out)
}
