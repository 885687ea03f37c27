//! Tests that cross crates: see `tests/` beside this file, and `python/` for tests against other people's code.
#![forbid(unsafe_code)]
