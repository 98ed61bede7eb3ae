//! The walls of a map (laser segments in the map frame): replaced as a whole, read as a whole.

use super::{
    StoreError, Tx,
    db::{self, Executor, Row},
    kind::Kind,
    maps,
    statements::statements,
};
use map::{check::OutOfRange, segments::LaserSegment};
use nalgebra::{Matrix2, Point2};

statements! {
    CLEAR = "DELETE FROM laser_segments WHERE map_id = $1";
    INSERT = "INSERT INTO laser_segments (map_id, ordinal, ax_m, ay_m, bx_m, by_m, covariance) \
              VALUES ($1, $2, $3, $4, $5, $6, $7)";
    WALLS = "UPDATE maps SET walls_version = walls_version + 1 WHERE id = $1";
    VERSION = "SELECT walls_version FROM maps WHERE id = $1";
    ALL_OF = "SELECT ax_m, ay_m, bx_m, by_m, covariance FROM laser_segments WHERE map_id = $1 ORDER BY ordinal";
}

/// Ends of a wall: a.x, a.y, b.x, b.y (map frame, m), free side on the left.
pub(crate) type Ends = [f64; 4];

/// A wall as it is stored.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct StoredWall {
    pub(crate) ends: Ends,
    /// Of its direction and its offset to the free side, about its middle: rad^2, rad m, m^2.
    /// `None`: measured by hand.
    pub(crate) covariance: Option<[f64; 3]>,
}

impl From<Ends> for StoredWall {
    fn from(ends: Ends) -> Self {
        Self { ends, covariance: None }
    }
}

impl From<&LaserSegment> for StoredWall {
    fn from(wall: &LaserSegment) -> Self {
        let c = wall.covariance_about_middle();
        let covariance = Some([c[(0, 0)], c[(0, 1)], c[(1, 1)]]);
        Self { ends: [wall.a.x, wall.a.y, wall.b.x, wall.b.y], covariance }
    }
}

impl StoredWall {
    /// The wall as it is computed with.
    pub(crate) fn segment(&self) -> Result<LaserSegment, OutOfRange> {
        let Some([dd, dr, rr]) = self.covariance else { return LaserSegment::by_hand(&self.ends) };
        let [ax, ay, bx, by] = self.ends;
        LaserSegment::about_middle(Point2::new(ax, ay), Point2::new(bx, by), &Matrix2::new(dd, dr, dr, rr))
    }

    /// Of the columns `ax_m, ay_m, bx_m, by_m, covariance`.
    pub(super) fn of(row: &Row) -> Result<Self, db::Error> {
        let ends = [row.try_get("ax_m")?, row.try_get("ay_m")?, row.try_get("bx_m")?, row.try_get("by_m")?];
        let covariance = row.try_get::<Option<&[u8]>, _>("covariance")?.map(numbers).transpose()?;
        Ok(Self { ends, covariance })
    }
}

/// The column `covariance`: three numbers of 8 bytes, little-endian.
fn bytes(covariance: &[f64; 3]) -> Vec<u8> {
    covariance.iter().flat_map(|v| v.to_le_bytes()).collect()
}

fn numbers(bytes: &[u8]) -> Result<[f64; 3], db::Error> {
    let (numbers, rest) = bytes.as_chunks::<8>();
    match (numbers, rest) {
        (&[a, b, c], []) => Ok([a, b, c].map(f64::from_le_bytes)),
        _ => Err(db::Error::Decode("a covariance of a wall has 24 bytes".into())),
    }
}

/// Replaces the walls of a map.
pub(crate) async fn replace<W: Copy + Into<StoredWall>>(
    tx: &mut Tx,
    map: &str,
    segments: &[W],
) -> Result<(), StoreError> {
    let map = maps::get(&mut tx.conn, map).await?;
    db::query(CLEAR).bind(map.id).execute(&mut tx.conn).await.map_err(StoreError::during("clear walls"))?;
    for (ordinal, wall) in segments.iter().enumerate() {
        let StoredWall { ends: [ax, ay, bx, by], covariance } = (*wall).into();
        db::query(INSERT)
            .bind(map.id)
            .bind(ordinal as i64)
            .bind(ax)
            .bind(ay)
            .bind(bx)
            .bind(by)
            .bind(covariance.as_ref().map(bytes))
            .execute(&mut tx.conn)
            .await
            .map_err(StoreError::during("store wall"))?;
    }
    db::query(WALLS).bind(map.id).execute(&mut tx.conn).await.map_err(StoreError::during("count walls"))?;
    maps::bump(tx, map.id).await
}

/// Version of a map's walls: it counts up with every replacement.
pub(super) async fn version(db: impl Executor<'_>, map_id: i64) -> Result<i64, StoreError> {
    let version = db::query_scalar(VERSION).bind(map_id).fetch_optional(db).await;
    let version = version.map_err(StoreError::during("read the version of walls"))?;
    version.ok_or_else(|| StoreError::NotFound { what: Kind::Map, name: map_id.to_string() })
}

/// The walls of a map, in the order they were given.
pub(crate) async fn all_of(db: impl Executor<'_>, map_id: i64) -> Result<Vec<StoredWall>, StoreError> {
    let rows =
        db::query(ALL_OF).bind(map_id).fetch_all(db).await.map_err(StoreError::during("read walls"))?;
    rows.iter().map(StoredWall::of).collect::<Result<_, _>>().map_err(StoreError::during("read walls"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wall_of_a_map_maker_is_the_same_after_storing() {
        let covariance = Matrix2::new(4e-6, 3e-6, 3e-6, 9e-5);
        let wall =
            LaserSegment::from_ends(Point2::new(5.0, -1.0), Point2::new(3.0, 4.0), covariance).unwrap();
        let stored = StoredWall::from(&wall);
        let kept =
            StoredWall { covariance: stored.covariance.map(|c| numbers(&bytes(&c)).unwrap()), ..stored };
        assert_eq!(kept, stored);
        let read = kept.segment().unwrap();
        assert!((read.a - wall.a).norm() + (read.b - wall.b).norm() < 1e-12);
        assert!((read.covariance - covariance).norm() < 1e-12, "{}", read.covariance);
        assert!(numbers(&[0; 23]).is_err());
    }
}
