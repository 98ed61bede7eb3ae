//! Locations of maps: site, building and floor as words for people, and map links for poses.

use super::{
    CommittedChange, StoreError, Tx,
    db::{self, Executor},
    maps,
    statements::statements,
};
use map::{
    map_links::{self, MapLink, MapLinks},
    pose2::{Pose2, Pose2Covariance},
};
use nalgebra::Matrix3;
use std::collections::BTreeMap;

statements! {
    EACH = "SELECT m.name, m.site, m.building, m.floor, p.name AS parent, m.parent_from_map FROM maps m \
            LEFT JOIN maps p ON p.id = m.parent_id ORDER BY m.name";
    SET = "UPDATE maps SET site = $2, building = $3, floor = $4, parent_id = $5, parent_from_map = $6 WHERE id = $1";
}

#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct MapLocation {
    pub(crate) site: Option<String>,
    pub(crate) building: Option<String>,
    pub(crate) floor: Option<String>,
    /// Its link to another map.
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
    // A link out of range (a file of another program) counts as none.
    link.check().is_ok().then_some(link)
}

/// The location of every map, by name.
pub(crate) async fn all(db: impl Executor<'_>) -> Result<BTreeMap<String, MapLocation>, StoreError> {
    let rows = db::query(EACH).fetch_all(db).await.map_err(StoreError::during("list map locations"))?;
    let one = |row: &db::Row| {
        let parent: Option<String> = row.try_get("parent")?;
        let bytes: Option<Vec<u8>> = row.try_get("parent_from_map")?;
        let location = MapLocation {
            site: row.try_get("site")?,
            building: row.try_get("building")?,
            floor: row.try_get("floor")?,
            link: parent.zip(bytes).and_then(|(parent, bytes)| link_of(parent, &bytes)),
        };
        Ok((row.try_get("name")?, location))
    };
    rows.iter().map(one).collect::<Result<_, db::Error>>().map_err(StoreError::during("list map locations"))
}

/// The map links of all maps.
pub(crate) fn links(all: &BTreeMap<String, MapLocation>) -> MapLinks<String> {
    all.iter().filter_map(|(map, location)| Some((map.clone(), location.link.clone()?))).collect()
}

/// Sets the location of a map. `change` gets the present one and returns the new one. Errors: the
/// links would form a cycle.
pub(crate) async fn set(
    tx: &mut Tx,
    map: &str,
    change: impl FnOnce(MapLocation) -> MapLocation + Send,
) -> Result<MapLocation, StoreError> {
    let row = maps::get(&mut tx.conn, map).await?;
    let mut locations = all(&mut tx.conn).await?;
    let location = change(locations.remove(map).unwrap_or_default());
    let parent = match &location.link {
        Some(link) => Some(outer(maps::get(&mut tx.conn, &link.parent).await?)?),
        None => None,
    };
    locations.insert(map.to_owned(), location.clone());
    map_links::check_all(&links(&locations))?;
    db::query(SET)
        .bind(row.id)
        .bind(&location.site)
        .bind(&location.building)
        .bind(&location.floor)
        .bind(parent)
        .bind(location.link.as_ref().map(bytes_of))
        .execute(&mut tx.conn)
        .await
        .map_err(StoreError::during("locate map"))?;
    tx.changed(CommittedChange::Links);
    Ok(location)
}

/// The number of a map that others may lie in. A draft goes away.
fn outer(map: maps::MapRow) -> Result<i64, StoreError> {
    match map.draft_of {
        Some(of) => {
            Err(StoreError::InUse(format!("map `{}` is a draft of map `{of}`: use that one", map.name)))
        }
        None => Ok(map.id),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::publication::Catalogue;
    use crate::store::kind::Kind;
    use nalgebra::Vector3;
    use vision::recognise::DistanceKind;

    crate::store::tests::cluster::on_each_store! {
        locations_survive_and_no_map_is_linked_to_itself,
    }

    fn linked_to(parent: &str) -> MapLocation {
        let covariance = Matrix3::from_diagonal(&Vector3::new(1e-2, 2e-2, 3e-4));
        let pose = Pose2::new(1.5, -2.0, 0.7);
        let parent_from_map = Pose2Covariance { pose, covariance };
        let link = MapLink { parent: parent.to_owned(), parent_from_map, level_m: 3.4 };
        let word = |text: &str| Some(text.to_owned());
        MapLocation { site: word("Works"), building: word("B 2"), floor: word("1st"), link: Some(link) }
    }

    async fn put(
        store: &Catalogue,
        map: &'static str,
        location: MapLocation,
    ) -> Result<MapLocation, StoreError> {
        store.write(move |tx| Box::pin(async move { set(tx, map, |_| location).await })).await
    }

    async fn locations_survive_and_no_map_is_linked_to_itself() {
        let dir = tempfile::tempdir().unwrap();
        let config = crate::publication::tests::config(dir.path());
        let (store, task) = Catalogue::open(&config).await.unwrap();
        for map in ["a", "b", "c"] {
            store.write(move |tx| Box::pin(maps::create(tx, map, DistanceKind::Both, 3))).await.unwrap();
        }
        put(&store, "b", linked_to("a")).await.unwrap();
        put(&store, "c", linked_to("b")).await.unwrap();
        assert!(store.snapshots().relation("c", "a").is_some(), "published with the commit");
        assert!(matches!(
            put(&store, "a", linked_to("c")).await,
            Err(StoreError::Frames(map_links::MapLinkError::Cycle))
        ));
        assert!(matches!(
            put(&store, "a", linked_to("z")).await,
            Err(StoreError::NotFound { what: Kind::Map, .. })
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
        assert_eq!(known["b"], linked_to("a"));
        assert_eq!(known["a"], MapLocation::default());
        put(&store, "c", MapLocation::default()).await.unwrap();
        assert!(
            store.snapshots().relation("c", "a").is_none() && store.snapshots().relation("b", "a").is_some()
        );
        store.write(|tx| Box::pin(maps::delete(tx, "b"))).await.unwrap();
        assert_eq!(all(store.reads()).await.unwrap().len(), 2);
        assert!(store.snapshots().relation("b", "a").is_none());
    }
}
