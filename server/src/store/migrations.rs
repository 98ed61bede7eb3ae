//! The steps from an empty database to the present schema: the files of `migrations/`, compiled in. Applied files are
//! checksummed and never edited. A list and not `sqlx::migrate!`: the macro builds SQLite a second time, for the compiler.

use sqlx::{
    SqlSafeStr as _,
    migrate::{Migration, MigrationType, Migrator},
};

/// Names and texts of files of `migrations/`.
macro_rules! files {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_str!(concat!("../../../migrations/", $name, ".sql")))),*]
    };
}

/// Every file, `NUMBER_NAME`.
const FILES: &[(&str, &str)] = files![
    "0001_initial",
    "0002_placing",
    "0005_standing",
    "0006_gathering",
    "0007_sites",
    "0008_areas",
    "0010_sight",
    "0011_prepared",
    "0012_points",
    "0013_health",
    "0014_looks_like",
    "0015_underlay",
    "0016_pictures",
    "0017_tokens",
    "0018_idempotency",
    "0019_revisions",
    "0020_robot_certificates",
    "0021_model_contents",
    "0022_history",
    "0023_commits",
    "0025_stored_answers",
    "0030_audit",
    "0031_wall_covariance",
    "0032_visibility_areas",
    "0033_drafts",
    "0035_job_times",
    "0036_answer_basis",
    "0037_refused_views",
    "0038_page_sessions",
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
        // As databases of earlier builds have it: a checksum of the text alone.
        let first = migrator.iter().next().unwrap();
        assert_eq!((first.description.as_ref(), first.checksum.len()), ("initial", 48));
    }
}
