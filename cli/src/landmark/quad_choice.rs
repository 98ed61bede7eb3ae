//! A photograph that shows several framed objects: they are numbered from left to right, drawn
//! beside the photograph, and one is taken with `--pick`. In: the quads of the server's refusal.
//! Out: a picture, or the corners of one.

use crate::{
    drawing::{Picture, SERIES},
    failure::{Class, Failure},
    pictures, screen,
};
use client::ClientError;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use vision::geometry::Corners;

/// Pixels a dot of the numbers.
const DIGIT_DOT_PX: usize = 6;

/// Corners of a quad, px: top-left, top-right, bottom-right, bottom-left.
type Quad = [[f64; 2]; 4];

/// The quads that a refusal names, from left to right, those above one another from above.
pub(super) fn quads(error: &ClientError) -> Option<Vec<Quad>> {
    let ClientError::Refused { code, more, .. } = error else { return None };
    if code != "quad_ambiguous" {
        return None;
    }
    let mut quads: Vec<Quad> = serde_json::from_value(more.get("quads")?.clone()).ok()?;
    let centre = |q: &Quad, k: usize| q.iter().map(|c| c[k]).sum::<f64>() / 4.0;
    quads.sort_by(|a, b| centre(a, 0).total_cmp(&centre(b, 0)).then(centre(a, 1).total_cmp(&centre(b, 1))));
    Some(quads)
}

/// The quad with a number, counted from 1.
pub(super) fn picked(quads: &[Quad], number: usize) -> Result<Quad, Failure> {
    number.checked_sub(1).and_then(|i| quads.get(i)).copied().ok_or_else(|| {
        Failure::usage(format!(
            "--pick {number}: there are {}.",
            screen::counted(quads.len() as u64, "framed object")
        ))
    })
}

/// The refusal of a photograph with several quads: where each is, and a picture of them.
pub(super) fn refusal(photograph: &Path, quads: &[Quad]) -> Failure {
    let picture = drawn(photograph, quads).ok();
    let list: Vec<String> =
        quads.iter().enumerate().map(|(i, q)| format!("{} {}", i + 1, extent(q))).collect();
    let seen = picture.as_ref().map_or_else(String::new, |p| format!(", numbered in {}", p.display()));
    let sentence =
        format!("{}: {} framed objects found{seen}: {}.", photograph.display(), quads.len(), list.join("; "));
    let mut failure = Failure::new(Class::Refused, "quad_ambiguous", sentence)
        .advise("Take one with --pick N, or crop the photograph to one.");
    failure.more.insert("quads".into(), json!(quads));
    failure.more.insert("picture".into(), picture.map_or(Value::Null, |p| json!(p)));
    failure
}

fn extent(quad: &Quad) -> String {
    let range = |k: usize| {
        let values = quad.iter().map(|c| c[k]);
        (values.clone().fold(f64::INFINITY, f64::min), values.fold(f64::NEG_INFINITY, f64::max))
    };
    let ((left, right), (top, bottom)) = (range(0), range(1));
    format!("({left:.0}..{right:.0} x {top:.0}..{bottom:.0} px)")
}

/// Draws the quads with their numbers beside the photograph: `hall.jpg` gives `hall.quads.png`.
fn drawn(photograph: &Path, quads: &[Quad]) -> anyhow::Result<PathBuf> {
    let image = pictures::read(photograph)?;
    let mut picture = Picture::of(&image, 0.7);
    for (i, quad) in quads.iter().enumerate() {
        let colour = SERIES[i % SERIES.len()];
        let corners = Corners::try_from(*quad)?;
        picture.quad(&corners, 3.0, colour);
        let [x, y] = [0, 1].map(|k| quad.iter().map(|c| c[k]).sum::<f64>() / 4.0);
        picture.text([x.max(0.0) as usize, y.max(0.0) as usize], DIGIT_DOT_PX, &(i + 1).to_string(), colour);
    }
    let path = photograph.with_extension("quads.png");
    picture.save(&path)?;
    Ok(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(x: f64, y: f64) -> Quad {
        [[x, y], [x + 50.0, y], [x + 50.0, y + 50.0], [x, y + 50.0]]
    }

    fn ambiguous(quads: &[Quad]) -> ClientError {
        let mut more = serde_json::Map::new();
        more.insert("quads".into(), json!(quads));
        let (code, field) = ("quad_ambiguous".to_owned(), "corners".to_owned());
        ClientError::Refused { status: 422, code, field, detail: String::new(), more }
    }

    #[test]
    fn quads_are_numbered_from_left_to_right_and_drawn() {
        let found = quads(&ambiguous(&[square(300.0, 10.0), square(20.0, 90.0), square(20.0, 5.0)])).unwrap();
        assert_eq!(found, [square(20.0, 5.0), square(20.0, 90.0), square(300.0, 10.0)]);
        assert_eq!(picked(&found, 3).unwrap(), square(300.0, 10.0));
        for wrong in [0, 4] {
            assert_eq!(picked(&found, wrong).unwrap_err().class, Class::Usage);
        }
        let folder = tempfile::tempdir().unwrap();
        let photograph = folder.path().join("hall.png");
        image::GrayImage::from_pixel(400, 200, image::Luma([128])).save(&photograph).unwrap();
        let failure = refusal(&photograph, &found);
        assert!(failure.sentence.contains("3 framed objects") && failure.class == Class::Refused);
        let picture = image::open(folder.path().join("hall.quads.png")).unwrap();
        assert!(picture.width() >= 400 && failure.sentence.contains("hall.quads.png"), "{failure}");
    }
}
