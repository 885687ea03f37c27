# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A final render in a thread of its own, with the interpreter released, and what the main thread does meanwhile.

    thread        renderer.render ──────────────────────────► picture, or the picture so far once the user cancelled
    main thread   test_break, frames for Blender, status line, every few hundredths of a second

The thread never uses Blender.
"""

import math
import threading

from . import overlay

LOOK_SECONDS = 0.05


class Work:
    """A render that has begun; `stop` are the limits of `final_render.limits`."""

    def __init__(self, pumice, renderer, scene, volumes, meshes, stop, *, growing, growing_passes=False, denoise=False):
        self.pumice, self.renderer, self.stop = pumice, renderer, stop
        self.job = pumice.Job()
        self.point = None
        self.picture = self.error = None
        shown = dict(denoise=denoise, growing=growing, growing_passes=growing_passes, unfinished=True)
        arguments = dict(meshes=meshes, job=self.job, on_progress=self._progress, **shown, **stop)
        self.thread = threading.Thread(target=self._run, args=(scene, volumes, arguments), name="pumice render")
        self.thread.start()

    def _run(self, scene, volumes, arguments):
        try:
            self.picture = self.renderer.render(scene, volumes, **arguments)
        except BaseException as error:  # raised again in `watch`
            self.error = error

    def _progress(self, point):
        self.point = point

    def watch(self, engine, growing):
        """The picture, unfinished if the user cancelled; None if it then has no sample. Shows frames and passes in `growing`, a
        `render_result.Growing`. Raises what the render raised."""
        try:
            while self.thread.is_alive():
                self.thread.join(LOOK_SECONDS)
                if engine.test_break():
                    self.job.cancel()
                growing.look(self.renderer)
                if self.point is not None:
                    done = fraction(self.point, self.stop)
                    engine.update_progress(done)
                    engine.update_stats("Pumice", progress_line(self.point, self.stop, done))
        finally:
            # If showing a frame fails, nobody waits for the picture.
            if self.thread.is_alive():
                self.job.cancel()
                self.thread.join()
        if isinstance(self.error, self.pumice.Cancelled):
            return None
        if self.error is not None:
            raise self.error
        return self.picture


def fraction(point, stop):
    """Progress towards the nearest limit, 0 to 1. Error falls with the root of the samples."""
    reached = [point.spp / stop["spp"]]
    if stop["seconds"]:
        reached.append(point.seconds / stop["seconds"])
    if stop["error"] and point.error_estimate:
        reached.append((stop["error"] / point.error_estimate) ** 2)
    return min(1.0, max(reached))


def progress_line(point, stop, done):
    """The status text while it renders, which begins as Cycles' does; `done` is the `fraction`."""
    said = f"Remaining:{clock(point.seconds * (1.0 - done) / done)} · " if 0.0 < done < 1.0 else ""
    said += f"sample {point.spp} of {stop['spp']}"
    if point.error_estimate is not None and math.isfinite(point.error_estimate):
        said += f" · error {overlay.percent(point.error_estimate)}"
    return f"{said} · {point.seconds:.1f} s"


def clock(seconds):
    """Seconds as Blender writes times of renders: mm:ss.ff, and from an hour on hh:mm:ss.ff."""
    minutes, rest = divmod(round(100.0 * seconds), 6000)
    hours, minutes = divmod(minutes, 60)
    return (f"{hours:02d}:" if hours else "") + f"{minutes:02d}:{rest // 100:02d}.{rest % 100:02d}"
