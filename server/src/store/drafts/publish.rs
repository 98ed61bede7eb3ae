//! Publishes a draft: what it has changed of its map, by one commit of the map, and the draft is
//! gone. All of it or nothing, in one transaction. What the draft has not changed is not touched,
//! so it stays byte for byte.

use super::{
    Both, both,
    merge::{Merge, merge},
    rows::{Owner, RowKey, crop_key, rows, run_key},
};
use crate::store::db;
use crate::{
    config::Limits,
    store::{
        CommittedChange, Store, StoreError, Tx,
        contents::{self, LandmarkContents, MapContents, Numbers},
        history,
        kind::Kind,
        landmark_learning, landmarks, map_locations,
        map_locations::MapLocation,
        maps::{self, MapRow},
        modality_stats,
        revisions::{self, Precondition, Subject},
        statements::statements,
        teaching::{ATTEMPTS, computed},
        underlays, views, walls, within,
    },
};
use std::collections::{BTreeMap, BTreeSet};
use vision::model::LandmarkId;

statements! {
    REMOVE_LANDMARK = "DELETE FROM landmarks WHERE id = $1";
    // Names may have been exchanged; no name begins so.
    SET_ASIDE = "UPDATE landmarks SET name = '~' || id WHERE id = $1";
    RENAME = "UPDATE landmarks SET name = $2 WHERE id = $1";
    HEALTH = "UPDATE landmarks SET health = $2, finding = $3 WHERE id = $1";
    REMOVE_VIEW = "DELETE FROM views WHERE landmark_id = $1 AND image_sha256 = $2 AND corners_px = $3";
    REMOVE_MODEL = "DELETE FROM models WHERE landmark_id = $1";
    REMOVE_DISTRACTOR = "DELETE FROM strangers WHERE map_id = $1 AND image_sha256 = $2 AND corners_px = $3";
    REMOVE_RUN = "DELETE FROM runs WHERE id = (SELECT id FROM runs WHERE map_id = $1 AND robot = $2 AND created_ms = $3 \
                  AND cells = $4 ORDER BY id LIMIT 1)";
    REMOVE_UNDERLAY = "DELETE FROM underlays WHERE map_id = $1";
    COUNT_LANDMARKS = "SELECT count(*) FROM landmarks WHERE map_id = $1";
    MOST_VIEWS = "SELECT coalesce(max(n), 0) FROM (SELECT count(*) AS n FROM views v JOIN landmarks l ON l.id = v.landmark_id \
                  WHERE l.map_id = $1 GROUP BY l.id) AS c";
    COUNT_RUNS = "SELECT count(*) FROM runs WHERE map_id = $1";
}

/// Publishes a draft; says whether that changed anything of the map. `is` is the revision of the
/// map that it is meant for. Errors: `NotFound`, `ChangedMeanwhile`; `Conflicts` where both sides
/// have changed the same; `InUse` while a job works on either, `Limit`; `Busy` while others keep
/// changing them.
pub(crate) async fn publish(
    store: &Store,
    (map, draft): (&str, &str),
    is: &Precondition,
    limits: &Limits,
) -> Result<bool, StoreError> {
    let _turn = store.preparing().await;
    for _ in 0..ATTEMPTS {
        let both = both(store, map, draft).await?;
        // Beside the writer: every icon is hashed.
        let merged = computed(store, "a draft", move || (merge(&both), both)).await?;
        let (is, limits) = (is.clone(), limits.clone());
        let written = store.write(move |tx| Box::pin(async move { write(tx, merged, &is, &limits).await }));
        match written.await {
            Err(StoreError::Changed) => {}
            done => return done,
        }
    }
    Err(StoreError::Busy)
}

/// The publication of what was compared. Errors: `Changed` if that is the present state no more.
pub(super) async fn write(
    tx: &mut Tx,
    (merge, both): (Merge, Both),
    is: &Precondition,
    limits: &Limits,
) -> Result<bool, StoreError> {
    let (map, draft) = (&both.map.0, &both.draft.0);
    revisions::check(tx, &map.name, &Subject::Map, is).await?;
    for row in [map, draft] {
        history::no_job_on(tx, row).await?;
        if maps::recheck(tx, row.clone()).await?.revision != row.revision {
            return Err(StoreError::Changed);
        }
    }
    if !merge.conflicts.is_empty() {
        return Err(StoreError::Conflicts { draft: draft.name.clone(), with: merge.conflicts });
    }
    tx.author.why.get_or_insert_with(|| format!("publish draft {}", draft.name));
    Publication::new(&both, &merge.changes).apply(tx).await?;
    check(tx, map, limits).await?;
    if !merge.changes.is_empty() {
        maps::bump(tx, map.id).await?;
        tx.changed(CommittedChange::Links);
    }
    maps::delete(tx, &draft.name).await?;
    Ok(!merge.changes.is_empty())
}

