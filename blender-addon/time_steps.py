# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which time step a series shows at a frame of the scene, in the words of Blender's volume and image sequences. Does not use Blender.

    frame ──► (frame − start) / step, rounded down ──► mode: within the played time steps ──► + offset ──► time step of the file

Time steps are counted from 0, frames as Blender counts them.
"""

import math
from typing import NamedTuple

# Frames with time remapping are computed in single precision: one this close below a whole number is that number.
CLOSE = 1e-3


class Playback(NamedTuple):
    """How a series is played. `start` is the frame that shows the first time step, `step` the frames that each is shown, `duration` how many
    are played from `offset` on; `mode` is CLIP, EXTEND, REPEAT or PING_PONG, as in Blender."""

    start: int = 1
    duration: int = 1
    offset: int = 0
    step: int = 1
    mode: str = "EXTEND"

    def shown(self, frame, count):
        """The time step of a file with `count` of them; None where the mode shows nothing. What would lie outside of the file is not played."""
        first = min(max(self.offset, 0), count - 1)
        played = min(max(self.duration, 1), count - first)
        at = math.floor(frame + CLOSE) - self.start
        at //= max(self.step, 1)
        if self.mode == "CLIP" and not 0 <= at < played:
            return None
        if self.mode == "REPEAT":
            at %= played
        elif self.mode == "PING_PONG":
            at %= max(2 * played - 2, 1)
            at = min(at, 2 * played - 2 - at)
        return first + min(max(at, 0), played - 1)

    def nearest(self, frame, count):
        """As `shown`, but where the mode shows nothing the nearest time step."""
        return (self if self.mode != "CLIP" else self._replace(mode="EXTEND")).shown(frame, count)
