//! Which names there are where one does not exist, and which command helps. In: a failure. Out: the
//! same with a sentence for people and the next command.

use super::failure::{Class, Failure};
use client::MapClient;
use serde_json::json;

/// Names listed at most.
const MAX_NAMES: usize = 8;

/// A failure with the names that there are, and with what to do next.
pub(crate) async fn explained(failure: Failure, maps: Option<&MapClient>, map: Option<&str>) -> Failure {
    let name = quoted(&failure.sentence).unwrap_or("NAME").to_owned();
    match failure.code.as_str() {
        "unknown_map" => {
            let names = match maps {
                Some(maps) => maps.maps().await.ok().map(|maps| maps.into_iter().map(|m| m.name).collect()),
                None => None,
            };
            failure.unknown("map", &name, names, format!("Make it: waymark map create {name}"))
        }
        "unknown_landmark" => {
            let names = match (maps, map) {
                (Some(maps), Some(map)) => {
                    maps.landmarks(map).await.ok().map(|all| all.into_iter().map(|l| l.name).collect())
                }
                _ => None,
            };
            failure.unknown(
                "landmark",
                &name,
                names,
                format!("Teach it: waymark landmark teach {name} PHOTO..."),
            )
        }
        "unknown_robot" => {
            let names = match maps {
                Some(maps) => maps.robots().await.ok().map(|all| all.into_iter().map(|r| r.name).collect()),
                None => None,
            };
            failure.unknown(
                "robot",
                &name,
                names,
                format!("Make it known: waymark robot add {name} --map MAP"),
            )
        }
        "unknown_gathering" => failure.advised("waymark gathering list shows the numbers."),
        "unknown_track" => failure.advised("waymark gathering show GATHERING lists the tracks."),
        "unknown_view" => failure.advised("waymark view list LANDMARK shows the numbers."),
        "unknown_reference_run" => failure.advised("waymark run list shows the numbers."),
        "unknown_commit" => failure.advised("waymark history list shows the commits that are kept."),
        "unknown_draft" => failure.advised("waymark history drafts shows the drafts of the map."),
        "conflict" => failure.advised("waymark history drafts DRAFT shows it, before anything is published."),
        "changed_since" => failure
            .advised("waymark history list shows what came later; rollback goes back behind all of it."),
        "unknown_token" => failure.advised("waymark token list shows the numbers."),
        "unauthenticated" => {
            failure.advised("Sign in with a token: waymark login, or give it with WAYMARK_TOKEN.")
        }
        "unknown_backup" => failure.advised("GET /api/v1/backups lists them."),
        "unknown_camera" => failure.advised("waymark camera list ROBOT shows the cameras."),
        "not_recording" => failure.advised("Begin a recording: waymark run start ROBOT"),
        "aspect_differs" => failure.advised(
            "Give the size again, width before height: --size WIDTHxHEIGHT, or waymark landmark size NAME WIDTHxHEIGHT.",
        ),
        "exists" => failure.advised("Choose another name, or delete the other one first."),
        "changed_meanwhile" => failure.advised("Look at it again, then repeat the command if it still fits."),
        "in_progress" => failure.advised("The same request is at work: wait, then repeat it."),
        "timeout" | "not_published" => {
            failure.advised("It may have been done all the same: look before you try again.")
        }
        "busy" | "too_many_uploads" => failure.advised("Try again in a moment."),
        _ => failure,
    }
}

impl Failure {
    /// The failure of a name that does not exist. `names` are those that do, where they are known.
    fn unknown(mut self, what: &str, name: &str, names: Option<Vec<String>>, advice: String) -> Self {
        if let Some(names) = &names {
            self.more.insert("names".into(), json!(names));
        }
        let sentence = format!("There is no {what} `{name}`{}.", there_are(names));
        Self { sentence, advice, class: Class::NotFound, ..self }
    }

    fn advised(self, advice: &str) -> Self {
        if self.advice.is_empty() { self.advise(advice) } else { self }
    }
}

/// The first word in back quotes.
fn quoted(text: &str) -> Option<&str> {
    text.split('`').nth(1)
}

fn there_are(names: Option<Vec<String>>) -> String {
    match names {
        None => String::new(),
        Some(names) if names.is_empty() => " (there is none yet)".to_owned(),
        Some(names) => {
            let more = names.len().saturating_sub(MAX_NAMES);
            let shown = names[..names.len().min(MAX_NAMES)].join(", ");
            if more > 0 {
                format!(" (there are: {shown} and {more} more)")
            } else {
                format!(" (there are: {shown})")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_missing_name_is_answered_with_the_command_that_makes_it() {
        let failure = Failure::new(Class::NotFound, "unknown_map", "there is no map `office`");
        let shown = explained(failure, None, None).await;
        assert_eq!(shown.to_string(), "There is no map `office`.\n  Make it: waymark map create office");
        assert_eq!(there_are(Some(Vec::new())), " (there is none yet)");
        let many: Vec<String> = (0..10).map(|i| format!("m{i}")).collect();
        assert!(there_are(Some(many)).ends_with("m7 and 2 more)"));
    }

    #[tokio::test]
    async fn the_names_that_exist_are_listed() {
        let failure = Failure::new(Class::NotFound, "unknown_robot", "there is no robot `r9`");
        let shown = failure.unknown("robot", "r9", Some(vec!["r1".into(), "r2".into()]), "Add it.".into());
        assert_eq!(shown.to_string(), "There is no robot `r9` (there are: r1, r2).\n  Add it.");
        assert_eq!(shown.to_json()["error"]["names"], json!(["r1", "r2"]));
    }

    #[tokio::test]
    async fn advice_of_the_command_stays() {
        let failure = Failure::new(Class::Conflict, "exists", "There is one.").advise("Do this.");
        assert_eq!(explained(failure, None, None).await.advice, "Do this.");
    }
}
