//! One photograph to a training view. In: a file, and how it is cut. Out: the stored view, or a
//! failure that names the file and what helps. Where several framed objects are found, one is taken
//! by number.

use super::quad_choice::{picked, quads, refusal};
use crate::{
    failure::{Class, Failure},
    pictures,
    session::Session,
};
use client::{ClientError, LandmarkRegion, NewView, api::TrainingView};
use std::path::Path;

/// A photograph of a landmark.
#[derive(Debug, Clone, Copy)]
pub(super) struct Photograph<'a> {
    /// PNG or JPEG.
    pub(super) path: &'a Path,
    /// What of it is the landmark.
    pub(super) region: LandmarkRegion,
    /// The framed object to take where there are several, from 1.
    pub(super) pick: Option<usize>,
}

impl Photograph<'_> {
    /// Sends it as the view that `view` makes of it.
    pub(super) async fn send(
        &self,
        session: &Session,
        (map, landmark): (&str, &str),
        view: impl Fn(NewView) -> NewView,
    ) -> Result<TrainingView, Failure> {
        let path = self.path;
        let sent = pictures::photograph(path).map_err(|error| {
            Failure::new(Class::Usage, "unreadable", format!("{}: {error}", path.display()))
        })?;
        if let Some([[w, h], [to_w, to_h]]) = sent.shrunk {
            let name = path.display();
            session.note(&format!("{name}: {w}x{h} px made {to_w}x{to_h}; corners are of that size."));
        }
        let image = sent.bytes;
        let send = |region| {
            session.maps().upload_view_with(map, landmark, view(NewView::new(image.clone(), region)))
        };
        let error = match send(self.region).await {
            Ok(view) => return Ok(view),
            Err(error) => error,
        };
        let Some(quads) = quads(&error) else { return Err(refused(&error, path)) };
        let Some(number) = self.pick else { return Err(refusal(path, &quads)) };
        let corners = LandmarkRegion::Corners(picked(&quads, number)?);
        send(corners).await.map_err(|error| refused(&error, path))
    }
}

/// A refusal with the photograph that it is about, and what helps.
fn refused(error: &ClientError, path: &Path) -> Failure {
    let failure = Failure::of_client(error);
    let name = path.display();
    match (failure.code.as_str(), failure.class) {
        ("quad_not_found", _) => Failure {
            sentence: format!("{name}: No four edges found."),
            advice: "If the file is the picture itself, add --whole-image; else show all four sides, or give --corners.\n\
                     `waymark detect PHOTO --draw stages` shows where they were lost."
                .to_owned(),
            ..failure
        },
        (_, Class::Refused | Class::Usage) => {
            Failure { sentence: format!("{name}: {}", failure.sentence), ..failure }
        }
        _ => failure,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_photograph_without_edges_is_answered_with_the_ways_out() {
        let of = |code: &str| ClientError::Refused {
            status: 422,
            code: code.to_owned(),
            field: String::new(),
            detail: "so it is".to_owned(),
            more: serde_json::Map::new(),
        };
        let failure = refused(&of("quad_not_found"), Path::new("scan.png"));
        assert_eq!((failure.class, failure.code.as_str()), (Class::Refused, "quad_not_found"));
        assert!(failure.sentence.starts_with("scan.png: No four edges found"), "{failure}");
        assert!(
            failure.advice.contains("--whole-image") && failure.advice.contains("--corners"),
            "{failure}"
        );
        assert_eq!(refused(&of("bad_image"), Path::new("a.jpg")).sentence, "a.jpg: so it is");
    }
}
