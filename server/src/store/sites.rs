//! Where maps belong (site, building, floor: words for people) and how they lie to each other (for poses).

use super::{Change, StoreError, Tx, maps, statements::statements};
use map::{
    map_links::{self, MapLink, MapLinks},
    pose2::{Pose2, Pose2Covariance},
};
use nalgebra::Matrix3;
use sqlx::{Row, SqliteExecutor, sqlite::SqliteRow};
use std::collections::BTreeMap;

statements! {
    EACH = "SELECT m.name, m.site, m.building, m.floor, p.name AS parent, m.parent_from_map FROM maps m \
            LEFT JOIN maps p ON p.id = m.parent_id ORDER BY m.name";
    SET = "UPDATE maps SET site = ?2, building = ?3, floor = ?4, parent_id = ?5, parent_from_map = ?6 WHERE id = ?1";
}

/// Where a map is.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Whereabouts {
    pub(crate) site: Option<String>,
    pub(crate) building: Option<String>,
    pub(crate) floor: Option<String>,
    /// Where it lies in another.
    pub(crate) link: Option<MapLink<String>>,
}

/// x, y, theta, level, covariance row by row; symmetric, so the order within is no matter.
fn bytes_of(link: &MapLink<String>) -> Vec<u8> {
    let Pose2Covariance { pose, covariance } = &link.parent_from_map;
    let numbers = [pose.x_m, pose.y_m, pose.theta_rad, link.level_m];
    numbers.iter().chain(covariance.iter()).flat_map(|v| v.to_le_bytes()).collect()
}

fn link_of(parent: String, bytes: &[u8]) -> Option<MapLink<String>> {
    let numbers: Vec<f64> = bytes.as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b)).collect();
    let [x_m, y_m, theta_rad, level_m, covariance @ ..] = &numbers[..] else { return None };
    let covariance = (covariance.len() == 9).then(|| Matrix3::from_row_slice(covariance))?;
    let pose = Pose2 { x_m: *x_m, y_m: *y_m, theta_rad: *theta_rad };
    let link = MapLink { parent, parent_from_map: Pose2Covariance { pose, covariance }, level_m: *level_m };
    // Out of range (a file from elsewhere) counts as not known.
    link.check().is_ok().then_some(link)
}

/// Of every map, by name.
pub(crate) async fn all(db: impl SqliteExecutor<'_>) -> Result<BTreeMap<String, Whereabouts>, StoreError> {
    let rows = sqlx::query(EACH).fetch_all(db).await.map_err(StoreError::at("list whereabouts"))?;
    let one = |row: &SqliteRow| {
        let parent: Option<String> = row.try_get("parent")?;
        let bytes: Option<Vec<u8>> = row.try_get("parent_from_map")?;
        let found = Whereabouts {
            site: row.try_get("site")?,
            building: row.try_get("building")?,
            floor: row.try_get("floor")?,
            link: parent.zip(bytes).and_then(|(parent, bytes)| link_of(parent, &bytes)),
        };
        Ok((row.try_get("name")?, found))
    };
    rows.iter().map(one).collect::<Result<_, sqlx::Error>>().map_err(StoreError::at("list whereabouts"))
}

/// How maps lie to each other.
pub(crate) fn links(all: &BTreeMap<String, Whereabouts>) -> MapLinks<String> {
    all.iter().filter_map(|(map, found)| Some((map.clone(), found.link.clone()?))).collect()
}

/// Says where a map is. `change` gets what is known and returns what shall be. Refused when a map would lie in itself.
pub(crate) async fn set(
    tx: &mut Tx,
    map: &str,
    change: impl FnOnce(Whereabouts) -> Whereabouts + Send,
) -> Result<Whereabouts, StoreError> {
    let row = maps::get(&mut tx.conn, map).await?;
    let mut known = all(&mut tx.conn).await?;
    let found = change(known.remove(map).unwrap_or_default());
    let parent = match &found.link {
        Some(link) => Some(maps::get(&mut tx.conn, &link.parent).await?.id),
        None => None,
    };
    known.insert(map.to_owned(), found.clone());
    map_links::check_all(&links(&known))?;
    sqlx::query(SET)
        .bind(row.id)
        .bind(&found.site)
        .bind(&found.building)
        .bind(&found.floor)
        .bind(parent)
        .bind(found.link.as_ref().map(bytes_of))
        .execute(&mut tx.conn)
        .await
        .map_err(StoreError::at("place map"))?;
    tx.changed(Change::Links);
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::publication::Catalogue;
    use nalgebra::Vector3;
    use vision::recognise::DistanceKind;

    fn lies_in(parent: &str) -> Whereabouts {
        let covariance = Matrix3::from_diagonal(&Vector3::new(1e-2, 2e-2, 3e-4));
        let pose = Pose2::new(1.5, -2.0, 0.7);
        let parent_from_map = Pose2Covariance { pose, covariance };
        let link = MapLink { parent: parent.to_owned(), parent_from_map, level_m: 3.4 };
        let word = |text: &str| Some(text.to_owned());
        Whereabouts { site: word("Works"), building: word("B 2"), floor: word("1st"), link: Some(link) }
    }

    async fn put(
        store: &Catalogue,
        map: &'static str,
        found: Whereabouts,
    ) -> Result<Whereabouts, StoreError> {
        store.write(move |tx| Box::pin(async move { set(tx, map, |_| found).await })).await
    }

    #[tokio::test]
    async fn whereabouts_survive_and_no_map_lies_in_itself() {
        let dir = tempfile::tempdir().unwrap();
        let config = crate::publication::tests::config(dir.path());
        let (store, task) = Catalogue::open(&config).await.unwrap();
        for map in ["a", "b", "c"] {
            store.write(move |tx| Box::pin(maps::create(tx, map, DistanceKind::Both, 3))).await.unwrap();
        }
        put(&store, "b", lies_in("a")).await.unwrap();
        put(&store, "c", lies_in("b")).await.unwrap();
        assert!(store.snapshots().relation("c", "a").is_some(), "published with the commit");
        assert!(matches!(
            put(&store, "a", lies_in("c")).await,
            Err(StoreError::Frames(map_links::MapLinkError::Cycle))
        ));
        assert!(matches!(
            put(&store, "a", lies_in("z")).await,
            Err(StoreError::NotFound { what: "map", .. })
        ));
        let refused = store.write(|tx| Box::pin(maps::delete(tx, "b"))).await;
        assert!(
            matches!(refused, Err(StoreError::InUse(why)) if why.contains("`c`")),
            "it has another in it"
        );
        task.close().await;
        let (store, _task) = Catalogue::open(&config).await.unwrap();
        assert!(store.snapshots().relation("c", "a").is_some(), "and at the start");
        let known = all(store.reads()).await.unwrap();
        assert_eq!(known["b"], lies_in("a"));
        assert_eq!(known["a"], Whereabouts::default());
        put(&store, "c", Whereabouts::default()).await.unwrap();
        assert!(
            store.snapshots().relation("c", "a").is_none() && store.snapshots().relation("b", "a").is_some()
        );
        store.write(|tx| Box::pin(maps::delete(tx, "b"))).await.unwrap();
        assert_eq!(all(store.reads()).await.unwrap().len(), 2);
        assert!(store.snapshots().relation("b", "a").is_none());
    }
}
