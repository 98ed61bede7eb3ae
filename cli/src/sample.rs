//! `waymark sample`: the files that the guides name, to follow them without a poster, a camera or a
//! robot.

use crate::{
    failure::{Class, Failure},
    pictures, screen,
};
use anyhow::Context as _;
use sim::{
    office::{self, PHOTOGRAPHS},
    render::Renderer,
};
use std::{
    fmt::Write as _,
    fs,
    path::{Path, PathBuf},
};

/// What the folder says of itself.
const README: &str = "\
Files for the guides of Waymark: a rendered office of 10 m x 5 m with four posters of 0.60 m x 0.84 m.

poster1.jpg to poster3.jpg  one poster; its middle is at 4.59, 2.50 m, 1.50 m up, facing -90 degrees
here.jpg                    the same poster from 3.23, 0.76 m, 1.45 m up, looking to 56 degrees
map1.jpg                    another poster
wall.jpg                    two posters
pictures/                   eight pictures around the first poster, to calibrate the camera
drive.log                   a drive with a laser, as a CARMEN log
floor.yaml, floor.pgm       the walls as a grid of map_server
floor.geojson, plan.svg     the walls as GeoJSON and as a floor plan (1 px = 1 cm)
photographs.csv             where each photograph was taken: photograph,x_m,y_m,z_m

The camera of all of them: 1280 x 960 px, fx = fy = 1000 px, centre 639.5, 479.5, no distortion.
";

/// `waymark sample`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The folder; made if it does not exist. Files that are there with another content stay, and
    /// end the command.
    #[arg(value_name = "FOLDER")]
    folder: PathBuf,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let folder = &args.folder;
    fs::create_dir_all(folder.join("pictures"))
        .with_context(|| format!("cannot make {}", folder.display()))?;
    let building = office::office();
    let mut renderer = Renderer::new(office::camera());
    let mut truths = String::from("photograph,x_m,y_m,z_m\n");
    for (number, (name, standpoint)) in (0_u64..).zip(&PHOTOGRAPHS) {
        let image = office::photograph(&mut renderer, &building, standpoint, number);
        put(folder, name, &pictures::photograph_jpeg(&image)?)?;
        let at = office::pose(&building, standpoint).translation.vector;
        writeln!(truths, "{name},{:.3},{:.3},{:.3}", at.x, at.y, at.z)?;
    }
    for (number, standpoint) in (0_u64..).zip(office::around()) {
        let image = office::photograph(&mut renderer, &building, &standpoint, 100 + number);
        let png = engine::picture::png(image.width(), image.height(), image.data())?;
        put(folder, &format!("pictures/{number}.png"), &png)?;
    }
    put(folder, "drive.log", office::laser_log(&building).as_bytes())?;
    for (name, content) in office::floor_plans(&building) {
        put(folder, name, &content)?;
    }
    put(folder, "photographs.csv", truths.as_bytes())?;
    put(folder, "README.txt", README.as_bytes())?;
    screen::say(&format!(
        "{}: photographs, a laser log and floor plans of an office; README.txt says more",
        folder.display()
    ));
    Ok(())
}

/// Writes a file; one that is there already must be the same.
fn put(folder: &Path, name: &str, content: &[u8]) -> anyhow::Result<()> {
    let path = folder.join(name);
    match fs::read(&path) {
        Ok(there) if there == content => Ok(()),
        Ok(_) => {
            let exists = Failure::new(Class::Conflict, "exists", format!("{} exists.", path.display()));
            Err(exists.advise("Choose another folder, or delete the file first.").into())
        }
        Err(_) => fs::write(&path, content).with_context(|| format!("cannot make {}", path.display())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_of_somebody_else_stays() {
        let folder = tempfile::tempdir().unwrap();
        put(folder.path(), "a.txt", b"one").unwrap();
        put(folder.path(), "a.txt", b"one").unwrap();
        let refused = put(folder.path(), "a.txt", b"two").unwrap_err();
        assert_eq!(Failure::of(&refused).class, Class::Conflict);
        assert_eq!(fs::read(folder.path().join("a.txt")).unwrap(), b"one");
    }
}
