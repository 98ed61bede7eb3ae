//! Training views of a landmark.

use super::{form::Form, map_client::MapClient, operation::operations};
use crate::ClientError;
use protos::api::{CaptureMetadata, Page, RefusedView, Size, TrainingView, ViewQuery};
use serde_json::json;

operations! {
    UPLOAD: POST "/maps/{map}/landmarks/{landmark}/views" => upload_view_with,
    LIST: GET "/maps/{map}/landmarks/{landmark}/views" => views,
    DELETE: DELETE "/maps/{map}/landmarks/{landmark}/views/{view}" => delete_view,
    ICON: GET "/maps/{map}/landmarks/{landmark}/views/{view}/icon" => view_icon,
    IMAGE: GET "/maps/{map}/landmarks/{landmark}/views/{view}/image" => view_image,
    REFUSED: GET "/maps/{map}/landmarks/{landmark}/refused-views" => refused_views,
    REFUSED_ICON: GET "/maps/{map}/landmarks/{landmark}/refused-views/{refused}/icon" => refused_view_icon,
}

/// The part of an uploaded image that shows the landmark.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LandmarkRegion {
    /// The dominant quad, which the server detects.
    Detect,
    /// The whole image is the landmark, cut out beforehand.
    WholeImage,
    /// These corners: top-left, top-right, bottom-right, bottom-left, in pixels.
    Corners([[f64; 2]; 4]),
}

/// A training view to upload.
#[derive(Debug, Clone, PartialEq)]
pub struct NewView {
    /// The photograph, JPEG or PNG.
    pub image: Vec<u8>,
    /// The landmark in the photograph.
    pub region: LandmarkRegion,
    /// How the photograph was taken; with it the server places the landmark, unless it was placed
    /// by hand.
    pub capture: Option<CaptureMetadata>,
    /// Store it even if it is a near-duplicate of a stored view.
    pub keep_near_duplicate: bool,
    /// Make the landmark if it does not exist, together with this view or not at all.
    pub make_landmark: bool,
    /// Size of the landmark. Refused with `size_differs` if it has another one by hand.
    pub size: Option<Size>,
}

impl NewView {
    /// A photograph without further data.
    pub fn new(image: Vec<u8>, region: LandmarkRegion) -> Self {
        Self { image, region, capture: None, keep_near_duplicate: false, make_landmark: false, size: None }
    }

    /// Makes the landmark if it does not exist, of this size. Nothing is made if the view is
    /// refused.
    #[must_use]
    pub fn or_make_landmark(self, size: Option<Size>) -> Self {
        Self { make_landmark: true, size, ..self }
    }
}

impl MapClient {
    /// Adds a view: a JPEG or PNG photograph.
    pub async fn upload_view(
        &self,
        map: &str,
        landmark: &str,
        image: Vec<u8>,
        region: LandmarkRegion,
    ) -> Result<TrainingView, ClientError> {
        self.upload_view_with(map, landmark, NewView::new(image, region)).await
    }

    /// Adds a view with its capture data.
    pub async fn upload_view_with(
        &self,
        map: &str,
        landmark: &str,
        new: NewView,
    ) -> Result<TrainingView, ClientError> {
        let mut form = Form::with_image(&new.image);
        match new.region {
            LandmarkRegion::Detect => {}
            LandmarkRegion::WholeImage => form = form.text("whole_image", "true"),
            LandmarkRegion::Corners(corners) => form = form.text("corners", &json!(corners).to_string()),
        }
        if let Some(capture) = new.capture {
            form = form.text("capture", &json!(capture).to_string());
        }
        if new.keep_near_duplicate {
            form = form.text("keep_near_duplicate", "true");
        }
        if new.make_landmark {
            form = form.text("create", "true");
        }
        if let Some(Size { width_m, height_m }) = new.size {
            form = form.text("width_m", &width_m.to_string()).text("height_m", &height_m.to_string());
        }
        self.send(form.of(self.ask(&UPLOAD, &[&map, &landmark])?)).await
    }

    /// A page of the views that a query selects, with their number on all pages.
    pub async fn find_views(
        &self,
        map: &str,
        landmark: &str,
        query: &ViewQuery,
    ) -> Result<Page<TrainingView>, ClientError> {
        self.send(self.ask_query(&LIST, &[&map, &landmark], query)?).await
    }

    /// All views of a landmark, by number.
    pub async fn views(&self, map: &str, landmark: &str) -> Result<Vec<TrainingView>, ClientError> {
        self.all(&LIST, &[&map, &landmark]).await
    }

    /// Deletes a view. The model stays until the landmark is learnt again.
    pub async fn delete_view(&self, map: &str, landmark: &str, view: i64) -> Result<(), ClientError> {
        self.done(self.ask(&DELETE, &[&map, &landmark, &view])?).await
    }

    /// The photograph of a view as it was uploaded, PNG or JPEG.
    pub async fn view_image(&self, map: &str, landmark: &str, view: i64) -> Result<Vec<u8>, ClientError> {
        self.bytes(self.ask(&IMAGE, &[&map, &landmark, &view])?).await
    }

    /// The photographs that uploads refused or the last lesson left out, newest first, at most 50,
    /// each with the reason.
    pub async fn refused_views(&self, map: &str, landmark: &str) -> Result<Vec<RefusedView>, ClientError> {
        self.all(&REFUSED, &[&map, &landmark]).await
    }

    /// A small picture of a refused photograph, PNG.
    pub async fn refused_view_icon(
        &self,
        map: &str,
        landmark: &str,
        refused: i64,
    ) -> Result<Vec<u8>, ClientError> {
        self.bytes(self.ask(&REFUSED_ICON, &[&map, &landmark, &refused])?).await
    }

    /// The icon of a view, PNG.
    pub async fn view_icon(&self, map: &str, landmark: &str, view: i64) -> Result<Vec<u8>, ClientError> {
        self.bytes(self.ask(&ICON, &[&map, &landmark, &view])?).await
    }
}
