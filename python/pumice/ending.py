"""The end of the interpreter while calls are in progress in other threads."""

import threading

from ._native import _end_calls
from .errors import Cancelled


def end_calls() -> None:
    """Cancels calls in progress and waits for them; no new call can begin. Threads that end by it print no traceback: CPython aborts the process where a
    daemon thread is printing while the interpreter ends."""
    former = threading.excepthook

    def without_cancelled(args: threading.ExceptHookArgs) -> None:
        if not issubclass(args.exc_type, Cancelled):
            former(args)

    threading.excepthook = without_cancelled
    _end_calls()
