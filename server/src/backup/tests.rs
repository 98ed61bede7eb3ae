mod stores;

use super::*;
use crate::{
    publication::{Catalogue, CatalogueTasks, tests::config},
    store::{
        landmark_placement::tests::seen_from,
        landmarks::{self, LandmarkGeometry},
        maps, open,
        schema::known_schema,
        teaching::{self, Teaching},
        views::NewView,
        walls,
    },
};
use sqlx::{ConnectOptions as _, Connection as _, sqlite::SqliteConnectOptions};
use std::sync::atomic::{AtomicBool, Ordering};
use vision::recognise::DistanceKind;

/// A picture that is easily found in a file.
const PICTURE: &[u8] = &[0x5a; 20_000];

/// Map `a` with a wall and a landmark that has a view.
async fn store(dir: &Path) -> (Catalogue, CatalogueTasks) {
    let (store, tasks) = Catalogue::open(&config(dir)).await.unwrap();
    store.write(|tx| Box::pin(maps::create(tx, "a", DistanceKind::Both, 2))).await.unwrap();
    store.write(|tx| Box::pin(walls::replace(tx, "a", &[[0.0, 0.0, 6.3, 0.0]]))).await.unwrap();
    add(&store, 0).await;
    let image = PICTURE.to_vec();
    let view =
        NewView { image_sha256: pictures::digest(&image), image, capture: None, ..seen_from(1.0, 1, 0.0) };
    let (map, landmark) = ("a".to_owned(), "l0".to_owned());
    let teaching = Teaching { map, landmark, view, max: 9, novelty: None, size: None, create: None };
    teaching::add(&store, teaching).await.unwrap();
    (store, tasks)
}

async fn add(store: &Catalogue, number: usize) {
    let (name, none) = (format!("l{number}"), LandmarkGeometry::default());
    let added = store.write(move |tx| {
        Box::pin(async move { landmarks::create(tx, "a", &name, none, 2000).await.map(drop) })
    });
    added.await.unwrap();
}

/// The digests of what is committed.
async fn committed(store: &Catalogue) -> copies::Contents {
    copies::contents(&mut store.reads().acquire().await.unwrap()).await.unwrap()
}

fn backups(dir: &Path, settings: BackupSettings) -> Arc<Backups> {
    let config = Config { backup: settings, ..config(dir) };
    let (stop, stopping) = watch::channel(false);
    let (backups, _task) = Backups::start(&config, Default::default(), stopping);
    drop(stop);
    backups
}

