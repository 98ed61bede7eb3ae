//! Generated views from one photograph.
