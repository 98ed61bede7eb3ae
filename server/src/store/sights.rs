//! The camera that looks for a map's landmarks, and what counts as seen: one setting for each map, on which its visibility
//! areas rest.

use super::{StoreError, Tx, maps, statements::statements};
use map::visibility::VisibilitySettings;

statements! {
    SET = "UPDATE maps SET sight = ?2 WHERE id = ?1";
}

/// Sets it; the usual one is stored as none. A new version of the map, with areas made anew.
pub(crate) async fn set(tx: &mut Tx, map: &str, sight: &VisibilitySettings) -> Result<(), StoreError> {
    let map = maps::get(&mut tx.conn, map).await?;
    let usual = *sight == VisibilitySettings::default();
    let text = (!usual).then(|| serde_json::to_string(sight)).transpose();
    let text = text
        .map_err(|e| StoreError::Damaged { what: "visibility settings".to_owned(), reason: e.to_string() })?;
    sqlx::query(SET)
        .bind(map.id)
        .bind(text)
        .execute(&mut tx.conn)
        .await
        .map_err(StoreError::at("store visibility settings"))?;
    maps::bump(tx, map.id).await
}

/// As stored. One that does not read or is out of range (a file from elsewhere) is the usual one.
pub(super) fn read(map: &str, text: Option<&str>) -> VisibilitySettings {
    let Some(text) = text else { return VisibilitySettings::default() };
    let read: Result<VisibilitySettings, String> = serde_json::from_str(text)
        .map_err(|e| e.to_string())
        .and_then(|sight: VisibilitySettings| sight.check().map(|()| sight).map_err(|e| e.to_string()));
    read.unwrap_or_else(|reason| {
        tracing::warn!(map, reason, "the stored camera is not used");
        VisibilitySettings::default()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use map::visibility::PanTiltCamera;

    #[test]
    fn what_does_not_read_is_the_usual_one() {
        let sight = VisibilitySettings {
            viewer: PanTiltCamera { focal_px: 700.0, ..PanTiltCamera::default() },
            ..VisibilitySettings::default()
        };
        let text = serde_json::to_string(&sight).unwrap();
        assert_eq!(read("m", Some(&text)), sight);
        assert_eq!(read("m", None), VisibilitySettings::default());
        for wrong in ["", "{\"viewer\":{\"focal_px\":1}}", "{\"other\":1}"] {
            assert_eq!(read("m", Some(wrong)), VisibilitySettings::default(), "{wrong}");
        }
    }

    #[test]
    fn the_longest_fits_its_column() {
        let long = -1.234_567_890_123_456_7e-3;
        let mut sight = VisibilitySettings::default();
        sight.viewer.tilt_rad = [long, 1.0 / 3.0];
        sight.viewer.focal_px = 10_000.0 / 3.0;
        assert!(serde_json::to_string(&sight).unwrap().len() < 1024);
    }
}
