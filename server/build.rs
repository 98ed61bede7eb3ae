//! Lists the files of the administrator's pages for `src/http/pages.rs`, each as it is and compressed. They are built by
//! `npm run build` in `web` and committed, so that the server is built without Node.

use flate2::{Compression, write::GzEncoder};
use std::{
    env,
    error::Error,
    fmt::Write as _,
    fs,
    io::Write as _,
    path::{Path, PathBuf},
};

fn main() -> Result<(), Box<dyn Error>> {
    let folder = Path::new(&env::var("CARGO_MANIFEST_DIR")?).join("../web/dist");
    let out = PathBuf::from(env::var("OUT_DIR")?);
    let mut list = "[\n".to_owned();
    println!("cargo:rerun-if-changed={}", folder.display());
    for file in files(&folder)? {
        let path = file.strip_prefix(&folder)?.to_str().ok_or("a file name that is not UTF-8")?;
        if !matches!(
            file.extension().and_then(|e| e.to_str()),
            Some("html" | "js" | "css" | "svg" | "txt" | "woff2")
        ) {
            continue;
        }
        let content = fs::read(&file)?;
        let packed = out.join(format!("{}.gz", path.replace('/', "-")));
        let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
        encoder.write_all(&content)?;
        fs::write(&packed, encoder.finish()?)?;
        let [file, packed] = [&file, &packed].map(|path| path.to_str());
        let (Some(file), Some(packed)) = (file, packed) else {
            return Err("a folder that is not UTF-8".into());
        };
        writeln!(list, "    ({path:?}, include_bytes!({file:?}), include_bytes!({packed:?})),")?;
    }
    list.push(']');
    fs::write(out.join("pages.rs"), list)?;
    Ok(())
}

/// Every file below a folder, in order.
fn files(folder: &Path) -> Result<Vec<PathBuf>, Box<dyn Error>> {
    let mut all = Vec::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            all.extend(files(&path)?);
        } else {
            all.push(path);
        }
    }
    all.sort();
    Ok(all)
}
