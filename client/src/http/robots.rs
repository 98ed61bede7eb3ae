//! Robots: pose, corrections, relocalisation, trajectories, messages of ROS 2.

use super::{map_client::MapClient, operation::operations};
use crate::ClientError;
use protos::api::{
    CorrectionsBody, ListQuery, Page, PoseByHand, RelocalisationStatus, Robot, RobotAssignment, RobotPose,
    Ros2Status, TrajectoriesBody, UnknownRobots,
};

operations! {
    PUT: PUT "/robots/{robot}" => put_robot,
    LIST: GET "/robots" => robots,
    GET: GET "/robots/{robot}" => robot,
    SET_POSE: PUT "/robots/{robot}/pose" => set_robot_pose,
    DELETE: DELETE "/robots/{robot}" => delete_robot,
    CORRECTIONS: GET "/robots/{robot}/corrections" => corrections,
    RELOCALISATION: GET "/robots/{robot}/relocalisation" => relocalisation,
    ROS2: GET "/robots/{robot}/ros2" => ros2_status,
    UNKNOWN: GET "/unknown-robots" => unknown_robots,
    TRAJECTORIES: GET "/robots/{robot}/trajectories" => trajectories,
}

impl MapClient {
    /// Registers a robot, or gives it another map.
    pub async fn put_robot(&self, robot: &str, map: &str) -> Result<Robot, ClientError> {
        let to = RobotAssignment { map: map.to_owned() };
        self.send(self.ask(&PUT, &[&robot])?.json(&to)).await
    }

    /// All robots, by name.
    pub async fn robots(&self) -> Result<Vec<Robot>, ClientError> {
        self.all(&LIST, &[]).await
    }

    /// A page of the robots that a query selects, with their number on all pages.
    pub async fn find_robots(&self, query: &ListQuery) -> Result<Page<Robot>, ClientError> {
        self.send(self.ask_query(&LIST, &[], query)?).await
    }

    /// One robot: whether it is connected, its pose and how old that is, and whether a second
    /// program uses its name.
    pub async fn robot(&self, robot: &str) -> Result<Robot, ClientError> {
        self.send(self.ask(&GET, &[&robot])?).await
    }

    /// Robots that send messages and are refused because they are not registered.
    pub async fn unknown_robots(&self) -> Result<UnknownRobots, ClientError> {
        self.send(self.ask(&UNKNOWN, &[])?).await
    }

    /// Puts a robot where a person says it is. It has to send odometry; the pose is unsupported
    /// until a landmark agrees.
    pub async fn set_robot_pose(&self, robot: &str, pose: &PoseByHand) -> Result<RobotPose, ClientError> {
        self.send(self.ask(&SET_POSE, &[&robot])?.json(pose)).await
    }

    /// Deletes a robot; its frames are rejected from now on.
    pub async fn delete_robot(&self, robot: &str) -> Result<(), ClientError> {
        self.done(self.ask(&DELETE, &[&robot])?).await
    }

    /// Support of a robot's pose, and the outcomes of its fixes.
    pub async fn corrections(&self, robot: &str) -> Result<CorrectionsBody, ClientError> {
        self.send(self.ask(&CORRECTIONS, &[&robot])?).await
    }

    /// Pose hypotheses of a robot that observes nothing unique.
    pub async fn relocalisation(&self, robot: &str) -> Result<RelocalisationStatus, ClientError> {
        self.send(self.ask(&RELOCALISATION, &[&robot])?).await
    }

    /// What became of the messages of a robot of ROS 2.
    pub async fn ros2_status(&self, robot: &str) -> Result<Ros2Status, ClientError> {
        self.send(self.ask(&ROS2, &[&robot])?).await
    }

    /// Recent trajectories of a robot, by source.
    pub async fn trajectories(&self, robot: &str) -> Result<TrajectoriesBody, ClientError> {
        self.send(self.ask(&TRAJECTORIES, &[&robot])?).await
    }
}
