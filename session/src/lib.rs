//! What the command and Python are both made of: opens volumes, picks a backend, drives progressive rendering, reports.
#![forbid(unsafe_code)]

pub mod curve_plot;
pub mod figure;
pub mod measure;
pub mod progressive;
pub mod selection;
