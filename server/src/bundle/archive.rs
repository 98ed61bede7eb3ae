//! The zip of a bundle. Files are stored as they are, in the order in which they are written,
//! without times. The comment at the end is the seal: the SHA-256 of all bytes before it, 64
//! hexadecimal digits. So no byte of it changes unseen, not even one that readers of zip files
//! skip.

use super::{
    BundleError, Fault, MANIFEST, MAX_FILES, MAX_RECORD_BYTES,
    manifest::{FileDigest, Manifest},
    refused,
};
use crate::store::pictures::hex;
use sha2::{Digest as _, Sha256};
use std::{
    collections::BTreeMap,
    fs::File,
    io::{self, BufWriter, Read as _, Seek as _, SeekFrom, Write as _},
};
use zip::{CompressionMethod, ZipArchive, ZipWriter, result::ZipError, write::SimpleFileOptions};

/// Length of the seal.
const SEAL_BYTES: u64 = 64;
/// Length of the record of a zip's end, before its comment.
const END_BYTES: u64 = 22;
/// Bytes read at a time.
const BUFFER: usize = 1 << 20;

fn io_of(error: ZipError) -> io::Error {
    match error {
        ZipError::Io(error) => error,
        other => io::Error::other(other),
    }
}

/// A bundle that is being written.
pub(super) struct Writer {
    zip: ZipWriter<BufWriter<File>>,
    files: BTreeMap<String, FileDigest>,
}

impl Writer {
    pub(super) fn new(file: File) -> Self {
        Self { zip: ZipWriter::new(BufWriter::with_capacity(BUFFER, file)), files: BTreeMap::new() }
    }

    /// How many files there are.
    pub(super) fn len(&self) -> usize {
        self.files.len()
    }

    /// Adds a file.
    pub(super) fn add(&mut self, name: &str, bytes: &[u8]) -> io::Result<()> {
        self.put(name, bytes)?;
        let digest = FileDigest { bytes: bytes.len() as u64, sha256: hex(&Sha256::digest(bytes)) };
        self.files.insert(name.to_owned(), digest);
        Ok(())
    }

    fn put(&mut self, name: &str, bytes: &[u8]) -> io::Result<()> {
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Stored)
            .last_modified_time(zip::DateTime::default())
            .unix_permissions(0o644);
        self.zip.start_file(name, options).map_err(io_of)?;
        self.zip.write_all(bytes)
    }

    /// Adds the manifest and the seal. The file stands at its beginning.
    pub(super) fn finish(mut self, map: &str) -> io::Result<File> {
        let manifest = Manifest::new(map, std::mem::take(&mut self.files));
        self.put(MANIFEST, &serde_json::to_vec_pretty(&manifest)?)?;
        self.zip.set_raw_comment(vec![b'0'; SEAL_BYTES as usize].into_boxed_slice()).map_err(io_of)?;
        let mut file = self.zip.finish().map_err(io_of)?.into_inner()?;
        let sealed = file.metadata()?.len() - SEAL_BYTES;
        let seal = digest(&mut file, sealed)?;
        file.seek(SeekFrom::Start(sealed))?;
        file.write_all(seal.as_bytes())?;
        file.rewind()?;
        Ok(file)
    }
}

/// SHA-256 of the first bytes of a file, hexadecimal.
fn digest(file: &mut File, length: u64) -> io::Result<String> {
    file.rewind()?;
    let (mut hash, mut buffer, mut rest) = (Sha256::new(), vec![0; BUFFER], length);
    while rest > 0 {
        let part = rest.min(BUFFER as u64) as usize;
        file.read_exact(&mut buffer[..part])?;
        hash.update(&buffer[..part]);
        rest -= part as u64;
    }
    Ok(hex(&hash.finalize()))
}

/// A bundle that is read: every byte is that of a digest.
pub(super) struct Reader {
    zip: ZipArchive<File>,
    pub(super) manifest: Manifest,
}

fn not_a_zip(error: ZipError) -> BundleError {
    match error {
        ZipError::Io(error) if error.kind() != io::ErrorKind::UnexpectedEof => error.into(),
        other => refused(Fault::NotABundle, "bundle", other.to_string()),
    }
}

impl Reader {
    /// Opens a bundle and checks its seal, its names, sizes and digests. Nothing is unpacked.
    pub(super) fn open(mut file: File) -> Result<Self, BundleError> {
        sealed(&mut file)?;
        let length = file.metadata()?.len();
        file.rewind()?;
        let mut zip = ZipArchive::new(file).map_err(not_a_zip)?;
        let declared = entries(&mut zip, length)?;
        let manifest = match declared.get(MANIFEST) {
            Some(bytes) if *bytes <= MAX_RECORD_BYTES => read(&mut zip, MANIFEST)?,
            Some(_) => return Err(refused(Fault::TooLarge, MANIFEST, "it is too large")),
            None => return Err(refused(Fault::Missing, MANIFEST, "the bundle has no such file")),
        };
        let mut reader = Self { zip, manifest: Manifest::parse(&manifest)? };
        reader.check(&declared)?;
        Ok(reader)
    }

