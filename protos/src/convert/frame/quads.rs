//! Quads that a robot's own detector found, on arrival: everything but the pixels is checked.

use super::{EncodedImage, MAX_FRAME_PX, encoded_image};
use crate::{Code, Rejection, convert::geometry, v1};
use nalgebra::{Matrix2, Point2};
use vision::{
    detect::quad::{Quad, QuadKind},
    geometry::Corners,
};

/// Most quads of a message: as many as are compared with the landmarks.
pub const MAX_FOUND_QUADS: usize = 24;
/// Most further borders of a quad.
pub const MAX_FOUND_ALTERNATES: usize = 8;
/// Largest variance of a corner, px^2.
pub const MAX_CORNER_VARIANCE_PX2: f64 = 1e4;
/// Variance of a corner where none is stated, px^2.
pub const USUAL_CORNER_VARIANCE_PX2: f64 = 1.0;

/// A quad with the pixels around it.
#[derive(Debug, Clone, PartialEq)]
pub struct CheckedQuad {
    /// The quad, in pixels of the image.
    pub quad: Quad,
    /// Its pixels.
    pub patch: CheckedPatch,
}

/// A part of an image, within it, still encoded.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CheckedPatch {
    /// Column of its first pixel in the image.
    pub left_px: u32,
    /// Row of its first pixel in the image.
    pub top_px: u32,
    /// Claimed width, px; compared with the decoded one later.
    pub width_px: u32,
    /// Claimed height, px; compared with the decoded one later.
    pub height_px: u32,
    /// Its pixels.
    pub image: EncodedImage,
}

/// Checks the quads of an image of `size` px: their number, their corners, and that each patch lies
/// within the image and holds its quad. All patches together have at most [`MAX_FRAME_PX`] pixels.
pub(super) fn checked(quads: Vec<v1::FoundQuad>, size: (u32, u32)) -> Result<Vec<CheckedQuad>, Rejection> {
    if quads.len() > MAX_FOUND_QUADS {
        let detail = format!("{} quads are more than {MAX_FOUND_QUADS}", quads.len());
        return Err(Rejection::new(Code::TooMany, "quads", detail));
    }
    let mut spare_px = MAX_FRAME_PX;
    let one = |(i, found): (usize, v1::FoundQuad)| {
        let made = quad(found, size).map_err(|r| r.inside(&format!("quads[{i}]")))?;
        let area = made.patch.width_px * made.patch.height_px;
        spare_px = spare_px.checked_sub(area).ok_or_else(|| {
            let detail = format!("the patches have more than {MAX_FRAME_PX} pixels in all");
            Rejection::new(Code::TooLarge, "quads", detail)
        })?;
        Ok(made)
    };
    quads.into_iter().enumerate().map(one).collect()
}

fn quad(found: v1::FoundQuad, size: (u32, u32)) -> Result<CheckedQuad, Rejection> {
    let corners_px = corners(found.border.as_ref(), size).map_err(|r| r.inside("border"))?;
    if found.alternates.len() > MAX_FOUND_ALTERNATES {
        let detail = format!("{} borders are more than {MAX_FOUND_ALTERNATES}", found.alternates.len());
        return Err(Rejection::new(Code::TooMany, "alternates", detail));
    }
    let of = |(i, border)| corners(Some(border), size).map_err(|r| r.inside(&format!("alternates[{i}]")));
    let alternates = found.alternates.iter().enumerate().map(of).collect::<Result<Vec<_>, _>>()?;
    let quad = Quad {
        corners_px,
        corner_covariance_px2: covariances(&found.corner_covariance_px2)?,
        side_support: [1.0; 4],
        side_clipped: [false; 4],
        score: geometry::between("score", found.score, 0.0, 1.0)?,
        kind: QuadKind::Full,
        upright_ambiguous: found.upright_ambiguous,
        alternates,
    };
    let sent = found.patch.ok_or_else(|| Rejection::new(Code::Missing, "patch", "the patch is absent"))?;
    let patch = patch(sent, size).and_then(|patch| holds(&patch, &corners_px, size).map(|()| patch));
    Ok(CheckedQuad { quad, patch: patch.map_err(|r| r.inside("patch"))? })
}

