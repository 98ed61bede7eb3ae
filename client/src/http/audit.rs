//! The audit log.

use super::{map_client::MapClient, operation::operations};
use crate::ClientError;
use protos::api::{AuditCheck, AuditEntry, AuditHead, AuditHeadQuery, AuditQuery, Page};

operations! {
    LIST: GET "/audit" => audit,
    CHECK: GET "/audit/check" => check_audit,
}

impl MapClient {
    /// A page of changes, newest first: who, when, what.
    pub async fn audit(&self, query: &AuditQuery) -> Result<Page<AuditEntry>, ClientError> {
        self.send(self.ask_query(&LIST, &[], query)?).await
    }

    /// Whether the audit log is as it was written. `noted`: an earlier [`AuditCheck::head`], kept
    /// outside of the server.
    pub async fn check_audit(&self, noted: Option<&AuditHead>) -> Result<AuditCheck, ClientError> {
        let query =
            AuditHeadQuery { seq: noted.map(|head| head.seq), sha256: noted.map(|head| head.sha256.clone()) };
        self.send(self.ask_query(&CHECK, &[], &query)?).await
    }
}