    /// Manifest and zip name the same files, and each has its digest.
    fn check(&mut self, declared: &BTreeMap<String, u64>) -> Result<(), BundleError> {
        for name in declared.keys().filter(|name| *name != MANIFEST) {
            if !self.manifest.files.contains_key(name) {
                return Err(refused(Fault::BadPath, name, format!("{MANIFEST} does not name this file")));
            }
        }
        let files = self.manifest.files.clone();
        for (name, file) in files {
            let Some(bytes) = declared.get(&name) else {
                return Err(refused(Fault::Missing, name, "the bundle has no such file"));
            };
            if *bytes != file.bytes || hex(&Sha256::digest(self.read(&name)?)) != file.sha256 {
                return Err(refused(Fault::Damaged, name, format!("it is not what {MANIFEST} says")));
            }
        }
        Ok(())
    }

    /// The bytes of a file.
    pub(super) fn read(&mut self, name: &str) -> Result<Vec<u8>, BundleError> {
        read(&mut self.zip, name)
    }
}

/// Checks the seal, and that the record of the end, from which the number of files is read, has no
/// more than fit.
fn sealed(file: &mut File) -> Result<(), BundleError> {
    let none = || refused(Fault::NotABundle, "bundle", "it is no bundle of a map, or its end is missing");
    let length = file.metadata()?.len();
    let sealed = length.checked_sub(SEAL_BYTES).filter(|n| *n >= END_BYTES).ok_or_else(none)?;
    file.seek(SeekFrom::Start(sealed - END_BYTES))?;
    let (mut end, mut seal) = ([0; END_BYTES as usize], [0; SEAL_BYTES as usize]);
    file.read_exact(&mut end)?;
    file.read_exact(&mut seal)?;
    if !end.starts_with(b"PK\x05\x06") || end[20..] != (SEAL_BYTES as u16).to_le_bytes() {
        return Err(none());
    }
    if digest(file, sealed)?.as_bytes() != seal {
        return Err(refused(
            Fault::Damaged,
            "bundle",
            "its bytes are not those that were saved: copy it again",
        ));
    }
    let files = u16::from_le_bytes([end[10], end[11]]);
    if usize::from(files) > MAX_FILES + 1 {
        return Err(refused(Fault::TooLarge, "bundle", format!("it has more than {MAX_FILES} files")));
    }
    Ok(())
}

/// Name and size of each file. No file is packed, so that together they are no larger than the
/// bundle.
fn entries(zip: &mut ZipArchive<File>, length: u64) -> Result<BTreeMap<String, u64>, BundleError> {
    let (mut found, mut sum) = (BTreeMap::new(), 0_u64);
    if zip.has_duplicate_names() {
        return Err(refused(Fault::BadPath, "bundle", "two of its files have the same name"));
    }
    for index in 0..zip.len() {
        let entry = zip.by_index_raw(index).map_err(not_a_zip)?;
        let name = String::from_utf8_lossy(entry.name_raw()).into_owned();
        if !is_plain(&name) || !entry.is_file() {
            return Err(refused(Fault::BadPath, name, "a bundle has no file of such a name"));
        }
        if entry.encrypted()
            || entry.compression() != CompressionMethod::Stored
            || entry.size() != entry.compressed_size()
        {
            return Err(refused(
                Fault::TooLarge,
                name,
                "files of a bundle are stored as they are, not packed",
            ));
        }
        sum = sum.saturating_add(entry.size());
        if sum > length {
            return Err(refused(Fault::TooLarge, name, "its files are larger than the bundle"));
        }
        found.insert(name, entry.size());
    }
    Ok(found)
}

/// A relative path of plain segments.
fn is_plain(name: &str) -> bool {
    let plain = |b: u8| b.is_ascii_lowercase() || b.is_ascii_digit() || b"._-".contains(&b);
    name.len() <= 128
        && name.split('/').all(|part| !part.is_empty() && !part.starts_with('.') && part.bytes().all(plain))
}