/// The bounds of a map hold for one that two have added to.
async fn check(tx: &mut Tx, map: &MapRow, limits: &Limits) -> Result<(), StoreError> {
    for (sql, max, what) in [
        (COUNT_LANDMARKS, limits.landmarks, "landmarks in a map"),
        (MOST_VIEWS, limits.views, "views of a landmark"),
        (COUNT_RUNS, modality_stats::MAX_RUNS, "runs"),
    ] {
        let count = db::query_scalar(sql).bind(map.id).fetch_one(&mut tx.conn).await;
        within(count.map_err(StoreError::during("count what is published"))?, max, what)?;
    }
    Ok(())
}

/// What is taken from a draft, and where it goes.
struct Publication<'a> {
    map: &'a MapRow,
    changes: &'a BTreeSet<RowKey>,
    old: &'a MapContents,
    new: &'a MapContents,
    in_map: BTreeMap<Owner, &'a LandmarkContents>,
    in_draft: BTreeMap<Owner, &'a LandmarkContents>,
    /// Rows that the map has.
    there: BTreeSet<RowKey>,
    /// From the draft's numbers to the map's.
    numbers: Numbers,
}

impl<'a> Publication<'a> {
    fn new(both: &'a Both, changes: &'a BTreeSet<RowKey>) -> Self {
        let (old, new) = (&both.map.1, &both.draft.1);
        Self {
            map: &both.map.0,
            changes,
            old,
            new,
            in_map: old.landmarks.iter().map(|l| (Owner::Of(l.number), l)).collect(),
            in_draft: new.landmarks.iter().map(|l| (both.owner(l.number), l)).collect(),
            there: rows(old, Owner::Of).into_keys().collect(),
            numbers: both.of.clone(),
        }
    }

    async fn apply(mut self, tx: &mut Tx) -> Result<(), StoreError> {
        self.landmarks(tx).await?;
        self.views(tx).await?;
        self.models(tx).await?;
        self.distractors(tx).await?;
        self.runs(tx).await?;
        self.settings(tx).await?;
        if self.changes.contains(&RowKey::Walls) {
            walls::replace(tx, &self.map.name, &self.new.walls).await?;
        }
        if self.changes.contains(&RowKey::Underlay) {
            match &self.new.underlay {
                Some(underlay) => underlays::insert(tx, self.map.id, underlay).await?,
                None => self.run(tx, REMOVE_UNDERLAY).await?,
            }
        }
        Ok(())
    }

    async fn run(&self, tx: &mut Tx, sql: &'static str) -> Result<(), StoreError> {
        let done = db::query(sql).bind(self.map.id).execute(&mut tx.conn).await;
        done.map_err(StoreError::during("publish")).map(drop)
    }

    /// Removes, changes and adds landmarks, in this order: nothing meets a name that is to go.
    async fn landmarks(&mut self, tx: &mut Tx) -> Result<(), StoreError> {
        let at = || StoreError::during("publish a landmark");
        let owners = self.changes.iter().filter_map(|key| match key {
            RowKey::Landmark(owner) => Some(*owner),
            _ => None,
        });
        let pairs: Vec<_> =
            owners.map(|o| (self.in_map.get(&o).copied(), self.in_draft.get(&o).copied())).collect();
        for (old, new) in &pairs {
            let Some(old) = old else { continue };
            let sql = match new {
                None => REMOVE_LANDMARK,
                Some(new) if new.name != old.name => SET_ASIDE,
                Some(_) => continue,
            };
            db::query(sql).bind(old.number.0 as i64).execute(&mut tx.conn).await.map_err(at())?;
        }
        for (old, new) in pairs {
            match (old, new) {
                (Some(old), Some(new)) => change(tx, old, new).await?,
                (None, Some(new)) => {
                    let number = contents::landmark(tx, self.map.id, new).await?;
                    self.numbers.insert(new.number, number);
                }
                (_, None) => {}
            }
        }
        Ok(())
    }

    /// The number in the map of a landmark that is there after the publication.
    fn number(&self, owner: Owner) -> Option<LandmarkId> {
        match owner {
            Owner::Of(number) => Some(number),
            Owner::New(own) => self.numbers.get(&own).copied(),
        }
    }

