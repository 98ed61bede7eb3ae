//! The statements against the schema.

use super::*;
use sqlx::{Executor, SqlSafeStr};

#[tokio::test]
async fn every_statement_prepares_on_the_migrated_schema() {
    let dir = tempfile::tempdir().unwrap();
    let mut opened = open::open(dir.path(), None).await.unwrap();
    let all = [
        maps::ALL,
        robot_certificates::ALL,
        map_locations::ALL,
        visibility_settings::ALL,
        visibility_areas::ALL,
        landmarks::ALL,
        copies::ALL,
        integrity::ALL,
        schema::ALL,
        derived_schema::ALL,
        pictures::ALL,
        views::ALL,
        aspect_views::ALL,
        models::ALL,
        walls::ALL,
        underlays::ALL,
        landmark_learning::ALL,
        landmark_merge::ALL,
        landmark_placement::ALL,
        teaching::ALL,
        gatherings::ALL,
        track_acceptance::ALL,
        modality_stats::ALL,
        robots::ALL,
        tokens::ALL,
        jobs::ALL,
        kept_answers::ALL,
        audit::ALL,
        stored_answers::ALL,
        page_sessions::ALL,
        refused_views::ALL,
        revisions::ALL,
        map_rows::ALL,
    ];
    for (name, sql) in
        all.into_iter().chain(history::EVERY).chain(contents::EVERY).chain(drafts::EVERY).flatten()
    {
        if let Err(error) = opened.writer.prepare(sql.into_sql_str()).await {
            panic!("{name}: {error}");
        }
    }
}
