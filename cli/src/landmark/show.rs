//! `waymark landmark list` and `show`.

use super::{HealthWord, reasons};
use crate::{
    learning_settings,
    screen::{Table, counted},
    session::Session,
};
use client::api::{
    FindingBody, Landmark, LandmarkHealthBody, LandmarkQuery, LandmarkStatus, ListOrder, Place, Size,
};

/// `waymark landmark list`.
#[derive(Debug, clap::Args)]
pub(super) struct ListArgs {
    /// Only those whose name contains this.
    #[arg(long, value_name = "PART")]
    name: Option<String>,
    /// Only those that have come so far.
    #[arg(long, value_enum)]
    state: Option<StateWord>,
    /// Only those that are trusted so far.
    #[arg(long, value_enum)]
    health: Option<HealthWord>,
    /// Only those with a place (`true`), or without (`false`).
    #[arg(long, value_name = "true|false")]
    placed: Option<bool>,
    /// `name`, `changed` (by the last edit or lesson), or one of them reversed.
    #[arg(long, value_enum, default_value_t = OrderWord::Name, allow_hyphen_values = true)]
    sort: OrderWord,
}

/// How far a landmark has come, as it is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum StateWord {
    NotLearnt,
    Learning,
    Active,
    Inactive,
}

/// An order, as it is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum OrderWord {
    Name,
    #[value(name = "-name")]
    NameReversed,
    Changed,
    #[value(name = "-changed")]
    ChangedReversed,
}

impl ListArgs {
    fn query(&self) -> LandmarkQuery {
        LandmarkQuery {
            name: self.name.clone(),
            sort: Some(match self.sort {
                OrderWord::Name => ListOrder::Name,
                OrderWord::NameReversed => ListOrder::NameReversed,
                OrderWord::Changed => ListOrder::Changed,
                OrderWord::ChangedReversed => ListOrder::ChangedReversed,
            }),
            status: self.state.map(|state| match state {
                StateWord::NotLearnt => LandmarkStatus::NotLearnt,
                StateWord::Learning => LandmarkStatus::Learning,
                StateWord::Active => LandmarkStatus::Active,
                StateWord::Inactive => LandmarkStatus::Inactive,
            }),
            health: self.health.map(LandmarkHealthBody::from),
            has_place: self.placed,
            ..LandmarkQuery::default()
        }
    }
}

pub(super) async fn list(session: &Session, map: &str, wanted: &ListArgs) -> anyhow::Result<()> {
    let (mut all, mut query) = (Vec::new(), wanted.query());
    let is_all = query == LandmarkQuery { sort: query.sort, ..LandmarkQuery::default() };
    loop {
        let page = session.maps().find_landmarks(map, &query).await?;
        all.extend(page.items);
        query.cursor = page.next;
        if query.cursor.is_none() {
            break;
        }
    }
    let table = |all: &[Landmark]| {
        Table::of(["landmark", "state", "views", "size", "place", "health", "not in use because"], all, |l| {
            [
                l.name.clone(),
                l.status.to_string(),
                l.views.to_string(),
                size_text(l.size),
                place_text(l.place.as_ref()),
                health_word(l.health).to_owned(),
                reasons::lines(l).first().cloned().unwrap_or_default(),
            ]
        })
    };
    let empty = if is_all {
        format!("{map} has no landmark yet. Teach one: waymark landmark teach NAME PHOTO... --map {map}")
    } else {
        format!("{map} has no such landmark.")
    };
    session.list(&all, table, &empty)
}

pub(super) async fn one(session: &Session, map: &str, name: &str) -> anyhow::Result<()> {
    let landmark = session.maps().landmark(map, name).await?;
    session.show(&landmark, &text(&landmark))?;
    for line in next(&landmark) {
        session.note(&format!("  {line}"));
    }
    Ok(())
}

/// State, views, size, place and health, and why it is not in use.
pub(super) fn text(landmark: &Landmark) -> String {
    let reasons = reasons::lines(landmark).into_iter().map(|line| format!("  why     {line}"));
    let waived = landmark.waived_gates.iter().map(|gate| format!("  but     {gate}"));
    std::iter::once(facts(landmark)).chain(reasons).chain(waived).collect::<Vec<_>>().join("\n")
}

/// State, views, size, place and health in lines.
pub(super) fn facts(landmark: &Landmark) -> String {
    let mut lines = vec![
        format!("{}: {}, {}", landmark.name, state(landmark), counted(landmark.views, "training view")),
        format!("  size    {}", size_text(landmark.size)),
        format!("  place   {}", place_text(landmark.place.as_ref())),
        format!("  health  {}", health_text(landmark)),
    ];
    if let Some(model) = &landmark.model {
        lines.push(format!(
            "  learnt  from {} and {}",
            counted(model.views, "photograph"),
            counted(model.generated_views, "generated view")
        ));
    }
    lines.extend(landmark.learning.as_ref().map(|own| format!("  own     {}", learning_settings::text(own))));
    lines.extend(aspect_text(landmark).map(|text| format!("  caution {text}")));
    lines.join("\n")
}

