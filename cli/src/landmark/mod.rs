//! `waymark landmark`: teach, look at and change the landmarks of a map.

mod accept;
mod edit;
mod learning;
mod photograph;
mod place;
mod quad_choice;
mod reasons;
mod show;
mod teach;

use crate::{
    arg_parsers::size,
    names::name,
    session::{Consent, MapArgs},
};
use client::api::{LandmarkHealthBody, Size};

/// `waymark landmark`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(subcommand)]
    verb: Verb,
    #[command(flatten)]
    map: MapArgs,
}

#[derive(Debug, clap::Subcommand)]
enum Verb {
    /// List the landmarks of a map: state, size, place, quality
    ///
    /// For example, those that are not in use and have `door` in their names; those that were
    /// changed last:
    ///   waymark landmark list --state inactive --name door
    ///   waymark landmark list --sort=-changed
    #[command(verbatim_doc_comment)]
    List(show::ListArgs),
    /// Show a landmark: what it was learnt from, where it is, why it is not in use, what to do.
    Show {
        /// The landmark.
        landmark: String,
    },
    /// Teach a landmark from photographs
    ///
    /// The server finds the one framed object in each photograph, learns it, and says whether the
    /// landmark is in use or which check it failed. Where a photograph shows several, they are
    /// numbered in a picture beside it: take one with --pick. Nothing is made if no photograph can
    /// be used.
    ///
    /// For example:
    ///   waymark landmark teach poster --size 0.60x0.84 photo1.jpg photo2.jpg
    ///   waymark landmark teach fire-plan scan.png --whole-image --size 0.42x0.30
    ///   waymark landmark teach poster hall.jpg --pick 2
    #[command(verbatim_doc_comment)]
    Teach(teach::TeachArgs),
    /// Set a landmark's place: on a wall, by coordinates, or by a photograph from a known place
    ///
    /// By tape measure: `waymark map walls MAP --draw walls.svg` numbers the walls; stand before
    /// the wall, measure from its left end to the middle of the landmark, and from the floor to its
    /// middle. For example:
    ///   waymark landmark place poster --wall 12 --at 1.85 --height 1.50
    ///   waymark landmark place poster --xy 4.20,7.35 --facing 90 --height 1.50
    ///   waymark landmark place poster --photo p.jpg --camera 610,610,320,240 --from 2.5,3.0,45 --camera-height 1.2
    #[command(verbatim_doc_comment)]
    Place(Box<place::PlaceArgs>),
    /// Set the width and height of a landmark; a size whose ratio its photographs contradict is
    /// refused.
    Size {
        /// The landmark.
        landmark: String,
        /// Width and height in metres, such as 0.60x0.84.
        #[arg(value_parser = size)]
        size: Size,
        #[command(flatten)]
        consent: Consent,
    },
    /// Give a landmark another name.
    Rename {
        /// The landmark.
        landmark: String,
        /// Its name from now on: lower-case letters, digits, `_` and `-`, up to 64.
        #[arg(value_parser = name)]
        new_name: String,
    },
    /// Set how far a landmark is trusted, after robots found it elsewhere or not at all.
    Health {
        /// The landmark.
        landmark: String,
        /// `sound`: it is where the map says; `flagged`: in doubt, but used; `quarantined`:
        /// corrects no pose.
        #[arg(value_enum)]
        health: HealthWord,
    },
    /// Show or set weights and gates of a landmark, where others than the map's are wanted
    ///
    /// A landmark that failed a gate is not in use. Where you know better, say so and why; the
    /// gates are judged again at once, and lessons keep to it. For example, a scan in plain colours
    /// that nothing else resembles, a stricter threshold, and back to the settings of `waymark map
    /// learning`:
    ///   waymark landmark learning poster --use-despite-gates true --why "nothing else hangs there"
    ///   waymark landmark learning poster --weights 20:1 --why "the next door looks like it"
    ///   waymark landmark learning poster --defaults --why "taught anew"
    #[command(verbatim_doc_comment)]
    Learning(learning::Args),
    /// Delete a landmark with its views and model; `waymark history undo` brings all of it back.
    Delete {
        /// The landmarks.
        #[arg(required = true)]
        landmarks: Vec<String>,
        #[command(flatten)]
        consent: Consent,
    },
    /// Make landmarks of tracks that a robot has gathered, and learn them
    ///
    /// For example, tracks 3 and 5 of gathering 1:
    ///   waymark landmark accept 1 3=poster 5=fire-plan
    #[command(verbatim_doc_comment)]
    Accept(accept::AcceptArgs),
}

/// How far a landmark is trusted, as it is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum HealthWord {
    Sound,
    Flagged,
    Quarantined,
}

impl From<HealthWord> for LandmarkHealthBody {
    fn from(word: HealthWord) -> Self {
        match word {
            HealthWord::Sound => Self::Sound,
            HealthWord::Flagged => Self::Flagged,
            HealthWord::Quarantined => Self::Quarantined,
        }
    }
}

/// Runs the command.
pub(crate) async fn run(args: &Args) -> anyhow::Result<()> {
    let session = args.map.session()?;
    let done = async {
        let map = session.map().await?;
        match &args.verb {
            Verb::List(wanted) => show::list(&session, map, wanted).await,
            Verb::Show { landmark } => show::one(&session, map, landmark).await,
            Verb::Teach(teach) => teach::run(&session, map, teach).await,
            Verb::Place(place) => place::run(&session, map, place).await,
            Verb::Size { landmark, size, consent } => {
                edit::size(&session, map, landmark, *size, *consent).await
            }
            Verb::Rename { landmark, new_name } => edit::rename(&session, map, landmark, new_name).await,
            Verb::Health { landmark, health } => {
                edit::health(&session, map, landmark, (*health).into()).await
            }
            Verb::Learning(learning) => learning::run(&session, map, learning).await,
            Verb::Delete { landmarks, consent } => edit::delete(&session, map, landmarks, *consent).await,
            Verb::Accept(accept) => accept::run(&session, map, accept).await,
        }
    };
    session.explained(done.await).await
}
