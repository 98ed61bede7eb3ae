//! The rendered sets: pictures of `sim` with exact truth, written as a folder in the evaluation
//! format, so that they are used like any other set.

use anyhow::Context as _;
use cli::{pictures, scratch, screen};
use image::{ExtendedColorType, ImageEncoder as _, codecs::png};
use sim::{
    export::{DataSet, ImageEntry},
    scenes::{MAX_PICTURES, Scenes, ScenesParams},
    texture::{Edge, Texture},
    views::{Views, ViewsParams},
};
use std::path::{Path, PathBuf};
use vision::{detect::pyramid, frame::GrayImage};

/// Argument that names the rendered corridor instead of a folder.
const CORRIDOR: &str = "corridor";
/// Argument that names the rendered scenes.
const SCENES: &str = "scenes";
/// Pictures that hang in scenes are reduced to about this many pixels a side.
const HUNG_SIDE_PX: usize = 256;

/// The folder of a set. For `corridor` or `scenes` views are rendered: into `keep`, or into a
/// temporary folder that lasts as long as the second value.
pub(crate) fn folder(
    set: &Path,
    keep: Option<&Path>,
    views: &ViewsParams,
) -> anyhow::Result<(PathBuf, Option<scratch::Folder>)> {
    let rendered = set.as_os_str() == CORRIDOR || set.as_os_str() == SCENES;
    if !rendered || set.is_dir() {
        return Ok((set.to_owned(), None));
    }
    let scratch = if keep.is_some() { None } else { Some(scratch::Folder::new("views")?) };
    let folder = keep.or(scratch.as_ref().map(scratch::Folder::path)).unwrap_or(set).to_owned();
    if set.as_os_str() == CORRIDOR {
        write_corridor(&folder, views)?;
    } else {
        let params = ScenesParams { seed: views.seed, scenes: views.views, ..ScenesParams::default() };
        write_scenes(&folder, &params, vec![])?;
    }
    Ok((folder, scratch))
}

/// Renders the corridor's views into `folder`, which is created if it is missing.
pub(crate) fn write_corridor(folder: &Path, params: &ViewsParams) -> anyhow::Result<()> {
    write(folder, Views::new(params).map(|v| (v.image, v.entry)), Views::data_set)
}

/// Renders scenes likewise, with `pictures` beside generated ones.
pub(crate) fn write_scenes(
    folder: &Path,
    params: &ScenesParams,
    pictures: Vec<Texture>,
) -> anyhow::Result<()> {
    write(folder, Scenes::new(params, pictures).map(|s| (s.image, s.entry)), Scenes::data_set)
}

/// The pictures of a folder, by name, to hang in scenes.
pub(crate) fn pictures(folder: &Path) -> anyhow::Result<Vec<Texture>> {
    let entries = std::fs::read_dir(folder).with_context(|| format!("cannot read {}", folder.display()))?;
    let mut paths: Vec<PathBuf> = entries.filter_map(|e| e.ok().map(|e| e.path())).collect();
    paths.retain(|path| pictures::is_picture(path));
    paths.sort();
    let texture = |path: &PathBuf| {
        let gray = pictures::read(path).with_context(|| path.display().to_string())?;
        let small = pyramid::reduce(&gray, pyramid::working_factor(&gray, HUNG_SIDE_PX));
        Ok(Texture::new(small.width(), small.height(), small.data().to_vec(), Edge::Clamp))
    };
    paths.iter().take(MAX_PICTURES).map(texture).collect()
}

fn write(
    folder: &Path,
    pictures: impl Iterator<Item = (GrayImage, ImageEntry)>,
    set: fn(Vec<ImageEntry>) -> DataSet,
) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    let progress = screen::progress(pictures.size_hint().0, "rendering");
    let mut entries = Vec::new();
    for (image, entry) in pictures {
        let path = folder.join(&entry.file);
        std::fs::write(&path, png(&image)?).with_context(|| format!("cannot write {}", path.display()))?;
        entries.push(entry);
        progress.inc(1);
    }
    progress.finish_and_clear();
    let path = folder.join("truth.json");
    std::fs::write(&path, serde_json::to_vec(&set(entries))?)
        .with_context(|| format!("cannot write {}", path.display()))
}

/// A grey image as PNG, with fast compression: noise does not compress.
fn png(image: &GrayImage) -> Result<Vec<u8>, image::ImageError> {
    let mut out = Vec::new();
    png::PngEncoder::new_with_quality(&mut out, png::CompressionType::Fast, png::FilterType::Sub)
        .write_image(image.data(), image.width() as u32, image.height() as u32, ExtendedColorType::L8)?;
    Ok(out)
}
