"""A server of a folder on loopback: whole files, parts of them, and faults that tests ask for."""

import contextlib
import gzip
import http.server
import os
import threading
import time
import zlib

import zstandard


def zstd(content):
    # A compressor is for one thread.
    return zstandard.ZstdCompressor().compress(content)


# `deflate` is one that nobody stores files with.
CODINGS = {"gzip": gzip.compress, "zstd": zstd, "deflate": zlib.compress}


class Server:
    """What a server of `folder` was asked, and how it misbehaves."""

    def __init__(self, folder):
        self.folder = folder
        self.url = ""
        # (path, Range or None) of each request, in order.
        self.asked = []
        # Requests that were under way at once.
        self.most_at_once = 0
        self.at_once = 0
        # Seconds until an answer.
        self.delay = 0.0
        # Called with path and number of the try; returns a status in place of the file, "cut" for half an answer, "whole" to ignore
        # Range, a name of CODINGS for a file that is compressed on the way, or None.
        self.fault = lambda path, tries: None
        self.lock = threading.Lock()


def handler(server):
    class Handler(http.server.BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def log_message(self, *args):
            pass

        def handle(self):
            # A client that leaves is no fault.
            with contextlib.suppress(ConnectionError):
                super().handle()

        def do_GET(self):
            path = self.path.lstrip("/")
            part = self.headers.get("Range")
            with server.lock:
                server.asked.append((path, part))
                tries = sum(p == path for p, _ in server.asked)
                server.at_once += 1
                server.most_at_once = max(server.most_at_once, server.at_once)
            self.is_under_way = True
            try:
                time.sleep(server.delay)
                self.answer(path, part, server.fault(path, tries))
            finally:
                self.is_over()

        do_HEAD = do_GET

        def is_over(self):
            with server.lock:
                server.at_once -= self.is_under_way
            self.is_under_way = False

        def answer(self, path, part, fault):
            file = os.path.join(server.folder, path)
            if isinstance(fault, int) or not os.path.isfile(file):
                return self.send(fault if isinstance(fault, int) else 404, b"no")
            with open(file, "rb") as opened:
                content = opened.read()
            if fault == "cut":
                self.send(200, content[: len(content) // 2], {"Content-Length": len(content)})
                self.close_connection = True
            elif fault in CODINGS:
                self.send(200, CODINGS[fault](content), {"Content-Encoding": fault})
            elif part and fault != "whole":
                begin, end = part.removeprefix("bytes=").split("-")
                first = int(begin) if begin else max(0, len(content) - int(end))
                last = min(int(end), len(content) - 1) if begin and end else len(content) - 1
                if first >= len(content):
                    return self.send(416, b"")
                self.send(206, content[first : last + 1], {"Content-Range": f"bytes {first}-{last}/{len(content)}"})
            else:
                self.send(200, content)

        def send(self, status, content, headers=None):
            self.send_response(status)
            headers = {"Content-Length": len(content), **(headers or {})}
            for name, value in headers.items():
                self.send_header(name, str(value))
            # Before the client has all of the answer and may ask anew.
            self.is_over()
            self.end_headers()
            if self.command != "HEAD":
                self.wfile.write(content)

    return Handler


class HttpServer(http.server.ThreadingHTTPServer):
    # Sixteen clients may connect at once. Where the queue is full, the system drops a connection and tries it again a second later.
    request_queue_size = 64


@contextlib.contextmanager
def serving(folder):
    """Serves a folder until the end of the block."""
    server = Server(folder)
    with HttpServer(("127.0.0.1", 0), handler(server)) as http_server:
        server.url = f"http://127.0.0.1:{http_server.server_port}"
        thread = threading.Thread(target=http_server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True)
        thread.start()
        try:
            yield server
        finally:
            http_server.shutdown()
            thread.join()
