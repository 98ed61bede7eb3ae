use crate::store::db;
use crate::{
    config::{Config, RawConfig},
    jobs::{Jobs, request::Request},
    publication::{Catalogue, CatalogueTasks},
    store::{
        landmarks::{self, LandmarkGeometry, ModelSummary, StoredPlace},
        maps,
        teaching::{self, Teaching},
        views::{NewView, QuadCrop},
    },
};
use engine::{picture, snapshot::MapSnapshot};
use serde_json::Value;
use sha2::{Digest as _, Sha256};
use std::{collections::BTreeMap, f64::consts::PI, sync::Arc, time::Duration};
use tokio::sync::watch;
use vision::{
    frame::GrayImage,
    geometry::Corners,
    learn::TrainingView,
    model::{LandmarkId, LandmarkModel},
    params::Params,
    pose::LandmarkSize,
    recognise::DistanceKind,
};

/// A map with a job runner.
struct School {
    store: Catalogue,
    jobs: Arc<Jobs>,
    _tasks: CatalogueTasks,
    _stop: watch::Sender<bool>,
    _data: tempfile::TempDir,
}

fn at(x_m: f64, theta_rad: f64) -> LandmarkGeometry {
    LandmarkGeometry {
        size: Some(LandmarkSize { width_m: 0.6, height_m: 0.8 }),
        place: Some(StoredPlace {
            x_m,
            y_m: 0.0,
            z_m: 1.5,
            theta_rad,
            roll_rad: 0.0,
            tilt_rad: 0.0,
            covariance: None,
        }),
        size_from_views: false,
    }
}

fn nowhere() -> LandmarkGeometry {
    LandmarkGeometry::default()
}

impl School {
    async fn open() -> Self {
        let data = tempfile::tempdir().unwrap();
        let raw = RawConfig { data: data.path().to_owned(), ..RawConfig::default() };
        let config = Arc::new(Config::try_from(raw).unwrap());
        let (store, tasks) = Catalogue::open(&config).await.unwrap();
        store.write(|tx| Box::pin(maps::create(tx, "a", DistanceKind::Both, 2))).await.unwrap();
        let (stop, stopping) = watch::channel(false);
        let (jobs, _) = Jobs::start(store.clone(), config, stopping).await.unwrap();
        Self { store, jobs, _tasks: tasks, _stop: stop, _data: data }
    }

    async fn add(&self, name: &'static str, geometry: &LandmarkGeometry) {
        let geometry = *geometry;
        let write = self.store.write(move |tx| Box::pin(landmarks::create(tx, "a", name, geometry, 9)));
        write.await.unwrap();
    }

    /// Adds a photograph of poster `seed`; `stain` paints a corner of it over.
    async fn teach(&self, landmark: &str, seed: u64, stain: bool) {
        let texture = sim::posters::poster_of_size(seed, 260, 1.0);
        let image = GrayImage::from_fn(texture.width(), texture.height(), |u, v| {
            if stain && u > 220 && v > 220 { 90 } else { texture.data()[v * texture.width() + u] }
        });
        let corners =
            Corners::try_from([[20.0, 20.0], [240.0, 24.0], [236.0, 238.0], [24.0, 232.0]]).unwrap();
        let icon = TrainingView::photographed(&image, &corners, &Params::default()).unwrap().icon;
        let bytes = picture::png(image.width(), image.height(), image.data()).unwrap();
        let view = NewView {
            image_sha256: Sha256::digest(&bytes).into(),
            image: bytes,
            image_kind: "png",
            size_px: [image.width(), image.height()],
            crop: QuadCrop { corners_px: corners, icon },
            distractors: vec![],
            capture: None,
        };
        let (map, landmark) = ("a".to_owned(), landmark.to_owned());
        let teaching = Teaching { map, landmark, view, max: 9, novelty: None, size: None, create: None };
        teaching::add(&self.store, teaching).await.unwrap();
    }

