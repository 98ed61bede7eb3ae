//! The quads of an answer with their names, drawn on the image.

use super::Shown;
use crate::{
    foxglove::{
        Color, ImageAnnotations, KeyValuePair, Point2, PointsAnnotation, TextAnnotation, Timestamp,
        points_annotation::Type,
    },
    topics,
};
use protos::{
    Name,
    named::named,
    v1::{Answer, QuadAnswer, Verdict},
};

/// Named by the picture alone, named by the pose, fits several, unknown.
const GLOBAL: Color = Color::opaque(0.1, 0.8, 0.2);
const GUIDED: Color = Color::opaque(0.2, 0.5, 1.0);
const AMBIGUOUS: Color = Color::opaque(1.0, 0.7, 0.0);
const UNKNOWN: Color = Color::opaque(0.6, 0.6, 0.6);
/// Of lines and letters, px.
const LINE_PX: f64 = 2.0;
const TEXT_PX: f64 = 14.0;

pub(super) fn shown(robot: &Name, camera: &Name, answer: &Answer) -> Shown {
    let at = Timestamp::from_ns(answer.captured_ns);
    let points = answer.quads.iter().map(|quad| outline(quad, at)).collect();
    let texts = answer.quads.iter().filter_map(|quad| label(quad, at)).collect();
    let message = ImageAnnotations { points, texts };
    Shown::new(topics::annotations(robot, camera), "foxglove.ImageAnnotations", &message)
}

fn color(quad: &QuadAnswer) -> Color {
    match (named(quad), quad.verdict()) {
        (Some(named), _) if named.is_guided() => GUIDED,
        (Some(_), _) => GLOBAL,
        (None, Verdict::Ambiguous) => AMBIGUOUS,
        (None, _) => UNKNOWN,
    }
}

/// Viewers count from the corner of the first pixel, we from its centre.
fn corners(quad: &QuadAnswer) -> impl Iterator<Item = Point2> {
    quad.corners.iter().map(|p| Point2 { x: p.u_px + 0.5, y: p.v_px + 0.5 })
}

fn outline(quad: &QuadAnswer, at: Timestamp) -> PointsAnnotation {
    let score = KeyValuePair { key: "score".to_owned(), value: format!("{:.3}", quad.score) };
    PointsAnnotation {
        timestamp: Some(at),
        r#type: Type::LineLoop.into(),
        points: corners(quad).collect(),
        outline_color: Some(color(quad)),
        thickness: LINE_PX,
        metadata: vec![score],
        ..PointsAnnotation::default()
    }
}

/// The landmark's name at the first corner; none for a quad without one.
fn label(quad: &QuadAnswer, at: Timestamp) -> Option<TextAnnotation> {
    let named = named(quad)?;
    let how = if named.is_guided() { " (guided)" } else { "" };
    Some(TextAnnotation {
        timestamp: Some(at),
        position: corners(quad).next(),
        text: format!("{}{how}", named.name),
        font_size: TEXT_PX,
        text_color: Some(color(quad)),
        background_color: Some(Color { r: 0.0, g: 0.0, b: 0.0, a: 0.6 }),
        metadata: Vec::new(),
    })
}
