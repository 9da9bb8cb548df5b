"""The live page: a recording in the browser, from a small server inside this process.

The page is the very one of `write_html`: meshcat's viewer with everything in it, so nothing is pushed while it plays.
It does not use meshcat's own server, a subprocess that outlives a killed parent and hangs after some hundred
reconnects. There is one server per process; it ends with `Viewer.close`, or with the process.
"""

from __future__ import annotations

import threading
import webbrowser
from collections.abc import Sequence
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from rigidimpulse.view.page import DEFAULT_TITLE, render_page
from rigidimpulse.view.protocol import RecordingLike

HOST = "127.0.0.1"
LOAD_TIMEOUT = 20.0
"""Longest wait, s, for the browser to fetch the page."""

CLOSE_DELAY = 0.05
"""Longest time, s, until the server notices that it is to end."""

_viewer: Viewer | None = None


def show(recording: RecordingLike, title: str = DEFAULT_TITLE, checks: Sequence[Any] = (), open_browser: bool = True) -> Viewer:
    """Show a recording in the browser and return the viewer that serves it.

    The call returns once the browser has the page, which needs the server no longer: a script may end at once. Where
    no browser can be started, open the printed address elsewhere; `Viewer.wait` keeps the page up. A second call shows
    its recording at the same address.

    Args:
        recording: the motion.
        title, checks: as `write_html` has them.
        open_browser: open the page here; otherwise only serve it at `Viewer.url`.

    Raises:
        ValueError: as `write_html`.

    """
    return show_page(render_page(recording, title, checks=checks), open_browser)


def show_page(page: str, open_browser: bool = True) -> Viewer:
    """Show a page in the browser, as `show` does that of a recording, and return the viewer that serves it."""
    global _viewer
    if _viewer is None or _viewer.closed:
        _viewer = Viewer()
    _viewer.put(page.encode("utf-8"))
    print(f"rigidimpulse: {_viewer.url}")
    if open_browser and webbrowser.open(_viewer.url):
        _viewer.fetched.wait(LOAD_TIMEOUT)
    return _viewer


class Viewer:
    """Serves one page on this machine only, at `url`; a context manager that closes itself."""

    def __init__(self, port: int = 0) -> None:
        """Start serving on a port of 127.0.0.1; 0 takes a free one."""
        self.fetched = threading.Event()
        self.closed = False
        self._page = b""
        self._server = ThreadingHTTPServer((HOST, port), self._handler())
        self._server.daemon_threads = True
        self._thread = threading.Thread(target=self._serve, name="rigidimpulse-view", daemon=True)
        self._thread.start()

    @property
    def url(self) -> str:
        """Address of the page."""
        return f"http://{HOST}:{self._server.server_address[1]}/"

    def put(self, page: bytes) -> None:
        """Serve this page from now on."""
        self._page = page
        self.fetched.clear()

    def wait(self) -> None:
        """Keep serving until Ctrl-C, then close."""
        try:
            while self._thread.is_alive():
                self._thread.join(1.0)
        except KeyboardInterrupt:
            pass
        finally:
            self.close()

    def close(self) -> None:
        """Stop the server and free its port; a second call does nothing."""
        if not self.closed:
            self.closed = True
            self._server.shutdown()
            self._server.server_close()
            self._thread.join()

    def __enter__(self) -> Viewer:
        """Return the viewer itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close."""
        self.close()

    def _serve(self) -> None:
        self._server.serve_forever(poll_interval=CLOSE_DELAY)

    def _handler(self) -> type[BaseHTTPRequestHandler]:
        viewer = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                found = self.path.split("?")[0] == "/"
                page = viewer._page if found else b""
                self.send_response(200 if found else 404)
                self.send_header("Content-Type", "text/html; charset=utf-8")
                self.send_header("Content-Length", str(len(page)))
                self.send_header("Cache-Control", "no-store")
                self.end_headers()
                self.wfile.write(page)
                if found:
                    self.wfile.flush()
                    viewer.fetched.set()

            def log_message(self, format: str, *args: Any) -> None:
                """Stay quiet."""

        return Handler
