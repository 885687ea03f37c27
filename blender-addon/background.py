# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators whose work runs in a thread of its own, with progress and ESC in a window, and to the end if a script calls them.

An operator that mixes in `InBackground` has `begin(context)`, which returns a `Work`, and `finish(context, result)`, which runs in
Blender's thread when the work is done. `ended()` runs last in any case: after success, failure and cancelling.

A thread that waits for the answer of a server notices a cancelled job only when the answer or the end of its patience comes. It is left to itself
after a moment, and ends by the cancelled job.
"""

import threading
import time

import bpy

from . import native
from .reports import log, one_line


# How long a cancelled thread that may wait for a server is waited for.
PATIENCE_SECONDS = 1.0


class Work:
    """A call in a thread: `call(job)` must not use Blender. With `tells` it is `call(job, tell)`; `tell(text)` names the stage reached. With
    `asks_server` it may wait for a server."""

    def __init__(self, stage, call, *, tells=False, asks_server=False):
        self.stage, self.call = stage, (lambda job: call(job, self._tell)) if tells else call
        self.job, self.asks_server, self._cancelled_at = native.require().Job(), asks_server, None
        self.result = self.error = None
        self.thread = threading.Thread(target=self._run, name="pumice work", daemon=True)
        self.thread.start()

    def cancel(self):
        self.job.cancel()
        if self._cancelled_at is None:
            self._cancelled_at = time.monotonic()

    @property
    def is_left(self):
        """Whether the work was cancelled and its thread is not waited for any more."""
        if not self.asks_server or self._cancelled_at is None or not self.thread.is_alive():
            return False
        return time.monotonic() - self._cancelled_at >= PATIENCE_SECONDS

    def _tell(self, stage):
        self.stage = stage

    def _run(self):
        try:
            self.result = self.call(self.job)
        except BaseException as error:  # an exception cannot leave the thread: the operator reads it here
            self.error = error
        finally:
            # It may refer to this object, and a reference cycle keeps the result, with its volumes, until the garbage collector runs.
            self.call = None


class InBackground:
    """Runs `begin`'s work in the background."""

    _interactive = False
    _work = None
    _timer = None

    def execute(self, context):
        try:
            self._work = self.begin(context)
        except Exception as error:
            return self.refused(error)
        if not self._interactive or bpy.app.background:
            self._work.thread.join()
            return self._finished(context)
        manager = context.window_manager
        manager.progress_begin(0, 1000)
        self._timer = manager.event_timer_add(0.1, window=context.window)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == "ESC" and event.value == "PRESS":
            self._work.cancel()
            return {"RUNNING_MODAL"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        if self._work.thread.is_alive() and not self._work.is_left:
            done = self._work.job.fraction
            context.window_manager.progress_update(int(1000 * (done or 0.0)))
            percent = f" {100 * done:.0f} %" if done is not None else ""
            context.workspace.status_text_set(f"{self._work.stage}{percent}   ESC: cancel")
            return {"RUNNING_MODAL"}
        self._end(context)
        return self._finished(context)

    def cancel(self, context):
        """Called when Blender ends the operator, because a file is loaded or the window is closed."""
        if self._work is not None:
            self._work.cancel()
            self._work.thread.join(PATIENCE_SECONDS if self._work.asks_server else None)
            self._end(context)
            self.ended()

    def refused(self, error):
        """Reports why the operator does nothing; returns what Blender is told."""
        log(error)
        self.report({"ERROR"}, one_line(error))
        return {"CANCELLED"}

    def ended(self):
        """Nothing to clean up, unless an operator says what."""

    def _finished(self, context):
        try:
            return self._outcome(context)
        finally:
            self.ended()
            # Blender may keep the operator, and an import's result holds its volumes.
            self._work = None

    def _outcome(self, context):
        work = self._work
        if work.is_left or isinstance(work.error, native.require().Cancelled):
            self.report({"WARNING"}, f"Cancelled: {work.stage}")
            return {"CANCELLED"}
        try:
            if work.error is not None:
                raise work.error
            self.finish(context, work.result)
        except Exception as error:
            return self.refused(error)
        return {"FINISHED"}

    def _end(self, context):
        manager = context.window_manager
        if self._timer is not None:
            manager.event_timer_remove(self._timer)
            self._timer = None
            manager.progress_end()
        if context.workspace is not None:
            context.workspace.status_text_set(None)
