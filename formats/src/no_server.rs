//! What a build without the feature `http` says of servers.

use std::io::{Error, ErrorKind};
use std::path::Path;
use std::sync::Arc;

use pumice_core::CancelFlag;

use crate::store_files::Part;

/// Whether this build reads from servers.
pub(crate) const IS_THERE: bool = false;

/// Runs `work`, which asks no server.
pub(crate) fn heeding<T>(_: &CancelFlag, work: impl FnOnce() -> T) -> T {
    work()
}

pub(crate) fn read(_: &Path, _: Part, _: u64) -> Result<Vec<u8>, Error> {
    Err(ErrorKind::Unsupported.into())
}

pub(crate) fn description(_: &Path) -> Result<Option<Arc<[u8]>>, Error> {
    Err(ErrorKind::Unsupported.into())
}

#[cfg(feature = "zarr")]
pub(crate) fn size(_: &Path) -> Result<u64, Error> {
    Err(ErrorKind::Unsupported.into())
}
