//! Lists the files of the administrator's pages for `src/http/pages.rs`, each as it is and
//! compressed. They are built by `npm run build` in `web` and committed, so that the server is
//! built without Node. The guides of `docs`, which the pages show, are among them.

use flate2::{Compression, write::GzEncoder};
use std::{
    env,
    error::Error,
    fmt::Write as _,
    fs,
    io::Write as _,
    path::{Path, PathBuf},
};

/// Documents that guides lead to.
const DOCUMENTS: [&str; 6] =
    ["API.md", "AUTHORISATION.md", "BUNDLE.md", "EVALUATION.md", "OPERATIONS.md", "TERMS.md"];

fn main() -> Result<(), Box<dyn Error>> {
    let root = PathBuf::from(env::var("CARGO_MANIFEST_DIR")?).join("..");
    let (pages, docs) = (root.join("web/dist"), root.join("docs"));
    let out = PathBuf::from(env::var("OUT_DIR")?);
    let mut list = "[\n".to_owned();
    println!("cargo:rerun-if-changed={}", pages.display());
    for file in files(&pages)? {
        let path = file.strip_prefix(&pages)?.to_str().ok_or("a file name that is not UTF-8")?;
        let kind = file.extension().and_then(|e| e.to_str());
        if matches!(kind, Some("html" | "js" | "css" | "svg" | "txt" | "woff2")) {
            embed(&mut list, &out, path, &file)?;
        }
    }
    println!("cargo:rerun-if-changed={}", docs.join("guides").display());
    for file in files(&docs.join("guides"))?.into_iter().chain(DOCUMENTS.map(|name| docs.join(name))) {
        println!("cargo:rerun-if-changed={}", file.display());
        let name = file.file_name().and_then(|name| name.to_str()).ok_or("a file name that is not UTF-8")?;
        embed(&mut list, &out, &format!("guides/{name}"), &file)?;
    }
    list.push(']');
    fs::write(out.join("pages.rs"), list)?;
    Ok(())
}

/// Adds a file to the list, by its path below `/`.
fn embed(list: &mut String, out: &Path, path: &str, file: &Path) -> Result<(), Box<dyn Error>> {
    let packed = out.join(format!("{}.gz", path.replace('/', "-")));
    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(&fs::read(file)?)?;
    fs::write(&packed, encoder.finish()?)?;
    let (Some(file), Some(packed)) = (file.to_str(), packed.to_str()) else {
        return Err("a folder that is not UTF-8".into());
    };
    writeln!(list, "    ({path:?}, include_bytes!({file:?}), include_bytes!({packed:?})),")?;
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
