"""meshcat's own server with a page for runs that are being computed.

It is the server that `meshcat.Visualizer` talks to, in a thread of this process: its ports are those that meshcat takes (7000 for pages,
6000 for Visualizers, or the next free ones), and `Visualizer(zmq_url=...)` adds objects of one's own to the picture. Pages get the frames
of a run through meshcat's socket; what people do on a page comes back through a second socket. All of it listens on this machine only, and
answers only to pages that it has served.
"""

from __future__ import annotations

import asyncio
import json
import threading
from collections.abc import Callable
from importlib import resources
from typing import Any

import tornado.ioloop
import tornado.web
import tornado.websocket
import umsgpack
from meshcat.servers.zmqserver import StaticFileHandlerNoCache, WebSocketHandler, ZMQWebSocketBridge

from rigidimpulse.view.page import fill_template, viewer_files
from rigidimpulse.view.server import HOST

SCRIPTS = ("player.js", "arrows_growing.js", "live_timeline.js", "controls.js", "live_stage.js", "throw.js", "live.js")
"""Files of this folder's `page/`."""
SHARED_SCRIPTS = (
    "elements.js", "numbers.js", "theme.js", "look.js", "room.js", "stage.js", "arrows.js", "soft_bodies.js", "plot.js", "clusters.js",
    "timeline.js", "hud.js",
)  # fmt: skip
"""Those of the recorded page that the live page uses, too."""
START_TIMEOUT = 10.0
"""Longest wait, s, for the server to begin."""

Command = dict[str, Any]


class LiveServer:
    """meshcat's server and the live page; `on_command` is called, in the server's thread, with what people do on a page."""

    def __init__(self, title: str, on_command: Callable[[Command], None]) -> None:
        """Start serving.

        Raises:
            OSError: no port is free.

        """
        self._begun = threading.Event()
        self._failure: BaseException | None = None
        self._kept: dict[str, list[bytes]] = {}
        self._arguments = (_page(title), on_command)
        self._thread = threading.Thread(target=self._serve, name="rigidimpulse-live", daemon=True)
        self._thread.start()
        if not self._begun.wait(START_TIMEOUT) or self._failure is not None:
            raise OSError("the live page's server did not start") from self._failure

    def _serve(self) -> None:
        """Run the server's loop until `close`."""
        self._loop = asyncio.new_event_loop()
        asyncio.set_event_loop(self._loop)
        try:
            self._bridge = Bridge(*self._arguments, self._kept)
        except BaseException as error:
            self._failure = error
            self._begun.set()
            return
        self.url, self.zmq_url = str(self._bridge.web_url), str(self._bridge.zmq_url)
        self._loop.call_soon(self._begun.set)
        self._loop.run_forever()
        self._bridge.close()
        self._loop.run_until_complete(self._loop.shutdown_asyncgens())
        self._loop.close()

    def publish(self, kind: str, message: dict[str, Any], keep: bool = True) -> None:
        """Send a meshcat message to all pages, and to those that are opened later if it is kept.

        Args:
            kind: messages of one kind are kept together, for `forget`.
            message: see `messages`.
            keep: False: only pages that are open now get it.

        """
        data = umsgpack.packb(message)
        self._loop.call_soon_threadsafe(self._send, kind, data, keep)

    def forget(self, kind: str) -> None:
        """Do not send the messages of this kind to pages that are opened later."""
        self._loop.call_soon_threadsafe(self._kept.pop, kind, None)

    def _send(self, kind: str, data: bytes, keep: bool) -> None:
        if keep:
            self._kept.setdefault(kind, []).append(data)
        self._bridge.broadcast(data)

    @property
    def num_pages(self) -> int:
        """How many pages are open."""
        return len(self._bridge.websocket_pool)

    def close(self) -> None:
        """Stop serving; a second call does nothing."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._loop.stop)
            self._thread.join()


class Bridge(ZMQWebSocketBridge):
    """meshcat's bridge from ZMQ to pages, on this machine only, with the live page in the place of its own."""

    def __init__(self, page: str, on_command: Callable[[Command], None], kept: dict[str, list[bytes]]) -> None:
        """Begin to listen; kept: messages for pages that are opened later, by kind."""
        self._page, self._on_command, self._kept = page, on_command, kept
        super().__init__(host=HOST)

    def make_app(self) -> tornado.web.Application:
        """Return meshcat's application, with our page where its own was; only for those that ask for this machine by its name."""
        known = {"path": str(viewer_files())}
        page = {"page": self._page}
        app = LocalApplication(log_function=lambda handler: None)
        app.add_handlers(r"^(127\.0\.0\.1|localhost)$", [
            (r"/static/?", Page, page),
            (r"/static/(.*)", StaticFileHandlerNoCache, known),
            (r"/live", CommandSocket, {"on_command": self._on_command}),
            (r"/", SceneSocket, {"bridge": self}),
        ])  # fmt: skip
        return app

    def send_scene(self, websocket: tornado.websocket.WebSocketHandler) -> None:
        """Tell a page that was just opened everything that there is."""
        super().send_scene(websocket)
        for messages in list(self._kept.values()):
            for message in messages:
                _write(websocket, message)

    def broadcast(self, data: bytes) -> None:
        """Send a message to all pages."""
        for websocket in list(self.websocket_pool):
            _write(websocket, data)

    def close(self) -> None:
        """Free the ports."""
        for websocket in list(self.websocket_pool):
            websocket.close()
        if isinstance(self.app, LocalApplication):
            self.app.server.stop()
        self.zmq_stream.close()


