//! `waymark open`: a link that opens the page once.

use crate::session::ServerArgs;
use serde_json::json;

/// `waymark open`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    server: ServerArgs,
}

/// Prints the link.
pub(crate) async fn run(args: &Args) -> anyhow::Result<()> {
    let session = args.server.session()?;
    let asked = session.maps().page_link().await.map_err(Into::into);
    let link = session.explained(asked).await?;
    let url = format!("{}{}", args.server.url(), link.path);
    session.show(&json!({ "url": url, "valid_s": link.valid_s }), &url)?;
    session.note(&format!("  It opens the page once, within {} minutes.", link.valid_s / 60));
    Ok(())
}
