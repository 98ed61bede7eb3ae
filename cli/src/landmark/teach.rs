//! `waymark landmark teach`: photographs to a landmark that is in use, or to the reason why it is
//! not.

use super::{photograph::Photograph, reasons::in_use, show};
use crate::{
    arg_parsers::{corners, size},
    failure::{Class, Failure},
    names::name,
    screen,
    session::{Consent, Session},
};
use client::{
    ClientError, LandmarkRegion,
    api::{Landmark, LandmarkPatch, Size, TrainingView, UploadOutcomeBody},
};
use std::path::{Path, PathBuf};

/// Sides of a landmark that nobody is asked about, metres.
const USUAL_SIDE_M: std::ops::RangeInclusive<f64> = 0.02..=20.0;

/// `waymark landmark teach`.
#[derive(Debug, clap::Args)]
pub(super) struct TeachArgs {
    /// The landmark; made if it does not exist.
    #[arg(value_parser = name)]
    landmark: String,
    /// Photographs of it, PNG or JPEG.
    #[arg(required = true, value_name = "PHOTO")]
    photographs: Vec<PathBuf>,
    /// Its width and height in metres, such as 0.60x0.84; without it there is recognition but no
    /// pose. A size whose ratio the photographs contradict, such as one with swapped sides, is
    /// refused.
    #[arg(long, value_parser = size)]
    size: Option<Size>,
    /// The whole picture is the landmark (a scan, a cut-out).
    #[arg(long, conflicts_with_all = ["pick", "corners"])]
    whole_image: bool,
    /// The framed object to take where a photograph shows several: 1 is the leftmost.
    #[arg(long, value_name = "N", conflicts_with = "corners")]
    pick: Option<usize>,
    /// Its corners in one photograph, pixels: top-left, top-right, bottom-right, bottom-left.
    #[arg(long, value_name = "X,Y,X,Y,X,Y,X,Y", value_parser = corners)]
    corners: Option<[[f64; 2]; 4]>,
    /// Warped, dimmed and blurred views made of each photograph; left out, the server chooses by
    /// the number of photographs. A landmark learnt from generated views is recognised less surely
    /// than one seen from many sides.
    #[arg(long)]
    generated_views: Option<u32>,
    #[command(flatten)]
    consent: Consent,
}

pub(super) async fn run(session: &Session, map: &str, args: &TeachArgs) -> anyhow::Result<()> {
    if let Some(size) = args.size {
        check_size(size, args.consent)?;
    }
    if args.photographs.len() > 1 && (args.pick.is_some() || args.corners.is_some()) {
        return Err(Failure::usage("--pick and --corners are for one photograph at a time.").into());
    }
    let existing = existing(session, map, &args.landmark).await?;
    // A landmark that exists gets its size once a photograph was taken.
    let uploaded = upload_all(session, map, args, args.size.filter(|_| existing.is_none())).await;
    let failures = match (uploaded, existing.as_ref().zip(args.size)) {
        // The photographs contradict the size that it has, and another one is given.
        (Err(error), Some((landmark, size))) if contradicts(&error) && landmark.size != Some(size) => {
            resize(session, map, landmark, size).await?;
            upload_all(session, map, args, None).await?
        }
        (uploaded, sized) => {
            let failures = uploaded?;
            if let Some((landmark, size)) = sized {
                resize(session, map, landmark, size).await?;
            }
            failures
        }
    };
    let learnt = learn(session, map, args).await?;
    session.show(&learnt, &show::facts(&learnt))?;
    in_use(&learnt)?;
    if !failures.is_empty() {
        let (count, all) = (failures.len(), args.photographs.len());
        let sentence = format!("{count} of {all} photographs could not be used; the others were learnt.");
        return Err(Failure::of_several(sentence, "photographs_refused", &failures).into());
    }
    for line in show::next(&learnt) {
        session.note(&format!("  {line}"));
    }
    Ok(())
}

/// Sizes that are hardly meant in metres are asked about.
pub(super) fn check_size(size: Size, consent: Consent) -> anyhow::Result<()> {
    if USUAL_SIDE_M.contains(&size.width_m) && USUAL_SIDE_M.contains(&size.height_m) {
        return Ok(());
    }
    let (w, h) = (size.width_m, size.height_m);
    consent.ask(&format!("{w} m x {h} m: sizes are in metres, usual sides 0.02 to 20. Is this meant?"))
}

