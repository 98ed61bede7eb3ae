//! `waymark map convert`: walls from one file to another, no server needed.

use super::{
    export::TargetArgs,
    import::{SourceArgs, sentence, summary},
};
use crate::screen;
use serde_json::json;

/// `waymark map convert`.
#[derive(Debug, clap::Args)]
pub(crate) struct ConvertArgs {
    #[command(flatten)]
    source: SourceArgs,
    #[command(flatten)]
    target: TargetArgs,
    /// Print the summary as JSON.
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &ConvertArgs) -> anyhow::Result<()> {
    let imported = args.source.read()?;
    args.target.write(&imported.map)?;
    if args.json {
        let mut result = summary(&imported.report);
        result["file"] = json!(args.target.name());
        screen::say(&result.to_string());
    } else {
        screen::say(&format!("{}, in {}", sentence(&imported.report), args.target.name()));
    }
    Ok(())
}
