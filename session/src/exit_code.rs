//! How a command ends.

use std::io::Write;
use std::process::ExitCode;
use std::time::Duration;

use pumice_core::{Job, end_process};
use pumice_vulkan::device::abandon_compiling;
use pumice_vulkan::finish_compiling;

/// What `main` returns at its end. Where a driver still compiles, as after Ctrl-C, the process ends here: at a normal end the driver would free
/// what its compiler uses.
pub fn exit_code(code: u8) -> ExitCode {
    if finish_compiling(Duration::ZERO) {
        return ExitCode::from(code);
    }
    // Whoever printed has looked for errors.
    let _ = std::io::stdout().flush();
    end_process(code)
}

/// What Ctrl-C does: the first one cancels `job`, which removes its temporary files; the second one ends the process at once with exit code 2.
pub fn interrupt(job: &Job) {
    if job.is_cancelled() {
        abandon_compiling();
        end_process(2);
    }
    job.cancel();
}
