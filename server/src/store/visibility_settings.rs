//! Visibility settings: the camera and the limits that define "visible", one set for each map.

use super::{StoreError, Tx, db, maps, statements::statements, text_revision};
use map::visibility::VisibilitySettings;

statements! {
    SET = "UPDATE maps SET sight = $2 WHERE id = $1";
}

/// Sets the visibility settings of a map; the defaults are stored as NULL. The map gets a new
/// version with new areas.
pub(crate) async fn set(tx: &mut Tx, map: &str, settings: &VisibilitySettings) -> Result<(), StoreError> {
    let map = maps::get(&mut tx.conn, map).await?;
    let is_default = *settings == VisibilitySettings::default();
    let text = (!is_default).then(|| serde_json::to_string(settings)).transpose();
    let text = text
        .map_err(|e| StoreError::Damaged { what: "visibility settings".to_owned(), reason: e.to_string() })?;
    db::query(SET)
        .bind(map.id)
        .bind(text)
        .execute(&mut tx.conn)
        .await
        .map_err(StoreError::during("store visibility settings"))?;
    maps::bump(tx, map.id).await
}

pub(crate) fn revision(settings: &VisibilitySettings) -> String {
    text_revision(&serde_json::to_string(settings).unwrap_or_default())
}

/// The stored settings. Unreadable or impossible ones (a file of another program) become the
/// defaults.
pub(super) fn read(map: &str, text: Option<&str>) -> VisibilitySettings {
    let Some(text) = text else { return VisibilitySettings::default() };
    let read: Result<VisibilitySettings, String> =
        serde_json::from_str(text).map_err(|e| e.to_string()).and_then(|settings: VisibilitySettings| {
            settings.check().map(|()| settings).map_err(|e| e.to_string())
        });
    read.unwrap_or_else(|reason| {
        tracing::warn!(map, reason, follows = "the defaults are used", "visibility_settings_unreadable");
        VisibilitySettings::default()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use map::visibility::PanTiltCamera;

    #[test]
    fn unreadable_settings_become_the_defaults() {
        let settings = VisibilitySettings {
            viewer: PanTiltCamera { focal_px: 700.0, ..PanTiltCamera::default() },
            ..VisibilitySettings::default()
        };
        let text = serde_json::to_string(&settings).unwrap();
        assert_eq!(read("m", Some(&text)), settings);
        assert_eq!(read("m", None), VisibilitySettings::default());
        for wrong in ["", "{\"viewer\":{\"focal_px\":1}}", "{\"other\":1}"] {
            assert_eq!(read("m", Some(wrong)), VisibilitySettings::default(), "{wrong}");
        }
    }

    #[test]
    fn the_longest_fits_its_column() {
        let long = -1.234_567_890_123_456_7e-3;
        let mut settings = VisibilitySettings::default();
        settings.viewer.tilt_rad = [long, 1.0 / 3.0];
        settings.viewer.focal_px = 10_000.0 / 3.0;
        assert!(serde_json::to_string(&settings).unwrap().len() < 1024);
    }
}
