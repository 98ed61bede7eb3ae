//! Certificates of robots.

use super::{map_client::MapClient, operation::operations};
use crate::ClientError;
use protos::api::{CertificateRequest, EnrolledRobot, RobotCertificate};

operations! {
    ENROL: POST "/robots/{robot}/certificates" => enrol_robot,
    LIST: GET "/robots/{robot}/certificates" => robot_certificates,
    REVOKE: DELETE "/robots/{robot}/certificates/{serial}" => revoke_robot_certificate,
}

impl MapClient {
    /// Has a robot's request for a certificate signed.
    pub async fn enrol_robot(
        &self,
        robot: &str,
        request: &CertificateRequest,
    ) -> Result<EnrolledRobot, ClientError> {
        self.send(self.ask(&ENROL, &[&robot])?.json(request)).await
    }

    /// A robot's certificates, the oldest first, with those that were revoked or have expired.
    pub async fn robot_certificates(&self, robot: &str) -> Result<Vec<RobotCertificate>, ClientError> {
        self.all(&LIST, &[&robot]).await
    }

    /// Revokes a certificate.
    pub async fn revoke_robot_certificate(&self, robot: &str, serial: &str) -> Result<(), ClientError> {
        self.done(self.ask(&REVOKE, &[&robot, &serial])?).await
    }
}
