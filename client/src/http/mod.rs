//! The teacher's and the administrator's side, over HTTP: one method for each operation of the API,
//! a file for each resource. In and out: the types of [`protos::api`].

mod audit;
mod backups;
mod bundles;
mod cameras;
mod creation;
mod events;
mod form;
mod gathering;
mod health;
mod drafts;
mod history;
mod landmark_models;
mod landmarks;
mod learning;
mod live;
mod local_token;
mod localise;
mod map_client;
mod mapping;
mod maps;
mod modalities;
mod operation;
mod recognise;
mod reference_runs;
mod robot_certificates;
mod robots;
mod tls;
mod server_events;
mod stored_answers;
mod tokens;
mod topology;
mod underlay;
mod views;
mod visibility;
mod visibility_settings;
mod walls;

pub use backups::FileDownload;
pub use cameras::CameraFrame;
pub use learning::JobEvents;
pub use live::LiveEvents;
pub use localise::Sensed;
pub use map_client::{MapClient, Revised};
pub use operation::Operation;
pub use recognise::RecogniseOptions;
pub use server_events::ServerEvents;
pub use views::{LandmarkRegion, NewView};

/// Every operation that [`MapClient`] has a method for.
pub fn operations() -> impl Iterator<Item = &'static Operation> {
    let all = [
        audit::OPERATIONS,
        backups::OPERATIONS,
        bundles::OPERATIONS,
        cameras::OPERATIONS,
        gathering::OPERATIONS,
        health::OPERATIONS,
        drafts::OPERATIONS,
        history::OPERATIONS,
        landmark_models::OPERATIONS,
        landmarks::OPERATIONS,
        learning::OPERATIONS,
        live::OPERATIONS,
        localise::OPERATIONS,
        mapping::OPERATIONS,
        maps::OPERATIONS,
        modalities::OPERATIONS,
        recognise::OPERATIONS,
        reference_runs::OPERATIONS,
        robot_certificates::OPERATIONS,
        robots::OPERATIONS,
        server_events::OPERATIONS,
        stored_answers::OPERATIONS,
        tokens::OPERATIONS,
        topology::OPERATIONS,
        underlay::OPERATIONS,
        views::OPERATIONS,
        visibility::OPERATIONS,
        visibility_settings::OPERATIONS,
        walls::OPERATIONS,
    ];
    all.into_iter().flatten()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn each_operation_and_each_method_is_there_once() {
        let all: Vec<_> = operations().map(|o| (o.method.as_str(), o.path)).collect();
        let calls: BTreeSet<_> = operations().map(|o| o.call).collect();
        assert_eq!((all.iter().collect::<BTreeSet<_>>().len(), calls.len()), (all.len(), all.len()));
    }
}
