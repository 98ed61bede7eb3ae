//! `waymark completions` and `waymark man`: for the shell and for readers of manual pages.

use anyhow::Context as _;
use clap::Command;
use std::path::PathBuf;

/// `waymark completions`.
#[derive(Debug, clap::Args)]
pub(crate) struct CompletionArgs {
    /// The shell.
    #[arg(value_enum)]
    shell: clap_complete::Shell,
}

/// `waymark man`.
#[derive(Debug, clap::Args)]
pub(crate) struct ManArgs {
    /// Folder for waymark.1 and a page for each command; made if it is not there.
    folder: PathBuf,
}

/// Writes completions to standard output.
pub(crate) fn completions(args: &CompletionArgs, mut command: Command) {
    clap_complete::generate(args.shell, &mut command, "waymark", &mut std::io::stdout());
}

/// Writes manual pages.
pub(crate) fn man(args: &ManArgs, command: Command) -> anyhow::Result<()> {
    std::fs::create_dir_all(&args.folder).with_context(|| args.folder.display().to_string())?;
    clap_mangen::generate_to(command, &args.folder).with_context(|| args.folder.display().to_string())
}
