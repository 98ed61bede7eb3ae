//! `waymark recognise`: what is in photographs.

use super::{
    answers::sentence,
    camera_arg::{CameraArg, camera},
    failure::{Class, Failure},
    pictures::{self, Sent},
    session::{MapArgs, Session},
};
use client::RecogniseOptions;
use std::path::{Path, PathBuf};
use vision::params::preset::Preset;

/// `waymark recognise`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Photographs, PNG, JPEG or BMP; those over the server's limit of pixels are sent smaller.
    #[arg(required = true, value_name = "PHOTO")]
    photographs: Vec<PathBuf>,
    /// Camera for poses: the file that `waymark camera calibrate --json` wrote, ROS' ost.yaml, or
    /// fx,fy,cx,cy in pixels; and its standard deviations, where known: of the focal length, of the
    /// principal point. A photograph of another scale than that of the file has scaled intrinsics;
    /// one by a lens of another focal length, by its EXIF, is refused.
    #[arg(long, value_name = "FILE|FX,FY,CX,CY", value_parser = camera)]
    camera: Option<CameraArg>,
    /// Detector and decision for these photographs, `default` or `paper`; otherwise the map's.
    #[arg(long, value_name = "NAME")]
    preset: Option<Preset>,
    #[command(flatten)]
    map: MapArgs,
}

/// Runs the command.
pub(crate) async fn run(args: &Args) -> anyhow::Result<()> {
    let session = args.map.session()?;
    let map = session.explained(session.map().await).await?;
    let mut failures = Vec::new();
    for path in &args.photographs {
        match photograph(&session, map, args, path).await {
            Ok(()) => {}
            Err(failure) if matches!(failure.class, Class::Refused | Class::Usage) => failures.push(failure),
            Err(failure) => return Err(failure.into()),
        }
    }
    match failures.len() {
        0 => Ok(()),
        1 => Err(failures.swap_remove(0).into()),
        count => {
            let sentence = format!("{count} of {} photographs could not be used.", args.photographs.len());
            Err(Failure::of_several(sentence, "photographs_refused", &failures).into())
        }
    }
}

async fn photograph(session: &Session, map: &str, args: &Args, path: &Path) -> Result<(), Failure> {
    let name = path.display().to_string();
    let Sent { bytes: image, shrunk, lens } = pictures::photograph(path)
        .map_err(|error| Failure::new(Class::Usage, "unreadable", format!("{name}: {error}")))?;
    if let Some([[w, h], [to_w, to_h]]) = shrunk {
        session.note(&format!("{name}: {w}x{h} px made {to_w}x{to_h}; corners are of that size."));
    }
    let named = |failure: Failure| Failure { sentence: format!("{name}: {}", failure.sentence), ..failure };
    if let Some(camera) = &args.camera {
        if let Some(caution) = camera.check_lens(lens.as_ref()).map_err(named)? {
            session.note(&format!("{name}: {caution}"));
        }
        camera.of_photograph(&image).map_err(named)?;
    }
    let maps = session.maps();
    let (camera, camera_size_px) = args.camera.as_ref().map(CameraArg::stated).unzip();
    let options = RecogniseOptions { camera, camera_size_px: camera_size_px.flatten(), preset: args.preset };
    let answer = maps.recognise_with(map, image, &options).await;
    let answer = session.explained(answer.map_err(Into::into)).await.map_err(|error| {
        let failure = Failure::of(&error);
        match failure.class {
            Class::Refused | Class::Usage => {
                Failure { sentence: format!("{name}: {}", failure.sentence), ..failure }
            }
            _ => failure,
        }
    })?;
    session.show(&answer, &sentence(&name, &answer)).map_err(|error| Failure::of(&error))
}
