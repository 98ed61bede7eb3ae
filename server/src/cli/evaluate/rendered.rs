//! The rendered sets: pictures of `sim` with exact truth, written as a folder in the evaluation format, so that they
//! are evaluated, looked at and kept like any other set.

use crate::cli::{scratch, screen};
use anyhow::Context as _;
use image::{ExtendedColorType, ImageEncoder as _, codecs::png};
use sim::views::{Views, ViewsParams};
use std::path::{Path, PathBuf};
use vision::frame::GrayImage;

/// Name by which the rendered corridor is asked for in place of a folder.
const CORRIDOR: &str = "corridor";

/// The folder that a set is in. Where `corridor` is asked for in place of one, its views are rendered: into `keep`, or
/// into a folder that lasts as long as the second value.
pub(crate) fn folder(
    set: &Path,
    keep: Option<&Path>,
    views: &ViewsParams,
) -> anyhow::Result<(PathBuf, Option<scratch::Folder>)> {
    if set.as_os_str() != CORRIDOR || set.is_dir() {
        return Ok((set.to_owned(), None));
    }
    if let Some(keep) = keep {
        write_corridor(keep, views)?;
        return Ok((keep.to_owned(), None));
    }
    let scratch = scratch::Folder::new("views")?;
    write_corridor(scratch.path(), views)?;
    Ok((scratch.path().to_owned(), Some(scratch)))
}

/// Renders the corridor's views into `folder`, which is made if it is not there.
fn write_corridor(folder: &Path, params: &ViewsParams) -> anyhow::Result<()> {
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
