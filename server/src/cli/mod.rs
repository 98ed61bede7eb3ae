//! The `waymark` command line: one file per command.
