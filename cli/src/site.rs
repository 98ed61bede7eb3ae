//! `waymark site`: places and passages of a site's maps, and routes through them.

use super::{
    screen::{Table, counted},
    session::{ServerArgs, Session},
};
use client::api::{NextLandmarkBody, RouteLeg, SiteTopologyBody, TopologyPlace, TopologyQuery};

/// `waymark site`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(subcommand)]
    verb: Verb,
    #[command(flatten)]
    server: ServerArgs,
}

#[derive(Debug, clap::Subcommand)]
enum Verb {
    /// List the places of a site with the passages and landmarks of each.
    Places {
        /// The site, in the words of `waymark map locate --site`.
        site: String,
    },
    /// Show a route with the next landmark to look for on each leg
    ///
    /// Each end is a place or a point of a map in metres. For example:
    ///   waymark site route "Works 1" hall/2.5,-1 office/3
    #[command(verbatim_doc_comment)]
    Route {
        /// The site.
        site: String,
        /// Where it starts: MAP/PLACE or MAP/X,Y.
        from: String,
        /// Where it ends.
        to: String,
    },
}

/// Runs the command.
pub(crate) async fn run(args: &Args) -> anyhow::Result<()> {
    let session = args.server.session()?;
    let done = of_site(&session, &args.verb).await;
    session.explained(done).await
}

async fn of_site(session: &Session, verb: &Verb) -> anyhow::Result<()> {
    match verb {
        Verb::Places { site } => {
            let found = session.maps().site_topology(site, &TopologyQuery::default()).await?;
            if found.places.is_empty() {
                session.note("No place: no map of this site has a landmark that is seen from its floor.");
            }
            let table =
                Table::of(["place", "at", "floor", "passages to", "landmarks"], &found.places, |place| {
                    row(&found, place)
                });
            session.show(&found, &table.text())
        }
        Verb::Route { site, from, to } => {
            let query = TopologyQuery { from: Some(from.clone()), to: Some(to.clone()) };
            let found = session.maps().site_topology(site, &query).await?;
            let legs = found.route.as_ref().map(|route| route.legs.as_slice()).unwrap_or_default();
            let table = Table::of(["place", "length", "to", "look for"], legs, |leg| leg_row(&found, leg));
            session.show(&found, &table.text())?;
            if let Some(route) = &found.route {
                let legs = counted(legs.len() as u64, "leg");
                session.note(&format!("  {:.1} m in {legs}", route.length_m));
            }
            Ok(())
        }
    }
}

fn row(found: &SiteTopologyBody, place: &TopologyPlace) -> [String; 5] {
    let to = found.passages.iter().filter_map(|passage| {
        let here = passage.ends.iter().position(|end| end.place == place.place)?;
        passage.ends.get(1 - here).map(|end| end.place.as_str())
    });
    let landmarks: Vec<&str> = place.landmarks.iter().map(|seen| seen.landmark.as_str()).collect();
    [
        place.place.clone(),
        format!("{:.1}, {:.1} m", place.x_m, place.y_m),
        format!("{:.0} m2", place.area_m2),
        to.collect::<Vec<_>>().join(", "),
        landmarks.join(", "),
    ]
}

fn leg_row(found: &SiteTopologyBody, leg: &RouteLeg) -> [String; 4] {
    let passage = leg.passage.and_then(|passage| found.passages.get(passage));
    let other = passage.and_then(|passage| passage.ends.iter().find(|end| end.place != leg.place));
    let look = leg.next_landmark.as_ref().map_or("-".to_owned(), turn);
    let to = other.map_or("the end".to_owned(), |end| end.place.clone());
    [leg.place.clone(), format!("{:.1} m", leg.length_m), to, look]
}

/// `poster, 34 degrees left after 2.5 m`.
fn turn(next: &NextLandmarkBody) -> String {
    let side = if next.pan_rad < 0.0 { "right" } else { "left" };
    let degrees = next.pan_rad.to_degrees().abs();
    format!("{}, {degrees:.0} degrees {side} after {:.1} m", next.landmark, next.along_m)
}

#[cfg(test)]
mod tests {
    use super::*;
    use client::api::{PassageEnd, TopologyPassage};

    #[test]
    fn a_leg_says_where_it_leads_and_how_far_the_camera_turns() {
        let end = |place: &str| PassageEnd { place: place.to_owned(), x_m: 3.0, y_m: 2.0 };
        let passage = TopologyPassage {
            ends: vec![end("hall/1"), end("hall/2")],
            width_m: Some(0.9),
            length_m: 5.0,
            landmarks: Vec::new(),
        };
        let found =
            SiteTopologyBody { maps: Vec::new(), places: Vec::new(), passages: vec![passage], route: None };
        let next = NextLandmarkBody {
            landmark: "poster".to_owned(),
            along_m: 2.5,
            x_m: 0.0,
            y_m: 0.0,
            theta_rad: 0.0,
            pan_rad: -0.6,
            tilt_rad: 0.1,
            range_m: 3.0,
        };
        let leg = |passage, next_landmark| RouteLeg {
            place: "hall/2".to_owned(),
            passage,
            length_m: 3.04,
            path: vec![[0.0, 0.0]],
            next_landmark,
        };
        assert_eq!(
            leg_row(&found, &leg(Some(0), Some(next))),
            ["hall/2", "3.0 m", "hall/1", "poster, 34 degrees right after 2.5 m"]
        );
        assert_eq!(leg_row(&found, &leg(None, None)), ["hall/2", "3.0 m", "the end", "-"]);
    }
}
