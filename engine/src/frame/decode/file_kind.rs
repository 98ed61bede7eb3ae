//! What a file is that is neither JPEG nor PNG, by its first bytes, and how to get one of those.
//! More decoders would be more ways to attack the server: these formats come from phones and
//! programs that save JPEG as well.

/// Kinds by the bytes at a place.
const KINDS: [(usize, &[u8], &str); 13] = [
    (4, b"ftypheic", "HEIC"),
    (4, b"ftypheix", "HEIC"),
    (4, b"ftypmif1", "HEIC"),
    (4, b"ftypavif", "AVIF"),
    (0, b"BM", "BMP"),
    (0, b"II*\0", "TIFF"),
    (0, b"MM\0*", "TIFF"),
    (0, b"GIF8", "GIF"),
    (0, b"\0\0\0\x0cJXL ", "JPEG XL"),
    (0, b"\xff\x0a", "JPEG XL"),
    (0, b"%PDF", "PDF"),
    (0, b"<svg", "SVG"),
    (0, b"<?xml", "XML"),
];

/// A sentence for a person.
pub(super) fn not_read(bytes: &[u8]) -> String {
    let is_at = |place: usize, word: &[u8]| bytes.get(place..).is_some_and(|rest| rest.starts_with(word));
    if bytes.is_empty() {
        return "the file is empty".to_owned();
    }
    if is_at(0, b"RIFF") && is_at(8, b"WEBP") {
        return of_kind("WebP");
    }
    match KINDS.iter().find(|(place, word, _)| is_at(*place, word)) {
        Some((.., "HEIC")) => {
            "a HEIC photograph; only JPEG and PNG are read. Export it as JPEG, or take photographs as \
            JPEG (iPhone: Settings, Camera, Formats, Most Compatible)"
                .to_owned()
        }
        Some((.., kind)) => of_kind(kind),
        None => "neither a JPEG nor a PNG image".to_owned(),
    }
}

fn of_kind(kind: &str) -> String {
    format!("a {kind} file; only JPEG and PNG are read. Save it as one of them")
}
