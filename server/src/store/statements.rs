//! SQL texts as constants, listed so that a test can prepare every one of them against the migrated
//! schema: what the `query!` macros would check, without a database at build time.

/// Declares SQL constants and `ALL`, the list of them.
macro_rules! statements {
    ($($name:ident = $sql:expr;)+) => {
        $(const $name: &str = $sql;)+
        /// Every statement of this file.
        #[cfg(test)]
        pub(super) const ALL: &[(&str, &str)] = &[$((concat!(module_path!(), "::", stringify!($name)), $name)),+];
    };
}
pub(super) use statements;
