"""A browser without a window: opens pages, asks what they show, takes screenshots. Chromium's headless shell, driven through a pipe.

    the program    the environment variable CHROMIUM, or the one that xtask/private-chromium.sh unpacks into target/chromium, once
    the language   JSON messages that end with a zero byte (chromedevtools.github.io/devtools-protocol)

    test ─► file descriptor 3: {"id": 1, "method": "Page.navigate", "params": {…}, "sessionId": …} ─► browser
    test ◄─ file descriptor 4: {"id": 1, "result": {…}}, and between them events: {"method": …, "params": {…}} ◄─ browser

WebGL is drawn by SwiftShader, on the processor. No name resolves, so a page reaches nothing but 127.0.0.1.
"""

import base64
import fcntl
import itertools
import json
import os
import select
import subprocess
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
TARGET = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
# A limit against hangs: a page here takes a second or two, on a busy machine several times that.
LIMIT_SECONDS = 120
FLAGS = [
    "--headless",
    "--remote-debugging-pipe",
    "--no-sandbox",  # whose set-up needs more rights than tests have; all pages are our own
    "--disable-dev-shm-usage",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
]


def program():
    """The browser; unpacks it if there is none yet."""
    if chosen := os.environ.get("CHROMIUM"):
        return chosen
    folder = TARGET / "chromium"
    done = subprocess.run([ROOT / "xtask/private-chromium.sh", folder], env=environment(), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return folder / "browser"


def environment():
    """The variables of this process without those by which tests give other programs libraries and Vulkan."""
    return {name: value for name, value in os.environ.items() if not name.startswith(("VK_", "LD_"))}


class Browser:
    """A running browser; a context manager that ends it."""

    def __enter__(self):
        found = program()
        self._folder = tempfile.TemporaryDirectory(prefix="pumice-browser-")
        pipes = [*os.pipe(), *os.pipe()]
        # Above the two numbers that the browser wants, so that putting one in place does not close the other.
        theirs_in, self._to, self._from, theirs_out = (fcntl.fcntl(end, fcntl.F_DUPFD_CLOEXEC, 10) for end in pipes)
        for end in pipes:
            os.close(end)

        def put_in_place():
            os.dup2(theirs_in, 3)
            os.dup2(theirs_out, 4)

        self._log = Path(self._folder.name, "log")
        with self._log.open("wb") as log:
            self._process = subprocess.Popen(
                [str(found), *FLAGS, f"--user-data-dir={self._folder.name}/profile"],
                stdin=subprocess.DEVNULL, stdout=log, stderr=log, env=environment(), preexec_fn=put_in_place, close_fds=False,
            )  # fmt: skip
        os.close(theirs_in)
        os.close(theirs_out)
        self._numbers, self._received = itertools.count(1), b""
        return self

    def __exit__(self, *_):
        # It ends with its own processes when nobody speaks to it any more.
        os.close(self._to)
        os.close(self._from)
        try:
            self._process.wait(LIMIT_SECONDS)
        finally:
            self._process.kill()
            self._folder.cleanup()

    def page(self, width, height, scripts=True):
        """An empty page of so many pixels, on which scripts of documents run or do not."""
        target = self.call("Target.createTarget", {"url": "about:blank"}, None)["targetId"]
        session = self.call("Target.attachToTarget", {"targetId": target, "flatten": True}, None)["sessionId"]
        return Page(self, session, width, height, scripts)

    def call(self, method, params, session, events=None):
        """The result of a command; events that come before it are added to `events`."""
        number = next(self._numbers)
        message = {"id": number, "method": method, "params": params} | ({"sessionId": session} if session else {})
        data = json.dumps(message).encode() + b"\0"
        while data:
            data = data[os.write(self._to, data) :]
        deadline = time.monotonic() + LIMIT_SECONDS
        while (got := self.message(deadline)).get("id") != number:
            if events is not None and got.get("sessionId") == session:
                events.append(got)
        assert "error" not in got, f"{method}: {got['error']}"
        return got["result"]

    def message(self, deadline):
        """The next message from the browser."""
        while b"\0" not in self._received:
            ready, _, _ = select.select([self._from], [], [], max(0.0, deadline - time.monotonic()))
            assert ready, f"the browser said nothing for {LIMIT_SECONDS} s: {self._log.read_text()}"
            data = os.read(self._from, 1 << 20)
            assert data, f"the browser ended: {self._log.read_text()}"
            self._received += data
        message, _, self._received = self._received.partition(b"\0")
        return json.loads(message)


class Page:
    """A page of a browser."""

    def __init__(self, browser, session, width, height, scripts):
        self._browser, self._session, self._events = browser, session, []
        for domain in ("Page", "Network", "Log", "Runtime"):
            self._call(f"{domain}.enable")
        self._call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
        self._call("Emulation.setScriptExecutionDisabled", value=not scripts)

    def _call(self, method, **params):
        return self._browser.call(method, params, self._session, self._events)

    def open(self, url):
        """Opens a document and waits until it has everything that it names."""
        self._events.clear()
        failure = self._call("Page.navigate", url=url).get("errorText")
        assert not failure, f"{url}: {failure}"
        deadline = time.monotonic() + LIMIT_SECONDS
        while not any(event["method"] == "Page.loadEventFired" for event in self._events):
            self._events.append(self._browser.message(deadline))

    def ask(self, expression):
        """The value of a JavaScript expression; of a promise, what it comes to."""
        got = self._call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in got, got["exceptionDetails"]
        return got["result"].get("value")

    def wait_for(self, expression):
        """Waits until a JavaScript expression has a value that is true, and returns it."""
        deadline = time.monotonic() + LIMIT_SECONDS
        while not (value := self.ask(expression)):
            assert time.monotonic() < deadline, f"{expression} stays {value!r}; the page says: {self.complaints()}"
            time.sleep(0.05)
        return value

    def drag(self, start, end):
        """Presses the mouse at a point, moves it to another, and releases it."""
        mouse = [("mouseMoved", start), ("mousePressed", start), ("mouseMoved", end), ("mouseReleased", end)]
        for kind, (x, y) in mouse:
            pressed = {} if (kind, x, y) == ("mouseMoved", *start) else {"button": "left", "buttons": 1, "clickCount": 1}
            self._call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **pressed)

    def screenshot(self):
        """What the page shows, as the bytes of a PNG file."""
        return base64.b64decode(self._call("Page.captureScreenshot", format="png")["data"])

    def requests(self):
        """Addresses that the document asked for since it was opened, its own first; not what it holds itself."""
        self.ask("0")  # the events before this answer have come
        sent = (event["params"]["request"]["url"] for event in self._events if event["method"] == "Network.requestWillBeSent")
        return [url for url in sent if not url.startswith("data:")]

    def complaints(self):
        """What the document wrote to the console or threw, and what the browser logged about it."""
        self.ask("0")
        kinds = ("Log.entryAdded", "Runtime.consoleAPICalled", "Runtime.exceptionThrown")
        return [json.dumps(event["params"]) for event in self._events if event["method"] in kinds]