/// Four finite corners, at most one width and height outside of the image, convex and in order.
fn corners(border: Option<&v1::Border>, (width_px, height_px): (u32, u32)) -> Result<Corners, Rejection> {
    let sent = border.map_or(&[][..], |border| border.corners.as_slice());
    let [a, b, c, d] = sent else {
        let detail = format!("4 corners expected, {} given", sent.len());
        let code = if sent.is_empty() { Code::Missing } else { Code::OutOfRange };
        return Err(Rejection::new(code, "corners", detail));
    };
    let (width, height) = (f64::from(width_px), f64::from(height_px));
    let mut points = [Point2::origin(); 4];
    for (i, (point, sent)) in points.iter_mut().zip([a, b, c, d]).enumerate() {
        let field = |axis| format!("corners[{i}].{axis}");
        let u = geometry::between(&field("u_px"), sent.u_px, -width, 2.0 * width)?;
        *point = Point2::new(u, geometry::between(&field("v_px"), sent.v_px, -height, 2.0 * height)?);
    }
    Corners::new(points).map_err(|e| Rejection::new(Code::OutOfRange, "corners", e.to_string()))
}

fn covariances(sent: &[f64]) -> Result<[Matrix2<f64>; 4], Rejection> {
    const FIELD: &str = "corner_covariance_px2";
    if sent.is_empty() {
        return Ok([Matrix2::identity() * USUAL_CORNER_VARIANCE_PX2; 4]);
    }
    if sent.len() != 12 {
        let detail = format!("12 numbers expected, {} given", sent.len());
        return Err(Rejection::new(Code::OutOfRange, FIELD, detail));
    }
    let mut all = [Matrix2::zeros(); 4];
    for (i, (made, sent)) in all.iter_mut().zip(sent.chunks_exact(3)).enumerate() {
        let at = |j: usize| format!("{FIELD}[{}]", 3 * i + j);
        let uu = geometry::between(&at(0), sent[0], 0.0, MAX_CORNER_VARIANCE_PX2)?;
        let uv = geometry::within(&at(1), sent[1], MAX_CORNER_VARIANCE_PX2)?;
        let vv = geometry::between(&at(2), sent[2], 0.0, MAX_CORNER_VARIANCE_PX2)?;
        if uv * uv > uu * vv {
            let detail = "not positive semidefinite";
            return Err(Rejection::new(Code::OutOfRange, at(1), detail));
        }
        *made = Matrix2::new(uu, uv, uv, vv);
    }
    Ok(all)
}

fn patch(sent: v1::Patch, (width_px, height_px): (u32, u32)) -> Result<CheckedPatch, Rejection> {
    for (axis, (from, length), all) in [
        ("left_px", (sent.left_px, sent.width_px), width_px),
        ("top_px", (sent.top_px, sent.height_px), height_px),
    ] {
        if from.checked_add(length).is_none_or(|end| end > all) {
            let detail = format!("{length} px from {from} on are not within the {all} px of the image");
            return Err(Rejection::new(Code::OutOfRange, axis, detail));
        }
    }
    let image = encoded_image(sent.encoding, (sent.width_px, sent.height_px), sent.image)?;
    let v1::Patch { left_px, top_px, width_px, height_px, .. } = sent;
    Ok(CheckedPatch { left_px, top_px, width_px, height_px, image })
}

