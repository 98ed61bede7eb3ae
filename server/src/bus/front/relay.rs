//! One connection between a robot and a router: batches of zenoh's transport go both ways, and
//! those of the robot are read first. In: both ends. Out: why it ended.

use super::{
    inspection::{Cost, Inspection, Violation},
    lasting::InterestKeys,
    pace::Pace,
};
use std::{
    io,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::Duration,
};
use tokio::{
    io::{AsyncRead, AsyncReadExt as _, AsyncWrite, AsyncWriteExt as _},
    sync::oneshot,
    time::timeout,
};
use zenoh_buffers::writer::HasWriter as _;
use zenoh_codec::{WCodec as _, Zenoh080};
use zenoh_protocol::transport::{Close, close::reason};

/// Longest time in which an end takes what was sent before the other end closed.
const LINGER: Duration = Duration::from_secs(1);

/// Why a connection ended.
#[derive(Debug, thiserror::Error)]
pub(super) enum End {
    /// One of the ends closed it.
    #[error("closed: {0}")]
    Closed(#[from] io::Error),
    /// The robot sent what no router may get.
    #[error(transparent)]
    Violation(#[from] Violation),
}

/// The end of a router.
pub(super) struct ToRouter<R, W> {
    pub(super) read: R,
    pub(super) write: W,
}

/// Relays until an end closes or a batch may not pass.
pub(super) async fn relay<R, W>(
    robot: impl AsyncRead + AsyncWrite + Unpin,
    mut router: ToRouter<R, W>,
    interests: Arc<InterestKeys>,
) -> End
where
    R: AsyncRead + Unpin,
    W: AsyncWrite + Unpin,
{
    let (mut from_robot, mut to_robot) = tokio::io::split(robot);
    let (tell, mut told) = oneshot::channel::<()>();
    let inspection = Mutex::new(Inspection::new(interests));
    let ended = {
        let inward = inward(&mut from_robot, &mut router.write, &inspection);
        let outward = outward(&mut router.read, &mut to_robot, &mut told, &inspection);
        tokio::pin!(inward, outward);
        let ended = tokio::select! {
            ended = &mut inward => ended,
            ended = &mut outward => return End::Closed(ended),
        };
        if let End::Violation(_) = ended {
            // Between two batches: the robot's zenoh reads why.
            drop(tell);
            drop(timeout(LINGER, outward).await);
        }
        ended
    };
    drop(timeout(LINGER, to_robot.shutdown()).await);
    // What the robot sent last is for the router, which closes its end when it has read it.
    let last = async {
        router.write.shutdown().await?;
        tokio::io::copy(&mut router.read, &mut tokio::io::sink()).await
    };
    // A connection that is closed over unread bytes is reset, and the robot never reads why.
    let rest = async {
        if let End::Violation(_) = ended {
            tokio::io::copy(&mut from_robot, &mut tokio::io::sink()).await.ok();
        }
    };
    drop(tokio::join!(timeout(LINGER, last), timeout(LINGER, rest)));
    ended
}

async fn inward(
    from_robot: &mut (impl AsyncRead + Unpin),
    to_router: &mut (impl AsyncWrite + Unpin),
    inspection: &Mutex<Inspection>,
) -> End {
    let (mut pace, mut batch) = (Pace::new(), Vec::new());
    loop {
        if let Err(error) = read_batch(from_robot, &mut batch).await {
            return error.into();
        }
        let cost: Cost = match locked(inspection).batch(&batch[2..]) {
            Ok(cost) => cost,
            Err(violation) => return violation.into(),
        };
        pace.keep(cost, batch.len()).await;
        if let Err(error) = write_batch(to_router, &batch).await {
            return error.into();
        }
    }
}

async fn outward(
    from_router: &mut (impl AsyncRead + Unpin),
    to_robot: &mut (impl AsyncWrite + Unpin),
    told: &mut oneshot::Receiver<()>,
    inspection: &Mutex<Inspection>,
) -> io::Error {
    let mut batch = Vec::new();
    loop {
        let read = tokio::select! {
            read = read_batch(from_router, &mut batch) => read,
            // Its sender is gone.
            _ = &mut *told => {
                let closed = write_batch(to_robot, &refusal()).await;
                return closed.err().unwrap_or_else(|| io::ErrorKind::ConnectionAborted.into());
            }
        };
        if let Err(error) = read {
            return error;
        }
        locked(inspection).of_router(&batch[2..]);
        if let Err(error) = write_batch(to_robot, &batch).await {
            return error;
        }
    }
}

fn locked(inspection: &Mutex<Inspection>) -> MutexGuard<'_, Inspection> {
    inspection.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The length, two bytes, least first, and the batch, into `batch`.
async fn read_batch(from: &mut (impl AsyncRead + Unpin), batch: &mut Vec<u8>) -> io::Result<()> {
    let length = from.read_u16_le().await?;
    batch.clear();
    batch.extend_from_slice(&length.to_le_bytes());
    batch.resize(2 + usize::from(length), 0);
    from.read_exact(&mut batch[2..]).await.map(|_| ())
}

async fn write_batch(to: &mut (impl AsyncWrite + Unpin), batch: &[u8]) -> io::Result<()> {
    to.write_all(batch).await?;
    to.flush().await
}

/// zenoh's message that ends a session, as a batch.
fn refusal() -> Vec<u8> {
    let mut batch = vec![0; 2];
    let mut message = Vec::new();
    let written = Zenoh080.write(&mut message.writer(), &Close { reason: reason::INVALID, session: true });
    if written.is_ok() {
        batch[0] = message.len() as u8;
        batch.append(&mut message);
    }
    batch
}
