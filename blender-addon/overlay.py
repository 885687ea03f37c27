# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The line over the viewport's picture: backend, samples, estimated error and time.

    vulkan-rt on Radeon · 64 samples · error 2.1 % · 3.4 s        followed by problems, if any
"""

from . import devices
from .reports import of_limit


def percent(error):
    """A relative error as text for users, with at most two digits."""
    return f"{100.0 * error:.2g} %" if error >= 1e-4 else "below 0.01 %"


def line(status, frame, notes):
    """One line from the session's status and its newest frame (either may be None) and a list of notes."""
    said = []
    if status is not None and status.state == "failed":
        said.append(f"stopped: {of_limit(status.error)}")
    elif frame is None and status is not None and status.error:
        said.append(f"not shown: {of_limit(status.error)}")
    elif frame is None:
        said.append("preparing" if status is not None else "no volume to draw")
    else:
        said.append(drawn_by(status))
        said.append(f"{frame.spp} sample" + ("s" if frame.spp != 1 else ""))
        if frame.error_estimate < 10.0:
            said.append(f"error {percent(frame.error_estimate)}")
        if frame.filtered:
            said.append("denoised, biased")
        said.append(f"{frame.seconds:.1f} s")
        if status.error:
            said.append(f"not shown: {of_limit(status.error)}")
        elif status.state == "converged":
            said.append("done")
    # The last is what led to the backend that draws now.
    overcome = status.notices[-1:] if status is not None else []
    return " · ".join(said + notes + overcome)


def drawn_by(status):
    """Backend and device; for the processor only the backend, and for which other it stands in."""
    if status.compiling:
        return f"{status.backend} until {status.compiling} is compiled"
    if status.backend == "cpu":
        return "cpu"
    return f"{status.backend} on {devices.short(status.device)}"