async fn existing(session: &Session, map: &str, name: &str) -> anyhow::Result<Option<Landmark>> {
    match session.maps().landmark(map, name).await {
        Ok(landmark) => Ok(Some(landmark)),
        Err(ClientError::Refused { status: 404, code, .. }) if code == "unknown_landmark" => Ok(None),
        Err(error) => Err(error.into()),
    }
}

/// Whether photographs contradict the size of their landmark.
fn contradicts(error: &anyhow::Error) -> bool {
    error.downcast_ref::<Failure>().is_some_and(|failure| failure.code == "aspect_differs")
}

/// A size given again replaces the other one, and says so.
async fn resize(session: &Session, map: &str, landmark: &Landmark, size: Size) -> anyhow::Result<()> {
    if landmark.size == Some(size) {
        return Ok(());
    }
    let patch = LandmarkPatch { size: Some(Some(size)), ..LandmarkPatch::default() };
    session.maps().if_match(&landmark.revision).update_landmark(map, &landmark.name, &patch).await?;
    let (before, after) = (show::size_text(landmark.size), show::size_text(Some(size)));
    session.note(&format!("{}: size {before} -> {after}", landmark.name));
    Ok(())
}

/// Sends all photographs and gives the failures of those that could not be used. An error if none
/// could be: then nothing was made. An error that is not about one photograph, such as a size that
/// it contradicts, ends it.
async fn upload_all(
    session: &Session,
    map: &str,
    args: &TeachArgs,
    new_size: Option<Size>,
) -> anyhow::Result<Vec<Failure>> {
    let progress = screen::progress(args.photographs.len(), "uploading");
    let (mut used, mut failures) = (0, Vec::new());
    for path in &args.photographs {
        match upload(session, map, args, (path, new_size)).await {
            Ok(view) => {
                used += 1;
                let name = path.display();
                match view.outcome {
                    Some(UploadOutcomeBody::NearDuplicate) => {
                        session.note(&format!(
                            "{name}: not kept, it shows nothing that view {} does not",
                            view.id
                        ));
                    }
                    Some(UploadOutcomeBody::Duplicate) => {
                        session.note(&format!("{name}: not kept, it is view {} already", view.id));
                    }
                    Some(UploadOutcomeBody::New) | None => {}
                }
            }
            Err(failure) if matches!(failure.class, Class::Refused | Class::Usage) => failures.push(failure),
            Err(failure) => {
                progress.finish_and_clear();
                return Err(failure.into());
            }
        }
        progress.inc(1);
    }
    progress.finish_and_clear();
    match (used, failures.len()) {
        (0, 1) => Err(failures.swap_remove(0).into()),
        (0, _) => {
            let sentence = format!("No photograph could be used; {} was not taught.", args.landmark);
            Err(Failure::of_several(sentence, "photographs_refused", &failures).into())
        }
        _ => Ok(failures),
    }
}

/// Sends one photograph; the landmark is made with it if it does not exist.
async fn upload(
    session: &Session,
    map: &str,
    args: &TeachArgs,
    (path, new_size): (&Path, Option<Size>),
) -> Result<TrainingView, Failure> {
    let region = match (args.whole_image, args.corners) {
        (true, _) => LandmarkRegion::WholeImage,
        (false, Some(corners)) => LandmarkRegion::Corners(corners),
        (false, None) => LandmarkRegion::Detect,
    };
    let photograph = Photograph { path, region, pick: args.pick };
    photograph.send(session, (map, &args.landmark), |view| view.or_make_landmark(new_size)).await
}

async fn learn(session: &Session, map: &str, args: &TeachArgs) -> anyhow::Result<Landmark> {
    let names = std::slice::from_ref(&args.landmark);
    let job = session.maps().learn(map, Some(names), args.generated_views).await?;
    session.finished(job, "learning").await?;
    Ok(session.maps().landmark(map, &args.landmark).await?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_size_in_centimetres_needs_consent() {
        let ask = |width_m, height_m, yes| check_size(Size { width_m, height_m }, Consent::given(yes));
        assert!(ask(0.6, 0.84, false).is_ok() && ask(0.02, 20.0, false).is_ok());
        assert!(ask(60.0, 84.0, true).is_ok());
    }
}