    /// Trains these landmarks, or all; the result of the job.
    async fn learn(&self, names: &[&str]) -> Value {
        let names: Vec<String> = names.iter().map(|n| (*n).to_owned()).collect();
        let landmarks = (!names.is_empty()).then_some(names);
        let request = Request { landmarks, ..Request::default() };
        let id = self.jobs.submit("a", &request).await.unwrap().id;
        for _ in 0..6_000 {
            let (row, _) = self.jobs.get(id).await.unwrap();
            if row.state == "done" {
                return serde_json::from_str(&row.result.unwrap()).unwrap();
            }
            assert!(["queued", "running"].contains(&row.state.as_str()), "{row:?}");
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
        panic!("the job does not end");
    }

    async fn model(&self, name: &str) -> ModelSummary {
        landmarks::get(self.store.reads(), "a", name).await.unwrap().model.unwrap()
    }

    /// Whether each is in use, and the landmark that it is refused for.
    async fn states(&self, names: &[&str]) -> Vec<(bool, Option<String>)> {
        let mut states = Vec::new();
        for name in names {
            let model = self.model(name).await;
            let other = model.looks_like.map(|text| serde_json::from_str::<Value>(&text).unwrap());
            states.push((model.active, other.map(|o| o["landmark"].as_str().unwrap().to_owned())));
        }
        states
    }

    fn snapshot(&self) -> Arc<MapSnapshot> {
        self.store.snapshots().get("a").unwrap()
    }

    /// The landmarks that are matched, with their models.
    fn matched(&self) -> BTreeMap<String, LandmarkModel> {
        let map = self.snapshot();
        let name = |id: &LandmarkId| map.landmarks[id].name.clone();
        map.models.iter().map(|m| (name(&m.id), LandmarkModel::clone(m))).collect()
    }
}

const IN_USE: (bool, Option<String>) = (true, None);

fn refused_for(other: &str) -> (bool, Option<String>) {
    (false, Some(other.to_owned()))
}

#[tokio::test]
async fn a_landmark_that_looks_like_an_active_one_is_refused_and_that_one_stays_as_it_is() {
    let school = School::open().await;
    // Made before the active one, and taught after it: the one in use stays.
    for name in ["later", "first", "other"] {
        school.add(name, &nowhere()).await;
    }
    school.teach("first", 1, false).await;
    school.teach("other", 2, false).await;
    school.learn(&[]).await;
    let before = school.matched();
    assert_eq!(before.keys().collect::<Vec<_>>(), ["first", "other"]);

    school.teach("later", 1, true).await;
    let result = school.learn(&["later"]).await;
    assert_eq!((&result["active"], &result["inactive"][0]), (&0.into(), &"later".into()), "{result}");
    let refused = &result["refused"][0];
    assert_eq!((&refused["landmark"], &refused["other"]), (&"later".into(), &"first".into()), "{result}");
    assert!(refused["gradient_similarity"].as_f64().is_some_and(|s| s > 0.7 && s < 1.0), "{result}");
    assert_eq!(school.states(&["first", "later"]).await, [IN_USE, refused_for("first")]);
    assert_eq!(school.matched(), before, "models and thresholds are those of before");

    // Nor does it harm when others are learnt, or all again.
    school.learn(&["first"]).await;
    assert_eq!(school.states(&["first", "later"]).await, [IN_USE, refused_for("first")]);
    school.learn(&[]).await;
    assert_eq!(school.states(&["first", "later", "other"]).await, [IN_USE, refused_for("first"), IN_USE]);
    assert_eq!(school.matched()["first"].likeness, before["first"].likeness);

    // Learnt again without the other one, it is in use.
    school.store.write(|tx| Box::pin(landmarks::delete(tx, "a", "first"))).await.unwrap();
    assert_eq!(school.matched().keys().collect::<Vec<_>>(), ["other"]);
    school.learn(&["later"]).await;
    assert_eq!(school.states(&["later", "other"]).await, [IN_USE, IN_USE]);
}

#[tokio::test]
async fn of_two_look_alikes_in_one_lesson_the_older_stays() {
    let school = School::open().await;
    for (name, stain) in [("older", false), ("newer", true), ("newest", false)] {
        school.add(name, &nowhere()).await;
        school.teach(name, 1, stain).await;
    }
    school.learn(&[]).await;
    let states = school.states(&["older", "newer", "newest"]).await;
    assert_eq!(states, [IN_USE, refused_for("older"), refused_for("older")]);
}

#[tokio::test]
async fn look_alikes_at_different_places_are_a_class_that_a_pose_tells_apart() {
    let school = School::open().await;
    school.add("door-1", &at(1.0, 0.0)).await;
    // Behind it on the other side of the wall, and elsewhere on the same.
    school.add("door-2", &at(1.0, PI)).await;
    school.add("door-3", &at(5.0, 0.0)).await;
    // Perhaps the same object once more.
    school.add("copy", &at(1.1, 0.1)).await;
    school.add("unplaced", &nowhere()).await;
    let doors = ["door-1", "door-2", "door-3"];
    for name in doors {
        school.teach(name, 1, false).await;
    }
    school.learn(&[]).await;
    assert_eq!(school.states(&doors).await, [(false, None), (false, None), (false, None)]);

    for (name, others) in [("copy", "door-1"), ("unplaced", "door-1")] {
        school.teach(name, 1, true).await;
        school.learn(&[name]).await;
        let state = school.states(&[name]).await.remove(0);
        assert!(!state.0 && state.1.is_some_and(|o| doors.contains(&o.as_str())), "{name}, like {others}");
    }
    assert_eq!(school.states(&doors).await, [(false, None), (false, None), (false, None)]);
    // Names by a known pose wait for the classes: they are derived after the commit.
    for _ in 0..2_000 {
        if !school.snapshot().pending.look_alikes {
            break;
        }
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    let map = school.snapshot();
    let in_class: Vec<&str> =
        map.look_alikes.classes.keys().map(|id| map.landmarks[id].name.as_str()).collect();
    assert_eq!(in_class, doors);
    assert!(map.look_alikes.classes.values().all(|members| members.len() == 3));
}

/// Landmark, digest, thresholds and all else of every stored model of the map, and whether its
/// bytes have that digest.
async fn stored_models(school: &School) -> Vec<String> {
    let sql = "SELECT quote(m.landmark_id) || quote(m.sha256) || quote(m.params_hash) || m.active || m.reasons || m.facts || \
               m.views || m.generated_views || m.learnt_ms || quote(m.looks_like) || quote(c.bytes) FROM models m \
               JOIN model_contents c ON c.sha256 = m.sha256 ORDER BY m.landmark_id";
    db::query_scalar(sql).fetch_all(school.store.reads()).await.unwrap()
}

#[tokio::test]
async fn a_wrong_view_is_undone_with_the_thresholds_of_all_others() {
    use crate::store::history::{newest, roll_back, undo};
    let school = School::open().await;
    for (name, seed) in [("a", 1), ("b", 2), ("c", 3)] {
        school.add(name, &nowhere()).await;
        school.teach(name, seed, false).await;
    }
    school.learn(&[]).await;
    let good = newest(school.store.reads(), 1).await.unwrap();
    let (models, matched) = (stored_models(&school).await, school.matched());
    assert_eq!(matched.len(), 3);

    // A view of another poster, which looks like that of b: a is learnt, and b and c get its icons
    // as negatives.
    school.teach("a", 2, true).await;
    school.learn(&["a"]).await;
    let spoilt = stored_models(&school).await;
    assert!(spoilt.iter().zip(&models).all(|(now, was)| now != was), "every model of the map is another");
    let lesson = newest(school.store.reads(), 1).await.unwrap();

    let back = |to: i64| school.store.write(move |tx| Box::pin(roll_back(tx, "a", to)));
    assert!(back(good).await.unwrap());
    assert!(stored_models(&school).await == models, "byte for byte");
    assert_eq!(school.matched(), matched, "and so is what robots are answered with");
    // Forth, and back without the lesson alone: the view stays.
    assert!(back(lesson).await.unwrap());
    assert!(stored_models(&school).await == spoilt);
    let again = newest(school.store.reads(), 1).await.unwrap();
    school.store.write(move |tx| Box::pin(undo(tx, "a", again))).await.unwrap();
    assert!(stored_models(&school).await == models);
    assert_eq!(school.matched(), matched);
}
