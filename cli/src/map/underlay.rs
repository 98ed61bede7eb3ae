//! The picture of an occupancy grid as the underlay of a map. In: the picture and where it lies.
//! Out: an upload, or why there is none.

use crate::{
    failure::{Class, Failure},
    session::Session,
};
use client::api::UnderlayPlace;
use formats::walls::Underlay;
use serde_json::{Value, json};

/// What becomes of the picture of a file.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Outcome {
    /// The file has none, or it is not wanted.
    Absent,
    /// It would be uploaded.
    DryRun,
    /// It is the map's underlay now.
    Uploaded,
    /// The server does not take it; the walls stay imported.
    Refused(Box<Failure>),
}

fn place(picture: &Underlay) -> UnderlayPlace {
    let Underlay { resolution_m, origin, .. } = picture;
    UnderlayPlace {
        metres_per_pixel: *resolution_m,
        x_m: origin.x_m,
        y_m: origin.y_m,
        theta_rad: origin.theta_rad,
    }
}

/// The revision of a map's underlay, if it has one.
pub(super) async fn revision(session: &Session, map: &str) -> anyhow::Result<Option<String>> {
    match session.maps().underlay_revised(map).await {
        Ok(found) => Ok(Some(found.revision)),
        Err(error) if Failure::of_client(&error).code == "unknown_underlay" => Ok(None),
        Err(error) => Err(error.into()),
    }
}

/// Uploads a picture, in the place of the one with this revision. What the server refuses, such as
/// one that is too large, is an outcome.
pub(super) async fn upload(
    session: &Session,
    map: &str,
    picture: &Underlay,
    revision: Option<&str>,
) -> anyhow::Result<Outcome> {
    let maps = revision.map_or_else(|| session.maps().clone(), |known| session.maps().if_match(known));
    match maps.set_underlay(map, picture.png.clone(), &place(picture)).await {
        Ok(_) => Ok(Outcome::Uploaded),
        Err(error) => refused(Failure::of_client(&error)),
    }
}

fn refused(failure: Failure) -> anyhow::Result<Outcome> {
    match failure.class {
        Class::Refused | Class::Usage => Ok(Outcome::Refused(Box::new(failure))),
        _ => Err(failure.into()),
    }
}

impl Outcome {
    /// For people: a line of its own, or nothing.
    pub(super) fn sentence(&self, picture: Option<&Underlay>) -> String {
        let Some(Underlay { width, height, .. }) = picture else { return String::new() };
        match self {
            Self::Absent => String::new(),
            Self::DryRun => format!("\nIts picture ({width} x {height} px) would become the underlay."),
            Self::Uploaded => format!("\nIts picture ({width} x {height} px) is the underlay now."),
            Self::Refused(failure) => format!(
                "\nIts picture ({width} x {height} px) is not the underlay: {}\n  The walls need no underlay; \
                 --no-underlay leaves it out.",
                failure.sentence
            ),
        }
    }

    /// `null` where there is nothing to upload.
    pub(super) fn to_json(&self, picture: Option<&Underlay>) -> Value {
        let Some(picture) = picture.filter(|_| *self != Self::Absent) else { return Value::Null };
        let refusal = match self {
            Self::Refused(failure) => failure.to_json()["error"].clone(),
            _ => Value::Null,
        };
        json!({
            "place": place(picture), "width_px": picture.width, "height_px": picture.height,
            "changed": *self == Self::Uploaded, "refusal": refusal,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use client::ClientError;

    fn failure(status: u16, code: &str) -> Failure {
        let (code, detail) = (code.to_owned(), "so it is".to_owned());
        let more = serde_json::Map::new();
        Failure::of_client(&ClientError::Refused { status, code, field: String::new(), detail, more })
    }

    #[test]
    fn a_picture_that_is_too_large_is_an_outcome_and_a_busy_server_is_a_failure() {
        for (status, code) in [(413, "too_large"), (422, "too_large"), (422, "out_of_range")] {
            assert!(matches!(refused(failure(status, code)), Ok(Outcome::Refused(_))), "{code}");
        }
        for (status, code) in [(404, "unknown_map"), (503, "busy")] {
            assert_eq!(Failure::of(&refused(failure(status, code)).unwrap_err()).code, code);
        }
    }

    #[test]
    fn the_result_says_what_became_of_the_picture() {
        let origin = map::pose2::Pose2::new(-1.0, 2.0, 0.5);
        let picture = Underlay { png: Vec::new(), width: 30, height: 20, resolution_m: 0.05, origin };
        let refused = Outcome::Refused(Box::new(failure(413, "too_large")));
        for (outcome, words, changed, code) in [
            (Outcome::DryRun, "would become the underlay", false, Value::Null),
            (Outcome::Uploaded, "is the underlay now", true, Value::Null),
            (refused, "is not the underlay: so it is", false, "too_large".into()),
        ] {
            let sentence = outcome.sentence(Some(&picture));
            assert!(sentence.contains(words) && sentence.contains("30 x 20 px"), "{sentence}");
            let json = outcome.to_json(Some(&picture));
            assert_eq!((&json["changed"], &json["refusal"]["code"]), (&changed.into(), &code), "{json}");
            assert_eq!(json["place"]["theta_rad"], 0.5);
            assert_eq!((outcome.sentence(None), outcome.to_json(None)), (String::new(), Value::Null));
        }
        assert_eq!(Outcome::Absent.to_json(Some(&picture)), Value::Null);
    }
}
