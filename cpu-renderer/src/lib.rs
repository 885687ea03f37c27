//! The reference path tracer: every machine can render.
#![forbid(unsafe_code)]

pub mod traverse;