/// Whether a patch holds its quad, as far as that lies in the image.
fn holds(patch: &CheckedPatch, quad: &Corners, (width_px, height_px): (u32, u32)) -> Result<(), Rejection> {
    for (axis, of, (from, length), all) in [
        ("left_px", 0, (patch.left_px, patch.width_px), width_px),
        ("top_px", 1, (patch.top_px, patch.height_px), height_px),
    ] {
        let along = quad.points().iter().map(|corner| corner[of].round().clamp(0.0, f64::from(all - 1)));
        let (low, high) = along.fold((f64::INFINITY, 0.0_f64), |(low, high), c| (low.min(c), high.max(c)));
        if low < f64::from(from) || high > f64::from(from + length - 1) {
            let detail = format!("{length} px from {from} on do not hold the quad, {low} to {high}");
            return Err(Rejection::new(Code::OutOfRange, axis, detail));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::CheckedFrame;
    use proptest::prelude::*;
    use prost::Message;

    fn border(corners: [[f64; 2]; 4]) -> v1::Border {
        v1::Border { corners: corners.map(|[u_px, v_px]| v1::Point { u_px, v_px }).to_vec() }
    }

    fn found() -> v1::FoundQuad {
        let (width_px, height_px) = (20, 12);
        let image = vec![7; 240].into();
        let encoding = v1::ImageEncoding::Gray8.into();
        v1::FoundQuad {
            border: Some(border([[12.0, 11.0], [27.0, 12.0], [28.0, 20.0], [12.0, 21.0]])),
            patch: Some(v1::Patch { left_px: 10, top_px: 10, width_px, height_px, encoding, image }),
            ..v1::FoundQuad::default()
        }
    }

    fn message(quads: Vec<v1::FoundQuad>) -> v1::Quads {
        v1::Quads { epoch: 1, seq: 2, width_px: 64, height_px: 48, quads, ..v1::Quads::default() }
    }

    fn refused(change: impl FnOnce(&mut v1::FoundQuad)) -> (Code, String) {
        let mut quad = found();
        change(&mut quad);
        let r = CheckedFrame::try_from(message(vec![found(), quad])).unwrap_err();
        (r.code, r.field)
    }

    fn patch_of(quad: &mut v1::FoundQuad) -> &mut v1::Patch {
        quad.patch.as_mut().unwrap()
    }

    #[test]
    fn quads_pass_and_so_does_the_news_that_there_are_none() {
        assert!(CheckedFrame::try_from(message(Vec::new())).is_ok_and(|none| !none.is_whole()));
        let checked = CheckedFrame::try_from(message(vec![found()])).unwrap();
        let super::super::Pixels::Quads(quads) = checked.pixels else { panic!("quads were sent") };
        assert_eq!(quads[0].quad.corner_covariance_px2, [Matrix2::identity(); 4]);
        assert_eq!(quads[0].patch.image.bytes.len(), 240);
    }

    #[test]
    fn each_fault_names_its_field() {
        let is = |code, field: &str| (code, format!("quads[1].{field}"));
        let corner =
            |change: fn(&mut Vec<v1::Point>)| refused(|q| change(&mut q.border.as_mut().unwrap().corners));
        assert_eq!(refused(|q| q.border = None), is(Code::Missing, "border.corners"));
        assert_eq!(corner(|c| c.truncate(3)), is(Code::OutOfRange, "border.corners"));
        assert_eq!(corner(|c| c.swap(0, 1)), is(Code::OutOfRange, "border.corners"));
        assert_eq!(corner(|c| c[2].v_px = f64::NAN), is(Code::NotFinite, "border.corners[2].v_px"));
        assert_eq!(corner(|c| c[1].u_px = 128.5), is(Code::OutOfRange, "border.corners[1].u_px"));
        let flat = border([[12.0, 11.0], [20.0, 11.0], [28.0, 11.0], [12.0, 21.0]]);
        assert_eq!(refused(|q| q.alternates = vec![flat]), is(Code::OutOfRange, "alternates[0].corners"));
        assert_eq!(refused(|q| q.score = 1.5), is(Code::OutOfRange, "score"));
        let sigma = |sent: &[f64]| refused(|q| q.corner_covariance_px2 = sent.to_vec());
        assert_eq!(sigma(&[1.0; 11]), is(Code::OutOfRange, "corner_covariance_px2"));
        let mut crooked = [1.0, 0.0, 1.0].repeat(4);
        crooked[4] = 1.1;
        assert_eq!(sigma(&crooked), is(Code::OutOfRange, "corner_covariance_px2[4]"));
        assert_eq!(refused(|q| q.patch = None), is(Code::Missing, "patch"));
        assert_eq!(refused(|q| patch_of(q).left_px = u32::MAX), is(Code::OutOfRange, "patch.left_px"));
        assert_eq!(refused(|q| patch_of(q).top_px = 37), is(Code::OutOfRange, "patch.top_px"));
        assert_eq!(refused(|q| patch_of(q).left_px = 13), is(Code::OutOfRange, "patch.left_px"));
        assert_eq!(refused(|q| patch_of(q).top_px = 9), is(Code::OutOfRange, "patch.top_px"));
        // It holds its quad, and reaches a pixel beyond the image.
        let high = |q: &mut v1::FoundQuad| {
            let patch = patch_of(q);
            (patch.height_px, patch.image) = (39, vec![7; 20 * 39].into());
        };
        assert_eq!(refused(high), is(Code::OutOfRange, "patch.top_px"));
        assert_eq!(refused(|q| patch_of(q).encoding = 0), is(Code::OutOfRange, "patch.encoding"));
        let short = vec![7; 239].into();
        assert_eq!(refused(|q| patch_of(q).image = short), is(Code::SizeMismatch, "patch.image"));
    }

    #[test]
    fn counts_at_their_bounds() {
        assert!(CheckedFrame::try_from(message(vec![found(); MAX_FOUND_QUADS])).is_ok());
        let many = CheckedFrame::try_from(message(vec![found(); MAX_FOUND_QUADS + 1])).unwrap_err();
        assert_eq!((many.code, many.field.as_str()), (Code::TooMany, "quads"));
        let nested = |count| {
            let mut quad = found();
            quad.alternates = vec![quad.border.clone().unwrap(); count];
            CheckedFrame::try_from(message(vec![quad]))
        };
        assert!(nested(MAX_FOUND_ALTERNATES).is_ok());
        let many = nested(MAX_FOUND_ALTERNATES + 1).unwrap_err();
        assert_eq!((many.code, many.field.as_str()), (Code::TooMany, "quads[0].alternates"));
    }

    /// A message of few bytes could ask for a frame of memory for each of its quads.
    #[test]
    fn all_patches_together_have_the_pixels_of_a_frame() {
        let (width_px, height_px) = (1920, 1200);
        let whole = |height_px| {
            let image = vec![0; 10].into();
            let encoding = v1::ImageEncoding::Jpeg.into();
            let patch = v1::Patch { width_px, height_px, encoding, image, ..v1::Patch::default() };
            v1::FoundQuad { patch: Some(patch), ..found() }
        };
        let of = |quads| CheckedFrame::try_from(v1::Quads { width_px, height_px, ..message(quads) });
        assert!(of(vec![whole(600), whole(600)]).is_ok());
        let large = of(vec![whole(600), whole(601)]).unwrap_err();
        assert_eq!((large.code, large.field.as_str()), (Code::TooLarge, "quads"));
    }

    fn number() -> impl Strategy<Value = f64> {
        prop_oneof![any::<f64>(), -200.0..200.0]
    }

    fn any_quad() -> impl Strategy<Value = v1::FoundQuad> {
        let corners = prop::collection::vec((number(), number()), 0..6);
        let patch = prop::option::of((0..80_u32, 0..80_u32, any::<[u32; 2]>(), 0..7, 0..300_usize));
        (corners, prop::collection::vec(number(), 0..14), number(), patch).prop_map(
            |(corners, corner_covariance_px2, score, patch)| {
                let corners = corners.into_iter().map(|(u_px, v_px)| v1::Point { u_px, v_px }).collect();
                let patch = patch.map(|(left_px, top_px, [width, height], encoding, bytes)| v1::Patch {
                    left_px,
                    top_px,
                    width_px: width % 70,
                    height_px: height >> (height % 32),
                    encoding,
                    image: vec![0; bytes].into(),
                });
                let border = Some(v1::Border { corners });
                v1::FoundQuad { border, corner_covariance_px2, score, patch, ..v1::FoundQuad::default() }
            },
        )
    }

    proptest! {
        #[test]
        fn any_quads_pass_with_their_bounds_or_are_refused(quad in any_quad(), good: bool) {
            let quads = if good { vec![found(), quad] } else { vec![quad] };
            if let Ok(CheckedFrame { pixels: super::super::Pixels::Quads(quads), .. }) =
                CheckedFrame::try_from(message(quads))
            {
                for CheckedQuad { quad, patch } in quads {
                    prop_assert!(quad.corners_px.points().iter().all(|c| c.x.abs() <= 128.0 && c.y.abs() <= 96.0));
                    prop_assert!(patch.left_px + patch.width_px <= 64 && patch.top_px + patch.height_px <= 48);
                    prop_assert!((0.0..=1.0).contains(&quad.score));
                }
            }
        }

        #[test]
        fn any_bytes_are_quads_or_are_refused(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
            if let Ok(quads) = v1::Quads::decode(bytes.as_slice()) {
                drop(CheckedFrame::try_from(quads));
            }
        }

        #[test]
        fn altered_messages_pass_or_are_refused(at in 0_usize..4096, bits: u8) {
            let mut bytes = message(vec![found()]).encode_to_vec();
            let at = at % bytes.len();
            bytes[at] ^= bits;
            if let Ok(quads) = v1::Quads::decode(bytes.as_slice()) {
                drop(CheckedFrame::try_from(quads));
            }
        }
    }
}