fn read(zip: &mut ZipArchive<File>, name: &str) -> Result<Vec<u8>, BundleError> {
    let mut entry = zip.by_name(name).map_err(not_a_zip)?;
    let mut bytes = Vec::new();
    let damaged = |e: io::Error| refused(Fault::Damaged, name, e.to_string());
    (&mut entry).take(u64::MAX).read_to_end(&mut bytes).map_err(damaged)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    const PLAIN: SimpleFileOptions = SimpleFileOptions::DEFAULT.compression_method(CompressionMethod::Stored);

    /// A zip of these files. It has no manifest.
    fn packed<'a>(files: impl IntoIterator<Item = (&'a str, &'a [u8], SimpleFileOptions)>) -> Vec<u8> {
        let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
        for (name, bytes, options) in files {
            zip.start_file(name, options).unwrap();
            zip.write_all(bytes).unwrap();
        }
        zip.set_raw_comment(vec![b'0'; SEAL_BYTES as usize].into_boxed_slice()).unwrap();
        zip.finish().unwrap().into_inner()
    }

    /// What is said of a zip whose seal is right.
    fn refusal(mut zip: Vec<u8>) -> (Fault, String) {
        let end = zip.len() - SEAL_BYTES as usize;
        let seal = hex(&Sha256::digest(&zip[..end]));
        zip[end..].copy_from_slice(seal.as_bytes());
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(&zip).unwrap();
        match Reader::open(file) {
            Err(BundleError::Refused { fault, file, .. }) => (fault, file),
            Err(other) => panic!("another error: {other}"),
            Ok(_) => panic!("it is opened"),
        }
    }

    /// The same bytes with one name in place of another of its length.
    fn renamed(mut zip: Vec<u8>, from: &[u8], to: &[u8]) -> Vec<u8> {
        let places: Vec<usize> =
            (0..=zip.len() - from.len()).filter(|i| zip[*i..].starts_with(from)).collect();
        // In front of its bytes, and in the list at the end.
        assert_eq!(places.len(), 2);
        for place in places {
            zip[place..place + to.len()].copy_from_slice(to);
        }
        zip
    }

    #[test]
    fn a_later_format_is_named_whatever_else_it_says() {
        let later = br#"{"format": "waymark-map-bundle", "version": 2, "new": 1}"#;
        assert_eq!(
            refusal(packed([(MANIFEST, &later[..], PLAIN)])),
            (Fault::NewerFormat, MANIFEST.to_owned())
        );
        let other = br#"{"format": "another", "version": 1}"#;
        assert_eq!(
            refusal(packed([(MANIFEST, &other[..], PLAIN)])),
            (Fault::NotABundle, MANIFEST.to_owned())
        );
        assert_eq!(refusal(packed([("map.json", &b"{}"[..], PLAIN)])), (Fault::Missing, MANIFEST.to_owned()));
    }

    #[test]
    fn a_name_twice_is_refused() {
        let twice = packed([("map.json", &b"{}"[..], PLAIN), ("pam.json", &b"[]"[..], PLAIN)]);
        let (fault, _) = refusal(renamed(twice, b"pam.json", b"map.json"));
        assert_eq!(fault, Fault::BadPath);
    }

    #[test]
    fn a_file_that_claims_more_than_the_bundle_holds_is_refused() {
        let mut zip = packed([("map.json", &b"{}"[..], PLAIN)]);
        // In the list at the end: the packed and the whole size follow the checksum.
        let list = zip.windows(4).position(|bytes| bytes == b"PK\x01\x02").unwrap();
        for size in [list + 20, list + 24] {
            zip[size..size + 4].copy_from_slice(&(1_u32 << 30).to_le_bytes());
        }
        assert_eq!(refusal(zip), (Fault::TooLarge, "map.json".to_owned()));
    }

    #[test]
    fn a_file_that_is_not_what_the_manifest_says_is_refused_whatever_seal_and_checksum_say() {
        let digest =
            |bytes: &[u8]| FileDigest { bytes: bytes.len() as u64, sha256: hex(&Sha256::digest(bytes)) };
        let manifest = |of: &[u8]| {
            let files = BTreeMap::from([("map.json".to_owned(), digest(of))]);
            serde_json::to_vec(&Manifest::new("hall", files)).unwrap()
        };
        // The zip is written with the checksum of what it holds, and `refusal` seals it.
        for said in [&b"[]"[..], b"{ }"] {
            let manifest = manifest(said);
            let zip = packed([("map.json", &b"{}"[..], PLAIN), (MANIFEST, &manifest[..], PLAIN)]);
            assert_eq!(refusal(zip), (Fault::Damaged, "map.json".to_owned()));
        }
        let right = manifest(b"{}");
        let without = packed([(MANIFEST, &right[..], PLAIN)]);
        assert_eq!(refusal(without), (Fault::Missing, "map.json".to_owned()));
        let more = packed([
            ("map.json", &b"{}"[..], PLAIN),
            ("more.json", &b"{}"[..], PLAIN),
            (MANIFEST, &right[..], PLAIN),
        ]);
        assert_eq!(refusal(more), (Fault::BadPath, "more.json".to_owned()));
    }

    #[test]
    fn a_packed_file_is_refused() {
        let mut zip = packed([("map.json", &b"{}"[..], PLAIN)]);
        let list = zip.windows(4).position(|bytes| bytes == b"PK\x01\x02").unwrap();
        // Method 8, deflate, in front of the bytes and in the list.
        for method in [8, list + 10] {
            zip[method..method + 2].copy_from_slice(&8_u16.to_le_bytes());
        }
        assert_eq!(refusal(zip), (Fault::TooLarge, "map.json".to_owned()));
    }

    #[test]
    fn only_plain_names_are_files_of_a_bundle() {
        for (name, plain) in [
            ("map.json", true),
            ("pictures/ab-1.png", true),
            ("", false),
            ("/map.json", false),
            ("../map.json", false),
            ("pictures/../map.json", false),
            ("pictures//a.png", false),
            (".map.json", false),
            ("Map.json", false),
            ("a\\b", false),
            ("c:map.json", false),
            ("map.json\0", false),
        ] {
            assert_eq!(is_plain(name), plain, "{name:?}");
        }
        assert!(!is_plain(&"a".repeat(129)));
    }
}
