//! Encryption of HTTP. In: an accepted connection. Out: what is spoken on it: TLS, plain text by a
//! client of this machine, or plain text that would have been readable on the way, which is
//! refused.

use super::error::ApiError;
use axum::{Router, http::StatusCode};
use std::{io, net::SocketAddr};
use tokio::net::TcpStream;

/// First byte of a handshake of TLS. No method of HTTP begins so.
const HANDSHAKE: u8 = 0x16;

/// What is spoken on a connection.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum WireProtocol {
    Tls,
    /// Plain text that no other machine can read.
    LocalPlain,
    /// Plain text from another machine.
    Plain,
}

/// Looks at the first byte, which stays to be read. Errors: the connection ends before it.
pub(super) async fn spoken(stream: &TcpStream, peer: SocketAddr) -> io::Result<WireProtocol> {
    let mut first = [0];
    if stream.peek(&mut first).await? == 0 {
        return Err(io::ErrorKind::UnexpectedEof.into());
    }
    Ok(match first[0] {
        HANDSHAKE => WireProtocol::Tls,
        _ if peer.ip().to_canonical().is_loopback() => WireProtocol::LocalPlain,
        _ => WireProtocol::Plain,
    })
}

/// Answers everything by a refusal that names what is to be asked.
pub(super) fn refusing() -> Router {
    Router::new().fallback(async || {
        let detail = "this server is encrypted: ask for https:// in place of http://. What was sent could be read on the \
                      way: revoke a token that was in it";
        ApiError::new(StatusCode::UPGRADE_REQUIRED, "encryption_required", detail)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use tokio::{io::AsyncWriteExt as _, net::TcpListener};

    #[tokio::test]
    async fn what_is_spoken_is_told_by_the_first_byte_and_by_who_speaks() {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let at = listener.local_addr().unwrap();
        let [near, mapped, far]: [SocketAddr; 3] =
            ["127.0.0.9:1", "[::ffff:127.0.0.1]:1", "192.0.2.4:1"].map(|text| text.parse().unwrap());
        for (bytes, peer, expected) in [
            (&[HANDSHAKE, 3, 1][..], far, WireProtocol::Tls),
            (&[HANDSHAKE, 3, 1], near, WireProtocol::Tls),
            (b"GET / ", near, WireProtocol::LocalPlain),
            (b"GET / ", mapped, WireProtocol::LocalPlain),
            (b"POST /", far, WireProtocol::Plain),
        ] {
            let mut client = TcpStream::connect(at).await.unwrap();
            let (accepted, _) = listener.accept().await.unwrap();
            client.write_all(bytes).await.unwrap();
            assert_eq!(spoken(&accepted, peer).await.unwrap(), expected, "{bytes:?} {peer}");
        }
        drop(TcpStream::connect(at).await.unwrap());
        let (accepted, _) = listener.accept().await.unwrap();
        assert!(spoken(&accepted, near).await.is_err());
    }
}
