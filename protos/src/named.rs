//! The landmarks that an answer names, and whether each was recognised globally or guided. In: an
//! answer. Out: one item for each named quad.

use crate::v1::{Answer, QuadAnswer, Sighting, Verdict};
use vision::geometry::Corners;

/// A quad with a landmark's name.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NamedLandmark<'a> {
    /// Name of the landmark.
    pub name: &'a str,
    /// [`Sighting::Global`]: named by the picture alone; it may start a pose. [`Sighting::Guided`]:
    /// named with the prior pose; it may correct that pose, and means nothing without it.
    pub sighting: Sighting,
    /// Position in the image, and pose.
    pub quad: &'a QuadAnswer,
}

impl NamedLandmark<'_> {
    /// Whether the landmark was recognised by guided recognition.
    pub fn is_guided(&self) -> bool {
        self.sighting == Sighting::Guided
    }
}

/// The landmark of a quad, and how it was named; `None` for a quad without a name.
///
/// A server without guided recognition does not state the kind: its names are global. A name of an
/// unknown kind is ignored.
pub fn named(quad: &QuadAnswer) -> Option<NamedLandmark<'_>> {
    let sighting = Sighting::try_from(quad.sighting).ok()?;
    let (name, sighting) = match sighting {
        Sighting::Guided => (&quad.guided_landmark, Sighting::Guided),
        Sighting::Global | Sighting::Unspecified => (&quad.landmark, Sighting::Global),
    };
    let is_named = !name.is_empty() && (sighting == Sighting::Guided || quad.verdict() == Verdict::Unique);
    is_named.then_some(NamedLandmark { name, sighting, quad })
}

/// Every landmark that an answer names, in the order of its quads.
pub fn named_landmarks(answer: &Answer) -> impl Iterator<Item = NamedLandmark<'_>> {
    answer.quads.iter().filter_map(named)
}

/// Corners of a quad of an answer (px of the frame sent, clockwise from the top left); `None` if
/// they form no convex quad.
pub fn quad_corners(quad: &QuadAnswer) -> Option<Corners> {
    let points: Vec<[f64; 2]> = quad.corners.iter().map(|p| [p.u_px, p.v_px]).collect();
    Corners::try_from(<[[f64; 2]; 4]>::try_from(points).ok()?).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::v1::QuadKind;

    fn global(name: &str) -> QuadAnswer {
        let (verdict, sighting) = (Verdict::Unique.into(), Sighting::Global.into());
        QuadAnswer { verdict, sighting, landmark: name.into(), ..QuadAnswer::default() }
    }

    fn guided(name: &str, verdict: Verdict) -> QuadAnswer {
        let (verdict, sighting) = (verdict.into(), Sighting::Guided.into());
        QuadAnswer { verdict, sighting, guided_landmark: name.into(), ..QuadAnswer::default() }
    }

    #[test]
    fn each_name_has_its_kind() {
        let expected = QuadAnswer { kind: QuadKind::Expected.into(), ..guided("window", Verdict::Unknown) };
        let nameless = QuadAnswer { verdict: Verdict::Unknown.into(), ..QuadAnswer::default() };
        let quads = vec![guided("door-3", Verdict::Ambiguous), nameless, global("poster"), expected];
        let answer = Answer { quads, ..Answer::default() };
        let named: Vec<_> = named_landmarks(&answer).map(|n| (n.name, n.sighting, n.is_guided())).collect();
        assert_eq!(
            named,
            [
                ("door-3", Sighting::Guided, true),
                ("poster", Sighting::Global, false),
                ("window", Sighting::Guided, true),
            ]
        );
        assert_eq!(named_landmarks(&answer).nth(2).unwrap().quad.kind(), QuadKind::Expected);
    }

    #[test]
    fn a_name_without_a_kind_is_global() {
        let old = QuadAnswer { sighting: Sighting::Unspecified.into(), ..global("poster") };
        assert_eq!(named(&old).map(|n| (n.name, n.sighting)), Some(("poster", Sighting::Global)));
    }

    #[test]
    fn a_name_of_an_unknown_kind_is_ignored() {
        let new = QuadAnswer { sighting: 7, ..global("poster") };
        assert_eq!(named(&new), None);
    }
}
