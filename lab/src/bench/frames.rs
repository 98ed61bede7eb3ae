//! Pictures to time detection on, all 640 x 480, in colour where they have it: robots' and
//! visitors' photographs where the data is at hand, else rendered views.

use anyhow::Context as _;
use cli::pictures;
use image::{GrayImage as Buffer, Luma, imageops};
use sim::views::{Views, ViewsParams};
use std::path::{Path, PathBuf};
use vision::frame::{GrayImage, Picture};

const WIDTH: u32 = 640;
const HEIGHT: u32 = 480;
/// Sets that are used if present: indoor scenes by three cameras.
const SETS: [&str; 3] = ["corridor-loop-rtabmap", "museum-walk-estense", "exit-signs"];
/// Default folder of the open sets, relative to the project.
const DATA: &str = "../shared/data";

/// Pictures, and where they come from.
pub(super) struct Frames {
    pub(super) from: String,
    pub(super) frames: Vec<Picture>,
}

impl Frames {
    /// `count` pictures, evenly over the named files and folders; without any, over the open sets,
    /// or rendered.
    pub(super) fn new(
        named: &[PathBuf],
        data: Option<&Path>,
        count: usize,
        seed: u64,
    ) -> anyhow::Result<Self> {
        let data = data.unwrap_or(Path::new(DATA));
        let sets: Vec<PathBuf> = SETS.iter().map(|set| data.join(set)).filter(|set| set.is_dir()).collect();
        let sources = if named.is_empty() { &sets } else { named };
        if sources.is_empty() {
            let params = ViewsParams { seed, views: count, ..ViewsParams::default() };
            let frames = Views::new(&params).map(|view| view.image.into()).collect();
            return Ok(Self { from: "rendered corridors".into(), frames });
        }
        let mut frames = Vec::new();
        for (i, source) in sources.iter().enumerate() {
            let share = count / sources.len() + usize::from(i < count % sources.len());
            for path in evenly(&below(source)?, share) {
                let picture = pictures::read_picture(path).with_context(|| path.display().to_string())?;
                frames.push(picture.map(vga));
            }
        }
        anyhow::ensure!(!frames.is_empty(), "no pictures to time on");
        let name = |p: &PathBuf| p.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
        Ok(Self { from: sources.iter().map(name).collect::<Vec<_>>().join(", "), frames })
    }
}

/// The picture itself, or all PNG and JPEG files in a folder and its folders, by name.
fn below(path: &Path) -> anyhow::Result<Vec<PathBuf>> {
    if !path.is_dir() {
        return Ok(vec![path.to_owned()]);
    }
    let entries = std::fs::read_dir(path).with_context(|| format!("cannot read {}", path.display()))?;
    let mut inside = entries.map(|e| e.map(|e| e.path())).collect::<Result<Vec<_>, _>>()?;
    inside.sort();
    let mut all = Vec::new();
    for entry in inside {
        if entry.is_dir() {
            all.extend(below(&entry)?);
        } else if pictures::is_picture(&entry) {
            all.push(entry);
        }
    }
    Ok(all)
}

/// `count` items at even distances, or all if there are fewer.
fn evenly<T>(items: &[T], count: usize) -> impl Iterator<Item = &T> {
    let count = count.min(items.len());
    (0..count).map(move |i| &items[(2 * i + 1) * items.len() / (2 * count)])
}

/// The middle of a plane in the shape of a frame, as much as there is, brought to 640 x 480.
fn vga(plane: &GrayImage) -> GrayImage {
    let (width, height) = (plane.width() as u32, plane.height() as u32);
    let buffer = Buffer::from_fn(width, height, |u, v| Luma([plane.at(u as usize, v as usize)]));
    let (w, h) = (width.min(height * WIDTH / HEIGHT).max(1), height.min(width * HEIGHT / WIDTH).max(1));
    let middle = imageops::crop_imm(&buffer, (width - w) / 2, (height - h) / 2, w, h).to_image();
    let frame = imageops::resize(&middle, WIDTH, HEIGHT, imageops::FilterType::Triangle);
    GrayImage::from_fn(WIDTH as usize, HEIGHT as usize, |u, v| frame.get_pixel(u as u32, v as u32).0[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn evenly_takes_both_ends_and_no_item_twice() {
        let items: Vec<usize> = (0..10).collect();
        assert_eq!(evenly(&items, 2).copied().collect::<Vec<_>>(), [2, 7]);
        assert_eq!(evenly(&items, 10).copied().collect::<Vec<_>>(), items);
        assert_eq!(evenly(&items, 99).count(), 10);
        assert_eq!(evenly(&items[..0], 3).count(), 0);
    }

    #[test]
    fn any_shape_becomes_vga_about_its_centre() {
        for (w, h) in [(1280, 720), (360, 640), (512, 384), (640, 480), (3, 1000)] {
            let bright_middle = GrayImage::from_fn(w, h, |u, v| {
                if u.abs_diff(w / 2) * 4 < w && v.abs_diff(h / 2) * 4 < h { 250 } else { 10 }
            });
            let out = vga(&bright_middle);
            assert_eq!((out.width(), out.height()), (640, 480));
            assert!(out.data()[240 * 640 + 320].abs_diff(250) < 2, "{w} x {h}");
        }
    }

    #[test]
    fn without_data_views_are_rendered() {
        let frames = Frames::new(&[], Some(Path::new("no/such/folder")), 2, 1).unwrap();
        assert_eq!((frames.frames.len(), frames.from.as_str()), (2, "rendered corridors"));
    }
}
