//! The Waymark server and command line.
