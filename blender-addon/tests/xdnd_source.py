# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Drags files onto a window and drops them there, as a file manager does: the source of X11's drag and drop.

    python3 xdnd_source.py X Y FILE…       pixels of the screen, from the upper left

    this program                             the window under the pixel that has XdndAware
    XdndEnter, XdndPosition ×3 ────────────►
                               ◄──────────── XdndStatus: whether it would take them
    XdndDrop ──────────────────────────────►
                               ◄──────────── asks for the selection XdndSelection as text/uri-list
    the files' addresses ──────────────────►
                               ◄──────────── XdndFinished

The protocol is version 3 and newer of https://www.freedesktop.org/wiki/Specifications/XDND. Exit status: 0 the files were handed over, 1 the
window refuses them, 2 no window takes part or it does not answer within SECONDS. Needs libX11 alone.
"""

import ctypes
import sys
import time
from pathlib import Path

SECONDS = 60.0
VERSION = 5
# Numbers of X11/X.h.
PROPERTY_REPLACE, CLIENT_MESSAGE, SELECTION_REQUEST, SELECTION_NOTIFY = 0, 33, 30, 31

X = ctypes.CDLL("libX11.so.6")
for _name, _kind in (("XOpenDisplay", ctypes.c_void_p), ("XDefaultRootWindow", ctypes.c_ulong), ("XInternAtom", ctypes.c_ulong),
                     ("XCreateSimpleWindow", ctypes.c_ulong), ("XGetSelectionOwner", ctypes.c_ulong)):  # fmt: skip
    getattr(X, _name).restype = _kind

# An event is 24 numbers of the size of a pointer; those of 32 bits take a whole one too.
Event = ctypes.c_long * 24


class Source:
    """A window of our own that owns the selection, and the window that the files are dropped on."""

    def __init__(self, x, y, files):
        self.display = ctypes.c_void_p(X.XOpenDisplay(None))
        if not self.display:
            raise SystemExit("xdnd_source: no display")
        self.root = ctypes.c_ulong(X.XDefaultRootWindow(self.display))
        self.window = ctypes.c_ulong(X.XCreateSimpleWindow(self.display, self.root, 0, 0, 1, 1, 0, ctypes.c_ulong(0), ctypes.c_ulong(0)))
        self.x, self.y = x, y
        self.list = "".join(f"{Path(file).resolve().as_uri()}\r\n" for file in files).encode()
        self.target = self._aware(self.root, x, y)

    def atom(self, name):
        return X.XInternAtom(self.display, name.encode(), False)

    def send(self, kind, *data):
        """Sends a client message to the target."""
        event = Event(CLIENT_MESSAGE, 0, 0, self.display.value, self.target.value, self.atom(kind), 32, self.window.value, *data)
        X.XSendEvent(self.display, self.target, False, ctypes.c_long(0), ctypes.byref(event))
        X.XFlush(self.display)

    def answer(self, kind):
        """The data of the next client message of a kind; hands over the selection meanwhile. None if it does not come in time."""
        end, event = time.monotonic() + SECONDS, Event()
        while time.monotonic() < end:
            while X.XPending(self.display):
                X.XNextEvent(self.display, ctypes.byref(event))
                if event[0] & 0xFFFFFFFF == SELECTION_REQUEST:
                    self._hand_over(event)
                elif event[0] & 0xFFFFFFFF == CLIENT_MESSAGE and event[5] == self.atom(kind):
                    return list(event[7:12])
            time.sleep(0.01)
        return None

    def drop(self):
        """Drags the files to the place and drops them; the exit status."""
        X.XSetSelectionOwner(self.display, self.atom("XdndSelection"), self.window, ctypes.c_ulong(0))
        self.send("XdndEnter", VERSION << 24, self.atom("text/uri-list"), 0, 0)
        accepts = False
        for away in (40, 20, 0):
            place = (self.x + away) << 16 | (self.y + away)
            self.send("XdndPosition", 0, place, 0, self.atom("XdndActionCopy"))
            status = self.answer("XdndStatus")
            if status is None:
                return 2
            accepts = bool(status[1] & 1)
        if not accepts:
            self.send("XdndLeave", 0, 0, 0, 0)
            return 1
        self.send("XdndDrop", 0, 0, 0, 0)
        return 2 if self.answer("XdndFinished") is None else 0

    def _hand_over(self, request):
        _, _, _, _, _, requestor, selection, target, prop, when = request[:10]
        if target == self.atom("text/uri-list"):
            X.XChangeProperty(
                self.display, ctypes.c_ulong(requestor), ctypes.c_ulong(prop), ctypes.c_ulong(target), 8, PROPERTY_REPLACE, self.list, len(self.list)
            )
        else:
            prop = 0
        event = Event(SELECTION_NOTIFY, 0, 0, self.display.value, requestor, selection, target, prop, when)
        X.XSendEvent(self.display, ctypes.c_ulong(requestor), False, ctypes.c_long(0), ctypes.byref(event))
        X.XFlush(self.display)

    def _aware(self, window, x, y):
        """The innermost window under a pixel that takes part in drag and drop; None where there is none."""
        found, child, at_x, at_y = None, ctypes.c_ulong(), ctypes.c_int(), ctypes.c_int()
        while window.value:
            X.XTranslateCoordinates(
                self.display, self.root, window, x, y, ctypes.byref(at_x), ctypes.byref(at_y), ctypes.byref(child)
            )
            window = ctypes.c_ulong(child.value)
            if window.value and self._has(window, "XdndAware"):
                found = window
        return found

    def _has(self, window, name):
        kind, form, count, rest, data = ctypes.c_ulong(), ctypes.c_int(), ctypes.c_ulong(), ctypes.c_ulong(), ctypes.c_void_p()
        X.XGetWindowProperty(
            self.display, window, ctypes.c_ulong(self.atom(name)), ctypes.c_long(0), ctypes.c_long(1), False, ctypes.c_ulong(0),
            ctypes.byref(kind), ctypes.byref(form), ctypes.byref(count), ctypes.byref(rest), ctypes.byref(data)
        )  # fmt: skip
        return count.value > 0


if __name__ == "__main__":
    source = Source(int(sys.argv[1]), int(sys.argv[2]), sys.argv[3:])
    sys.exit(2 if source.target is None else source.drop())
