//! Certificates of robots: serial, digest, and until when each is valid.

use super::{
    CommittedChange, StoreError, Tx,
    db::{self, Executor, Row},
    kind::Kind,
    now_ms,
    pictures::hex,
    robots,
    statements::statements,
    within,
};
use protos::api::RobotCertificate;

statements! {
    COUNT = "SELECT count(*) FROM robot_certificates";
    INSERT = "INSERT INTO robot_certificates (serial, robot, sha256, issued_ms, expires_ms) VALUES ($1, $2, $3, $4, $5)";
    GET = "SELECT serial, robot, sha256, issued_ms, expires_ms, revoked_ms FROM robot_certificates \
           WHERE robot = $1 AND serial = $2";
    OF_ROBOT = "SELECT serial, robot, sha256, issued_ms, expires_ms, revoked_ms FROM robot_certificates \
                WHERE robot = $1 ORDER BY issued_ms, serial";
    EVERY = "SELECT serial, robot, sha256, issued_ms, expires_ms, revoked_ms FROM robot_certificates \
           ORDER BY robot, issued_ms, serial LIMIT $1";
    REVOKE = "UPDATE robot_certificates SET revoked_ms = $3 WHERE robot = $1 AND serial = $2 AND revoked_ms IS NULL";
    REVOKE_ALL = "UPDATE robot_certificates SET revoked_ms = $2 WHERE robot = $1 AND revoked_ms IS NULL";
    FORGET_ENDED = "DELETE FROM robot_certificates WHERE serial = (SELECT serial FROM robot_certificates \
                    WHERE revoked_ms IS NOT NULL OR expires_ms <= $1 ORDER BY issued_ms LIMIT 1)";
}

/// Most certificates stored, with those that were revoked or have expired; of these the oldest make
/// room.
pub(crate) const MAX_CERTIFICATES: usize = 4000;

/// A certificate to be stored.
#[derive(Debug, Clone)]
pub(crate) struct CertificateInsert {
    pub(crate) serial: String,
    pub(crate) robot: String,
    pub(crate) sha256: [u8; 32],
    pub(crate) issued_ms: i64,
    pub(crate) expires_ms: i64,
}

fn certificate_row(row: &Row) -> Result<RobotCertificate, db::Error> {
    let sha256: Vec<u8> = row.try_get("sha256")?;
    Ok(RobotCertificate {
        serial: row.try_get("serial")?,
        robot: row.try_get("robot")?,
        sha256: hex(&sha256),
        issued_ms: row.try_get("issued_ms")?,
        expires_ms: row.try_get("expires_ms")?,
        revoked_ms: row.try_get("revoked_ms")?,
    })
}

/// Stores a signed certificate. Errors: a robot that is not registered; more than
/// [`MAX_CERTIFICATES`] in use.
pub(crate) async fn create(tx: &mut Tx, new: CertificateInsert) -> Result<RobotCertificate, StoreError> {
    robots::get(&mut tx.conn, &new.robot).await?;
    if count(&mut tx.conn).await? as usize >= MAX_CERTIFICATES {
        let forgotten = db::query(FORGET_ENDED).bind(now_ms()).execute(&mut tx.conn).await;
        forgotten.map_err(StoreError::during("forget an ended certificate"))?;
    }
    db::query(INSERT)
        .bind(&new.serial)
        .bind(&new.robot)
        .bind(new.sha256.as_slice())
        .bind(new.issued_ms)
        .bind(new.expires_ms)
        .execute(&mut tx.conn)
        .await
        .map_err(StoreError::during("store certificate"))?;
    within(count(&mut tx.conn).await? as i64, MAX_CERTIFICATES, "certificates")?;
    tx.changed(CommittedChange::Certificates);
    get(&mut tx.conn, &new.robot, &new.serial).await
}

async fn count(db: impl Executor<'_>) -> Result<u64, StoreError> {
    let count: Result<i64, _> = db::query_scalar(COUNT).fetch_one(db).await;
    Ok(count.map_err(StoreError::during("count certificates"))? as u64)
}

/// One certificate.
async fn get(db: impl Executor<'_>, robot: &str, serial: &str) -> Result<RobotCertificate, StoreError> {
    let row = db::query(GET).bind(robot).bind(serial).fetch_optional(db).await;
    let row = row.map_err(StoreError::during("read certificate"))?;
    let row = row.ok_or_else(|| StoreError::NotFound { what: Kind::Certificate, name: serial.to_owned() })?;
    certificate_row(&row).map_err(StoreError::during("read certificate"))
}

/// The certificates of a robot, the oldest first, with those that were revoked or have expired.
pub(crate) async fn of_robot(
    db: impl Executor<'_>,
    robot: &str,
) -> Result<Vec<RobotCertificate>, StoreError> {
    let rows = db::query(OF_ROBOT).bind(robot).fetch_all(db).await;
    let rows = rows.map_err(StoreError::during("list certificates"))?;
    let read: Result<_, _> = rows.iter().map(certificate_row).collect();
    read.map_err(StoreError::during("list certificates"))
}

/// The certificates of all robots.
pub(crate) async fn all(db: impl Executor<'_>) -> Result<Vec<RobotCertificate>, StoreError> {
    let rows = db::query(EVERY).bind(MAX_CERTIFICATES as i64).fetch_all(db).await;
    let rows = rows.map_err(StoreError::during("list certificates"))?;
    let read: Result<_, _> = rows.iter().map(certificate_row).collect();
    read.map_err(StoreError::during("list certificates"))
}

/// Revokes a certificate; one that was revoked before keeps its time.
pub(crate) async fn revoke(tx: &mut Tx, robot: &str, serial: &str) -> Result<(), StoreError> {
    get(&mut tx.conn, robot, serial).await?;
    let revoked = db::query(REVOKE).bind(robot).bind(serial).bind(now_ms()).execute(&mut tx.conn).await;
    revoked.map_err(StoreError::during("revoke certificate"))?;
    tx.changed(CommittedChange::Certificates);
    Ok(())
}

/// Revokes what a robot that is being deleted has.
pub(crate) async fn revoke_all(tx: &mut Tx, robot: &str) -> Result<(), StoreError> {
    let revoked = db::query(REVOKE_ALL).bind(robot).bind(now_ms()).execute(&mut tx.conn).await;
    revoked.map_err(StoreError::during("revoke certificates"))?;
    tx.changed(CommittedChange::Certificates);
    Ok(())
}
