//! Tests of the joint map.