    async fn views(&self, tx: &mut Tx) -> Result<(), StoreError> {
        for key in self.changes {
            let RowKey::View(owner, crop) = key else { continue };
            let find = |of: Option<&&'a LandmarkContents>| {
                of.and_then(|l| l.views.iter().find(|view| crop_key(&view.crop) == *crop))
            };
            let Some(number) = self.number(*owner) else { continue };
            if let Some(old) = find(self.in_map.get(owner)) {
                let removed = db::query(REMOVE_VIEW)
                    .bind(number.0 as i64)
                    .bind(&old.crop.image_sha256[..])
                    .bind(views::point_bytes(&old.crop.corners_px));
                removed.execute(&mut tx.conn).await.map_err(StoreError::during("publish a view"))?;
            }
            if let Some(new) = find(self.in_draft.get(owner)) {
                contents::view(tx, number, new).await?;
            }
        }
        Ok(())
    }

    async fn models(&self, tx: &mut Tx) -> Result<(), StoreError> {
        for key in self.changes {
            let RowKey::Model(owner) = key else { continue };
            let Some(number) = self.number(*owner) else { continue };
            if let Some(model) = self.in_draft.get(owner).and_then(|l| l.model.as_ref()) {
                let model = contents::in_other_map(model, number, &self.numbers);
                contents::model(tx, number, &model).await?;
            } else {
                let done = db::query(REMOVE_MODEL).bind(number.0 as i64).execute(&mut tx.conn).await;
                done.map_err(StoreError::during("publish a model"))?;
            }
        }
        Ok(())
    }

    /// Rows that are told apart by a digest: those that go, those that come.
    fn moved<T>(&self, old: &'a [T], new: &'a [T], key: impl Fn(&T) -> RowKey) -> (Vec<&'a T>, Vec<&'a T>) {
        let goes = |row: &&T| self.changes.contains(&key(row));
        let comes = |row: &&T| goes(row) && !self.there.contains(&key(row));
        (old.iter().filter(goes).collect(), new.iter().filter(comes).collect())
    }

    async fn distractors(&self, tx: &mut Tx) -> Result<(), StoreError> {
        let key = |d: &contents::DistractorContents| RowKey::Distractor(crop_key(&d.crop));
        let (gone, new) = self.moved(&self.old.distractors, &self.new.distractors, key);
        for each in gone {
            let removed = db::query(REMOVE_DISTRACTOR)
                .bind(self.map.id)
                .bind(&each.crop.image_sha256[..])
                .bind(views::point_bytes(&each.crop.corners_px));
            removed.execute(&mut tx.conn).await.map_err(StoreError::during("publish a distractor"))?;
        }
        for each in new {
            contents::distractor(tx, self.map.id, &each.crop).await?;
        }
        Ok(())
    }

    async fn runs(&self, tx: &mut Tx) -> Result<(), StoreError> {
        let key = |run: &contents::RunContents| RowKey::Run(run_key(run));
        let (gone, new) = self.moved(&self.old.reference_runs, &self.new.reference_runs, key);
        for run in gone {
            let removed = db::query(REMOVE_RUN)
                .bind(self.map.id)
                .bind(&run.robot)
                .bind(run.created_ms)
                .bind(&run.cells);
            removed.execute(&mut tx.conn).await.map_err(StoreError::during("publish a run"))?;
        }
        for run in new {
            contents::run(tx, self.map.id, run).await?;
        }
        Ok(())
    }

    async fn settings(&self, tx: &mut Tx) -> Result<(), StoreError> {
        let is = |word: &'static str| self.changes.contains(&RowKey::Setting(word));
        let (old, new) = (&self.old.settings, &self.new.settings);
        if ["site", "building", "floor", "parent"].into_iter().any(is) {
            let take = |word, draft: &Option<String>, map: &Option<String>| {
                if is(word) { draft.clone() } else { map.clone() }
            };
            let (draft, map) = (&new.location, &old.location);
            let location = MapLocation {
                site: take("site", &draft.site, &map.site),
                building: take("building", &draft.building, &map.building),
                floor: take("floor", &draft.floor, &map.floor),
                link: if is("parent") { draft.link.clone() } else { map.link.clone() },
            };
            map_locations::set(tx, &self.map.name, |_| location).await?;
        }
        let mut after = old.clone();
        if is("pipeline") {
            after.pipeline = new.pipeline;
        }
        if is("learning") {
            after.learning.clone_from(&new.learning);
        }
        if is("fusion_mode") {
            after.fusion_mode = new.fusion_mode;
        }
        if is("areas") {
            after.areas.clone_from(&new.areas);
        }
        if is("visibility_settings") {
            after.visibility.clone_from(&new.visibility);
        }
        if after == *old { Ok(()) } else { contents::settings(tx, self.map.id, &after).await }
    }
}

/// Gives a landmark the name, size, place and gates that it has in the draft. A finding stays with
/// the place that it is about.
async fn change(tx: &mut Tx, old: &LandmarkContents, new: &LandmarkContents) -> Result<(), StoreError> {
    let id = old.number.0 as i64;
    landmarks::set_geometry(tx, id, &new.geometry).await?;
    landmark_learning::put(tx, id, new.learning.as_deref()).await?;
    if old.geometry != new.geometry {
        let health = landmarks::health_word(new.health);
        let done = db::query(HEALTH).bind(id).bind(health).bind(&new.finding).execute(&mut tx.conn).await;
        done.map_err(StoreError::during("publish a landmark"))?;
    }
    let renamed = db::query(RENAME).bind(id).bind(&new.name).execute(&mut tx.conn).await;
    renamed.map_err(StoreError::inserting("publish a landmark", Kind::Landmark, &new.name)).map(drop)
}
