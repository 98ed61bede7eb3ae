//! The steps from an empty database to the present schema: the files of `migrations/`, compiled in.
//! Applied files are checksummed and never edited. A list and not `sqlx::migrate!`: the macro
//! builds SQLite a second time, for the compiler.

use sqlx::{
    SqlSafeStr as _,
    migrate::{Migration, MigrationType, Migrator},
};

/// Names and texts of files of `migrations/`.
macro_rules! files {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_str!(concat!("../../../../migrations/", $name, ".sql")))),*]
    };
}

/// Every file, `NUMBER_NAME`.
const FILES: &[(&str, &str)] = files![
    "0001_maps",
    "0002_landmarks",
    "0003_models",
    "0004_walls",
    "0005_robots",
    "0006_jobs",
    "0007_audit",
    "0008_history",
];

/// The steps in order.
pub(crate) fn migrator() -> Migrator {
    let step = |(name, sql): &(&'static str, &'static str)| {
        let (number, words) = name.split_once('_').unwrap_or((name, ""));
        // A name without a number is found by the test below.
        let version = number.parse().unwrap_or_default();
        Migration::new(
            version,
            words.replace('_', " ").into(),
            MigrationType::Simple,
            sql.into_sql_str(),
            false,
        )
    };
    Migrator::with_migrations(FILES.iter().map(step).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::{fs, path::Path};

    #[test]
    fn every_file_is_a_step_with_its_number() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../migrations");
        let mut files: Vec<String> = fs::read_dir(folder)
            .unwrap()
            .map(|file| file.unwrap().file_name().to_string_lossy().replace(".sql", ""))
            .collect();
        files.sort();
        assert_eq!(files, FILES.iter().map(|(name, _)| (*name).to_owned()).collect::<Vec<_>>());
        let migrator = migrator();
        let versions: Vec<i64> = migrator.iter().map(|step| step.version).collect();
        assert!(versions.is_sorted_by(|a, b| a < b) && versions[0] == 1, "{versions:?}");
    }
}
