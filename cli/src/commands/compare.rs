//! `pumice compare`

use pumice_core::Outputs;
use pumice_session::{Job, compare_pictures};

use crate::Answer;
use crate::args::Compare;
use crate::failure::{Failure, say};
use crate::json_report::{declare_report, write_report};

pub(crate) fn run(args: &Compare, job: &Job) -> Result<Answer, Failure> {
    let outputs = Outputs::default();
    declare_report(&outputs, args.json.as_deref())?;
    [&args.picture, &args.reference].into_iter().try_for_each(|picture| outputs.check_input(picture))?;
    let c = compare_pictures(&args.picture, &args.reference, job)?;
    if args.json.as_deref() != Some(std::path::Path::new("-")) {
        let colors = &c.colors;
        let alpha = c.alpha_rmse.map_or_else(String::new, |rmse| format!("   alpha RMSE {rmse:.5}"));
        say(format_args!(
            "relMSE {:.6e}   PSNR {:.2} dB   SSIM {:.5}   FLIP {:.5}{alpha}",
            colors.rel_mse, colors.psnr, colors.ssim, colors.flip
        ))?;
    }
    if let Some(to) = &args.json {
        write_report(to, &c)?;
    }
    Ok(if args.max_rel_mse.is_some_and(|bar| c.colors.rel_mse > bar) { Answer::No } else { Answer::Yes })
}
