//! Backups of the server's data.

use super::{
    map_client::{MapClient, reason},
    operation::operations,
};
use crate::ClientError;
use protos::api::{Backup, BackupState};
use reqwest::{RequestBuilder, Response};
use std::time::Duration;

operations! {
    MAKE: POST "/backups" => make_backup,
    LIST: GET "/backups" => backups,
    GET: GET "/backups/{backup}" => backup,
    FILE: GET "/backups/{backup}/file" => backup_file,
    DELETE: DELETE "/backups/{backup}" => delete_backup,
}

/// Longest time for the file of a backup.
const DOWNLOAD_TIMEOUT: Duration = Duration::from_hours(24);
/// A file of which nothing comes for longer than this has broken off.
const SILENCE: Duration = Duration::from_mins(1);
/// Time between two looks at a backup that is being made.
const POLL: Duration = Duration::from_millis(200);

/// A file of the server, as it comes.
#[derive(Debug)]
pub struct FileDownload {
    response: Response,
    length: Option<u64>,
}

impl FileDownload {
    /// Length of the whole, bytes.
    pub fn length(&self) -> Option<u64> {
        self.length
    }

    /// The next part; `None` at the end.
    pub async fn next(&mut self) -> Result<Option<Vec<u8>>, ClientError> {
        let url = self.response.url().to_string();
        match tokio::time::timeout(SILENCE, self.response.chunk()).await {
            Ok(Ok(part)) => Ok(part.map(|part| part.to_vec())),
            Ok(Err(error)) => Err(ClientError::Http { url, detail: reason(&error) }),
            Err(_elapsed) => Err(ClientError::Http { url, detail: format!("nothing for {SILENCE:?}") }),
        }
    }
}

impl MapClient {
    /// Begins a backup in the server's data directory. Refused with `in_use` while another one is
    /// being made.
    pub async fn make_backup(&self) -> Result<Backup, ClientError> {
        self.send(self.ask(&MAKE, &[])?).await
    }

    /// Waits until a backup is no longer being made, at most this long.
    pub async fn wait_for_backup(&self, mut backup: Backup, wait: Duration) -> Result<Backup, ClientError> {
        let until = tokio::time::Instant::now() + wait;
        while backup.state == BackupState::Running && tokio::time::Instant::now() < until {
            tokio::time::sleep(POLL).await;
            backup = self.backup(&backup.name).await?;
        }
        Ok(backup)
    }

    /// All backups in the server's data directory, by time.
    pub async fn backups(&self) -> Result<Vec<Backup>, ClientError> {
        self.all(&LIST, &[]).await
    }

    /// One backup: how far it is, and what it holds.
    pub async fn backup(&self, backup: &str) -> Result<Backup, ClientError> {
        self.send(self.ask(&GET, &[&backup])?).await
    }

    /// The file of a complete backup.
    pub async fn backup_file(&self, backup: &str) -> Result<FileDownload, ClientError> {
        let request = self.ask(&FILE, &[&backup])?.timeout(DOWNLOAD_TIMEOUT);
        self.download(request).await
    }

    /// Sends, and gives the body as it comes.
    pub(super) async fn download(&self, request: RequestBuilder) -> Result<FileDownload, ClientError> {
        let response = self.checked(request).await?;
        Ok(FileDownload { length: response.content_length(), response })
    }

    /// Deletes a complete backup.
    pub async fn delete_backup(&self, backup: &str) -> Result<(), ClientError> {
        self.done(self.ask(&DELETE, &[&backup])?).await
    }
}