/// Makes a backup and returns its file.
async fn made(backups: &Arc<Backups>) -> PathBuf {
    let (backup, task) = backups.begin().unwrap();
    assert!(matches!(backups.begin(), Err(StoreError::InUse(_))), "one at a time");
    task.await.unwrap();
    let ended = backups.get(&backup.name).unwrap();
    assert_eq!((ended.state, &ended.reason), (BackupState::Complete, &None));
    backups.file(&backup.name).unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_backup_during_writes_restores_to_a_state_that_was_committed() {
    let (dir, other) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let (store, _tasks) = store(dir.path()).await;
    let backups = backups(dir.path(), BackupSettings::default());
    let goes_on = Arc::new(AtomicBool::new(true));
    let writer = tokio::spawn({
        let (store, goes_on) = (store.clone(), goes_on.clone());
        async move {
            let mut states = vec![committed(&store).await];
            for number in 1.. {
                if !goes_on.load(Ordering::Relaxed) {
                    break;
                }
                add(&store, number).await;
                states.push(committed(&store).await);
            }
            states
        }
    });
    let mut files = Vec::new();
    for _ in 0..3 {
        files.push(made(&backups).await);
    }
    goes_on.store(false, Ordering::Relaxed);
    let states = writer.await.unwrap();
    assert!(states.len() > 3, "too little was written meanwhile: {}", states.len());
    for file in &files {
        let (manifest, _) = archive::read(file).unwrap();
        let wanted = copies::Contents { pictures: 0, ..manifest.contents.clone() };
        assert!(states.contains(&wanted), "never committed: {wanted:?}");
        assert_eq!((manifest.contents.pictures, manifest.faults.len()), (1, 0));

        let verified = verify(file).await.unwrap();
        let stopped = StoppedServer::of(other.path()).unwrap();
        let had_data = stopped.has_data();
        let replaced = stopped.restore(&verified).unwrap();
        drop(stopped);
        assert_eq!(replaced.is_some_and(|folder| folder.join(open::FILE).exists()), had_data);
        let (restored, tasks) = Catalogue::open(&config(other.path())).await.unwrap();
        assert_eq!(committed(&restored).await, wanted);
        let picture = crate::store::pictures::read(&restored, &pictures::digest(PICTURE)).await;
        assert_eq!(picture.unwrap(), PICTURE);
        tasks.close().await;
    }
}

/// What is said of a backup with this byte changed.
async fn flipped(file: &Path, at: usize) -> String {
    let mut bytes = fs::read(file).unwrap();
    bytes[at] ^= 0x10;
    let changed = file.with_extension("changed");
    fs::write(&changed, bytes).unwrap();
    match verify(&changed).await {
        Err(error @ RestoreError::Damaged { .. }) => error.to_string(),
        other => panic!("byte {at} changed: {other:?}"),
    }
}

fn find(bytes: &[u8], what: &[u8]) -> usize {
    bytes.windows(what.len()).position(|window| window == what).expect("it is in the file")
}

#[tokio::test(flavor = "multi_thread")]
async fn a_changed_byte_is_refused_wherever_it_is_and_what_it_damages_is_named() {
    let dir = tempfile::tempdir().unwrap();
    let (_store, _tasks) = store(dir.path()).await;
    let file = made(&backups(dir.path(), BackupSettings::default())).await;
    verify(&file).await.unwrap();
    let bytes = fs::read(&file).unwrap();
    let said = flipped(&file, find(&bytes, &PICTURE[..4000]) + 2000).await;
    assert!(said.contains("the picture of view 1 of landmark l0, map a"), "{said}");
    let wall = find(&bytes, &6.3_f64.to_be_bytes());
    let said = flipped(&file, wall + 3).await;
    assert!(said.contains("walls of map a differ"), "{said}");
    let said = flipped(&file, find(&bytes, b"database_sha256")).await;
    assert!(said.contains("the manifest is damaged"), "{said}");
    for at in (0..bytes.len()).step_by(bytes.len() / 60).chain(bytes.len() - 64..bytes.len()) {
        flipped(&file, at).await;
    }
    let cut = file.with_extension("cut");
    fs::write(&cut, &bytes[..bytes.len() - 100]).unwrap();
    assert!(matches!(verify(&cut).await, Err(RestoreError::Damaged { .. })));
    fs::write(&cut, b"no backup").unwrap();
    assert!(matches!(verify(&cut).await, Err(RestoreError::Damaged { .. })));
    assert!(matches!(verify(&dir.path().join("nothing")).await, Err(RestoreError::File { .. })));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_backup_of_a_newer_schema_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let (_store, _tasks) = store(dir.path()).await;
    let file = dir.path().join("newer");
    copies::copy(dir.path(), &file).await.unwrap();
    let mut newer = SqliteConnectOptions::new().filename(&file).connect().await.unwrap();
    let step = "INSERT INTO _sqlx_migrations (version, description, success, checksum, execution_time) \
                VALUES (9999, 'later', true, x'00', 0)";
    sqlx::raw_sql(step).execute(&mut newer).await.unwrap();
    newer.close().await.unwrap();
    let (contents, faults) = copies::examine(&file).await.unwrap();
    let database_sha256 = archive::digest_of(&file, fs::metadata(&file).unwrap().len()).unwrap();
    let manifest = Manifest { created_ms: 0, program: "9.0.0".into(), database_sha256, contents, faults };
    archive::finish(&file, &manifest).unwrap();
    match verify(&file).await {
        Err(RestoreError::Newer { found: 9999, known }) => assert_eq!(known, known_schema()),
        other => panic!("{other:?}"),
    }
}

#[tokio::test]
async fn the_data_of_a_running_server_is_not_replaced() {
    let dir = tempfile::tempdir().unwrap();
    let (_store, tasks) = store(dir.path()).await;
    let refused = StoppedServer::of(dir.path());
    assert!(matches!(&refused, Err(RestoreError::Directory(error)) if error.to_string().contains("stop it")));
    tasks.close().await;
    assert!(StoppedServer::of(dir.path()).unwrap().has_data());
}

#[tokio::test(flavor = "multi_thread")]
async fn the_newest_backups_stay_and_a_failed_one_is_told() {
    let dir = tempfile::tempdir().unwrap();
    let (store, _tasks) = store(dir.path()).await;
    let folder = dir.path().join("backups");
    fs::create_dir(&folder).unwrap();
    fs::write(folder.join("20260101-000000.part"), "half").unwrap();
    fs::write(folder.join("notes.waymark"), "not ours").unwrap();
    let backups = backups(dir.path(), BackupSettings { every_hours: 0, keep: 2 });
    assert_eq!(backups.health().newest, None);
    let mut files = Vec::new();
    for _ in 0..3 {
        files.push(made(&backups).await);
    }
    let left: Vec<_> = backups.list().iter().map(|backup| backups.file(&backup.name).unwrap()).collect();
    assert_eq!(left, files[1..]);
    assert!(!folder.join("20260101-000000.part").exists() && folder.join("notes.waymark").exists());
    let newest = backups.health().newest.unwrap();
    assert!(files[2].ends_with(format!("{newest}.waymark")));
    assert!(matches!(backups.file("../waymark"), Err(StoreError::NotFound { .. })));

    // The folder has become a file.
    backups.delete(&newest).unwrap();
    assert!(backups.health().newest.is_some_and(|name| name < newest));
    fs::rename(&folder, dir.path().join("away")).unwrap();
    fs::write(&folder, "").unwrap();
    let (backup, task) = backups.begin().unwrap();
    task.await.unwrap();
    let failed = backups.get(&backup.name).unwrap();
    assert!(failed.state == BackupState::Failed && failed.reason.is_some(), "{failed:?}");
    assert_eq!(backups.health().failed, failed.reason);
    // Another write is not in the way, and the next backup is made.
    add(&store, 5).await;
    fs::remove_file(&folder).unwrap();
    made(&backups).await;
    assert_eq!(backups.health().failed, None);
}
