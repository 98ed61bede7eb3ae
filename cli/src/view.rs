//! `waymark view`: the training views of a landmark.

use super::{
    screen::{Table, counted},
    session::{Consent, MapArgs, Session},
};
use anyhow::Context as _;
use client::api::TrainingView;
use std::path::{Path, PathBuf};

/// `waymark view`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(subcommand)]
    verb: Verb,
    #[command(flatten)]
    map: MapArgs,
}

#[derive(Debug, clap::Subcommand)]
enum Verb {
    /// List the training views of a landmark.
    List {
        /// The landmark.
        landmark: String,
    },
    /// Write the rectified picture that is learnt from, PNG.
    Show {
        /// The landmark.
        landmark: String,
        /// Number of the view.
        view: i64,
        /// Where to; left out, LANDMARK-VIEW.png here.
        #[arg(long, value_name = "FILE")]
        out: Option<PathBuf>,
    },
    /// Write the photograph as it was taught, PNG or JPEG.
    Image {
        /// The landmark.
        landmark: String,
        /// Number of the view.
        view: i64,
        /// Where to; left out, LANDMARK-VIEW-photo.png or .jpg here.
        #[arg(long, value_name = "FILE")]
        out: Option<PathBuf>,
    },
    /// Delete training views. The model stays until the landmark is taught again.
    Delete {
        /// The landmark.
        landmark: String,
        /// Numbers of the views.
        #[arg(required = true)]
        views: Vec<i64>,
        #[command(flatten)]
        consent: Consent,
    },
}

/// Runs the command.
pub(crate) async fn run(args: &Args) -> anyhow::Result<()> {
    let session = args.map.session()?;
    let done = on_map(&session, &args.verb).await;
    session.explained(done).await
}

async fn on_map(session: &Session, verb: &Verb) -> anyhow::Result<()> {
    let (maps, map) = (session.maps(), session.map().await?);
    match verb {
        Verb::List { landmark } => {
            let all = maps.views(map, landmark).await?;
            let table = |all: &[TrainingView]| {
                Table::of(["view", "picture", "kind", "corners (TL TR BR BL), px"], all, |v| {
                    let corners = corners_text(&v.corners);
                    let size = format!("{} x {} px", v.width_px, v.height_px);
                    [v.id.to_string(), size, v.image_kind.clone(), corners]
                })
            };
            session.list(
                &all,
                table,
                &format!("{landmark} has no view. Add one: waymark landmark teach {landmark} PHOTO"),
            )
        }
        Verb::Show { landmark, view, out } => {
            let png = maps.view_icon(map, landmark, *view).await?;
            let path = out.clone().unwrap_or_else(|| Path::new(&format!("{landmark}-{view}.png")).to_owned());
            std::fs::write(&path, png).with_context(|| path.display().to_string())?;
            session.show(&serde_json::json!({ "file": path }), &format!("view {view} in {}", path.display()))
        }
        Verb::Image { landmark, view, out } => {
            let picture = maps.view_image(map, landmark, *view).await?;
            let ending = if picture.starts_with(b"\x89PNG") { "png" } else { "jpg" };
            let usual = || PathBuf::from(format!("{landmark}-{view}-photo.{ending}"));
            let path = out.clone().unwrap_or_else(usual);
            std::fs::write(&path, picture).with_context(|| path.display().to_string())?;
            session.show(
                &serde_json::json!({ "file": path }),
                &format!("photograph of view {view} in {}", path.display()),
            )
        }
        Verb::Delete { landmark, views, consent } => {
            consent.ask(&format!("Delete {} of {landmark}?", counted(views.len() as u64, "view")))?;
            for view in views {
                maps.delete_view(map, landmark, *view).await?;
            }
            let deleted = counted(views.len() as u64, "view");
            session.show(
                &serde_json::json!({ "deleted": views }),
                &format!("{deleted} of {landmark} deleted"),
            )?;
            session.note(&format!(
                "  The model stays until it is learnt again: waymark landmark teach {landmark} PHOTO..."
            ));
            Ok(())
        }
    }
}

/// Corners as `--corners` takes them, to a tenth of a pixel.
fn corners_text(corners: &[[f64; 2]; 4]) -> String {
    corners.map(|[x, y]| format!("{x:.1},{y:.1}")).join(",")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_are_shown_as_they_are_given() {
        let corners = [[1.0, 2.0], [30.25, 2.0], [30.0, 40.0], [1.0, 40.0]];
        let text = corners_text(&corners);
        assert_eq!(text, "1.0,2.0,30.2,2.0,30.0,40.0,1.0,40.0");
        assert!(crate::arg_parsers::corners(&text).is_ok());
    }
}
