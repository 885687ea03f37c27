//! Refuses options of the caller that would change nothing in the picture's file.

use super::picture_format::PictureFormat;
use super::request::RenderRequest;
use crate::error::{Result, SessionError};

/// Refuses options that the format of the picture has no room for. Fields of a scene are no wishes of this call: they stay unused in silence.
///
/// # Errors
/// [`SessionError::Caller`] names the option, the file, and where the option has an effect.
pub(super) fn check_options(request: &RenderRequest, format: PictureFormat) -> Result<()> {
    let wishes = &request.overrides;
    if request.memory_limit_bytes.is_some() && request.explain {
        return Err(SessionError::Caller(
            "--memory-limit: --explain measures volumes that are in memory".into(),
        ));
    }
    let (option, why) = match format {
        PictureFormat::Png if wishes.half => ("--half", "has 8 bits a channel; half floats go into an .exr"),
        PictureFormat::Png if request.passes != ["all"] => {
            ("--passes", "holds the colour alone; passes go into an .exr")
        }
        PictureFormat::Exr if wishes.view_transform.is_some() => {
            ("--view-transform", "holds scene-linear light; only a .png has a view transform")
        }
        _ => return Ok(()),
    };
    Err(SessionError::Caller(format!("{option}: {} {why}", request.out.display())))
}