class LocalApplication(tornado.web.Application):
    """An application that listens on this machine only, wherever it is told to."""

    server: Any = None

    def listen(self, port: int, address: str | None = None, **settings: Any) -> Any:
        """Listen on a port of 127.0.0.1."""
        self.server = super().listen(port, address=HOST, **settings)
        return self.server


class Page(tornado.web.RequestHandler):
    """The live page, at the address of meshcat's own."""

    def initialize(self, page: str) -> None:
        """Take the page's text."""
        self._page = page

    def get(self) -> None:
        """Send the page."""
        self.set_header("Cache-Control", "no-store")
        self.write(self._page)


class SceneSocket(WebSocketHandler):
    """meshcat's socket, quiet; without a socket's header the address leads to the page."""

    async def get(self, *arguments: Any, **named: Any) -> None:
        """Open the socket, or lead a browser to the page."""
        if self.request.headers.get("Upgrade", "").lower() == "websocket":
            await super().get(*arguments, **named)
        else:
            self.redirect("/static/")

    def open(self, *_: str, **__: str) -> None:
        """Join the pages that are told everything."""
        self.set_nodelay(True)
        self.bridge.websocket_pool.add(self)
        self.bridge.send_scene(self)

    def on_close(self) -> None:
        """Leave them."""
        self.bridge.websocket_pool.discard(self)


class CommandSocket(tornado.websocket.WebSocketHandler):
    """Brings what people do on a page: JSON objects with `do`."""

    def initialize(self, on_command: Callable[[Command], None]) -> None:
        """Take the function that is told."""
        self._on_command = on_command

    def on_message(self, message: str | bytes) -> None:
        """Hand a command on; what is none is left alone."""
        try:
            command = json.loads(message)
        except ValueError:
            return
        if isinstance(command, dict):
            self._on_command(command)


def _write(websocket: tornado.websocket.WebSocketHandler, data: bytes) -> None:
    """Send a message to a page; one that has just been closed misses nothing."""
    try:
        sent = asyncio.ensure_future(websocket.write_message(data, binary=True))
    except tornado.websocket.WebSocketClosedError:
        return
    sent.add_done_callback(lambda done: done.cancelled() or done.exception())  # asked for, so that asyncio does not report it


def _page(title: str) -> str:
    """Return the live page."""
    import html

    own = resources.files("rigidimpulse.view.live") / "page"
    shared = resources.files("rigidimpulse.view") / "page"
    scripts = [(shared / name).read_text(encoding="utf-8") for name in SHARED_SCRIPTS]
    scripts += [(own / name).read_text(encoding="utf-8") for name in SCRIPTS]
    fields = {
        "title": html.escape(title),
        "style": "".join(file.read_text(encoding="utf-8") for file in (shared / "page.css", shared / "layout.css", own / "live.css")),
        "bar": (shared / "bar.html").read_text(encoding="utf-8"),
        "script": "\n".join(scripts),
    }
    return fill_template((own / "live.html").read_text(encoding="utf-8"), fields)
