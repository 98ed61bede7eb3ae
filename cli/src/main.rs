//! The `waymark` command.

fn main() -> std::process::ExitCode {
    cli::main()
}
