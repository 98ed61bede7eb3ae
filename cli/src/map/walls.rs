//! `waymark map walls`: the walls of a map with their numbers, as a table and as a picture. Numbers
//! count from 1 in the order of the server's list.

use crate::{screen::Table, session::ServerArgs};
use anyhow::Context as _;
use client::api::{WallBody, WallsBody};
use serde::Serialize;
use std::{fmt::Write as _, path::PathBuf};

/// Border of the picture, metres.
const BORDER_M: f64 = 1.0;
/// Height of the numbers, metres.
const DIGIT_M: f64 = 0.25;

/// `waymark map walls`.
#[derive(Debug, clap::Args)]
pub(crate) struct WallsArgs {
    /// The map.
    map: String,
    /// Draw the walls with their numbers as SVG.
    #[arg(long, value_name = "FILE")]
    draw: Option<PathBuf>,
    #[command(flatten)]
    server: ServerArgs,
}

/// A wall with its number. Its free side is on the left of a to b: who stands before it has b on
/// the left.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct NumberedWall {
    wall: usize,
    left: [f64; 2],
    right: [f64; 2],
    length_m: f64,
}

fn numbered(walls: &WallsBody) -> Vec<NumberedWall> {
    let of = |(i, w): (usize, &WallBody)| NumberedWall {
        wall: i + 1,
        left: w.b,
        right: w.a,
        length_m: (w.b[0] - w.a[0]).hypot(w.b[1] - w.a[1]),
    };
    walls.segments.iter().enumerate().map(of).collect()
}

pub(super) async fn run(args: &WallsArgs) -> anyhow::Result<()> {
    let session = args.server.session()?;
    let map = &args.map;
    let walls = session.explained(session.maps().walls(map).await.map_err(Into::into)).await?;
    let all = numbered(&walls);
    if let Some(picture) = args.draw.as_ref().filter(|_| !all.is_empty()) {
        std::fs::write(picture, svg(&all)).with_context(|| picture.display().to_string())?;
    }
    let table = |all: &[NumberedWall]| {
        Table::of(["wall", "left end", "right end", "length"], all, |wall| {
            let point = |[x, y]: [f64; 2]| format!("{x:.2}, {y:.2} m");
            let length = format!("{:.2} m", wall.length_m);
            [wall.wall.to_string(), point(wall.left), point(wall.right), length]
        })
    };
    session.list(&all, table, &format!("{map} has no walls. Import them: waymark map import {map} FILE"))
}

/// The walls in map coordinates, y up, each with its number on its free side.
fn svg(all: &[NumberedWall]) -> String {
    let ends = || all.iter().flat_map(|w| [w.left, w.right]);
    let range = |k: usize| {
        let low = ends().map(|p| p[k]).fold(f64::INFINITY, f64::min) - BORDER_M;
        let high = ends().map(|p| p[k]).fold(f64::NEG_INFINITY, f64::max) + BORDER_M;
        (low, high - low)
    };
    let ((x, width), (y, height)) = (range(0), range(1));
    let top = -(y + height);
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"{x:.2} {top:.2} {width:.2} {height:.2}\" \
         font-family=\"sans-serif\" font-size=\"{DIGIT_M}\" text-anchor=\"middle\" dominant-baseline=\"central\">\n\
         <rect x=\"{x:.2}\" y=\"{top:.2}\" width=\"{width:.2}\" height=\"{height:.2}\" fill=\"white\"/>\n"
    );
    for wall in all {
        let ([x1, y1], [x2, y2]) = (wall.right, wall.left);
        let length = wall.length_m.max(f64::EPSILON);
        // The normal to the free side: from the right end to the left one, turned to the left.
        let (nx, ny) = (-(y2 - y1) / length, (x2 - x1) / length);
        let (u, v) = (0.5 * (x1 + x2) + DIGIT_M * nx, 0.5 * (y1 + y2) + DIGIT_M * ny);
        let number = wall.wall;
        // Writing to a String cannot fail.
        writeln!(
            text,
            "<path d=\"M{x1:.3} {:.3}L{x2:.3} {:.3}\" stroke=\"black\" stroke-width=\"0.05\"/>\
             <text x=\"{u:.3}\" y=\"{:.3}\">{number}</text>",
            -y1, -y2, -v
        )
        .ok();
    }
    text.push_str("</svg>\n");
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn walls_are_numbered_from_one_and_drawn_with_the_number_on_the_free_side() {
        let walls: WallsBody = [[[0.0, 0.0], [4.0, 0.0]], [[4.0, 0.0], [4.0, 3.0]]].into_iter().collect();
        let all = numbered(&walls);
        assert_eq!((all[0].wall, all[0].left, all[1].wall, all[1].length_m), (1, [4.0, 0.0], 2, 3.0));
        let picture = svg(&all);
        // The first wall runs along x, free above it; SVG's y points down.
        assert!(picture.contains("<text x=\"2.000\" y=\"-0.250\">1</text>"), "{picture}");
        assert!(picture.contains("<text x=\"3.750\" y=\"-1.500\">2</text>"), "{picture}");
        assert!(picture.contains("viewBox=\"-1.00 -4.00 6.00 5.00\""), "{picture}");
    }
}