/// That the ratio of its sides is not that of its photographs.
fn aspect_text(landmark: &Landmark) -> Option<String> {
    let shown = landmark.model.as_ref()?.facts.get("aspect")?;
    let number = |name: &str| shown.get(name).and_then(serde_json::Value::as_f64);
    let is_doubted = matches!(shown.get("size")?.as_str()?, "doubtful" | "differs");
    let (size, ratio, sigma) = (landmark.size?, number("measured")?, number("sigma")?);
    is_doubted.then(|| {
        format!(
            "by the photographs it is {ratio:.2} +- {sigma:.2} times as wide as high, by its size {:.2}: are width and height \
             right? More photographs, one from the front, decide",
            size.width_m / size.height_m
        )
    })
}

/// How far it is trusted, and what robots found.
fn health_text(landmark: &Landmark) -> String {
    let word = health_word(landmark.health);
    match &landmark.finding {
        None => word.to_owned(),
        Some(FindingBody::Moved { offset_m, sightings, .. }) => {
            format!("{word}: observed {offset_m:.2} m away, {}", counted(u64::from(*sightings), "time"))
        }
        Some(FindingBody::Missing { missed_frames }) => {
            format!("{word}: not found in {} in a row", counted(u64::from(*missed_frames), "frame"))
        }
    }
}

fn state(landmark: &Landmark) -> &'static str {
    match landmark.status {
        LandmarkStatus::NotLearnt => "not learnt yet",
        LandmarkStatus::Learning => "being learnt",
        LandmarkStatus::Active => "active",
        LandmarkStatus::Inactive => "not in use",
    }
}

/// What would make it more useful.
pub(super) fn next(landmark: &Landmark) -> Vec<String> {
    let name = &landmark.name;
    let mut lines = Vec::new();
    if landmark.status == LandmarkStatus::NotLearnt {
        lines.push(format!("Photographs: waymark landmark teach {name} PHOTO..."));
    }
    match (landmark.size, landmark.place) {
        (None, _) => lines.push(format!("For poses it needs a size: waymark landmark size {name} 0.60x0.84")),
        (_, None) => lines.push(format!(
            "For poses it needs a place: waymark landmark place {name} --wall N --at METRES --height METRES"
        )),
        _ => {}
    }
    lines
}

pub(super) fn size_text(size: Option<Size>) -> String {
    size.map_or_else(|| "-".to_owned(), |s| format!("{} x {} m", s.width_m, s.height_m))
}

pub(super) fn place_text(place: Option<&Place>) -> String {
    place.map_or_else(
        || "-".to_owned(),
        |p| {
            let degrees = p.theta_rad.to_degrees();
            format!("{:.2}, {:.2} m, {:.2} m up, facing {degrees:.0} deg", p.x_m, p.y_m, p.z_m)
        },
    )
}

fn health_word(health: LandmarkHealthBody) -> &'static str {
    match health {
        LandmarkHealthBody::Sound => "sound",
        LandmarkHealthBody::Flagged => "flagged",
        LandmarkHealthBody::Quarantined => "quarantined",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn landmark() -> Landmark {
        serde_json::from_str(
            r#"{"name":"poster","status":"inactive","views":2,"size":{"width_m":0.6,"height_m":0.84},"place":null,
                "model":null,"health":"flagged","finding":{"kind":"missing","missed_frames":6},
                "waived_gates":[{"gate":"visibility_confidence","sentence":"Seen from one side.","advice":"Go."}],"failed_gates":[
                {"gate":"looks_like","sentence":"It looks like `first` (97 %).","advice":"Delete one.",
                 "look_alike":{"landmark":"first","gradient_similarity":0.97}}]}"#,
        )
        .unwrap()
    }

    #[test]
    fn a_landmark_is_shown_with_what_it_lacks_and_why_it_is_not_in_use() {
        let lines = text(&landmark());
        assert!(lines.starts_with("poster: not in use, 2 training views\n  size    0.6 x 0.84 m"), "{lines}");
        assert!(lines.contains("flagged: not found in 6 frames in a row"), "{lines}");
        let why = "  why     It looks like `first` (97 %). Delete one.\n  but     Seen from one side. Go.";
        assert!(lines.ends_with(why), "{lines}");
        assert!(!facts(&landmark()).contains("why"), "{lines}");
    }

    #[test]
    fn a_size_that_photographs_doubt_is_told() {
        let with = |agreement: &str| {
            let aspect = serde_json::json!({ "measured": 0.9, "sigma": 0.1, "size": agreement });
            let model =
                serde_json::json!({ "views": 1, "generated_views": 29, "learnt_ms": 0, "aspect": aspect });
            Landmark { model: serde_json::from_value(model).unwrap(), ..landmark() }
        };
        assert!(facts(&with("doubtful")).contains("0.90 +- 0.10 times as wide as high, by its size 0.71"));
        assert!(!facts(&with("agrees")).contains("caution"));
    }

    #[test]
    fn what_is_needed_for_poses_is_named_with_its_command() {
        let named = |landmark: &Landmark| next(landmark).join("\n");
        assert!(named(&landmark()).contains("waymark landmark place poster"));
        let sizeless = Landmark { size: None, ..landmark() };
        assert!(named(&sizeless).contains("waymark landmark size poster"));
        let placed = Landmark { place: Some(Place::default()), ..landmark() };
        assert!(next(&placed).is_empty());
    }
}
