//! What crosses crates is tested here: see `tests/` beside this file, and `python/` for tests against other people's code.
#![forbid(unsafe_code)]
