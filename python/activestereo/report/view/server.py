# SPDX-License-Identifier: Apache-2.0
"""Serves the page's files and calls over HTTP on the loopback address. It answers only requests of its own page. A bad
request gets one line and costs one connection."""

from __future__ import annotations

import hmac
import json
import secrets
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from contextvars import copy_context
from functools import partial
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from activestereo.report.page import web_file

Call = Callable[[dict[str, Any]], bytes]
HOSTS = ("127.0.0.1", "localhost")
LARGEST_BODY_BYTES = 1 << 20
_JSON = "application/json"

# The page's files: {name: (file in report/web, content type)}.
_FILES = {
    "": ("view/view.html", "text/html"),
    "view.css": ("view/view.css", "text/css"),
    "page.css": ("page.css", "text/css"),
}
_FILES |= {name: (name, "text/javascript") for name in ("picture.js", "zoom.js")}
_SCRIPTS = "server.js", "dots.js", "sliders.js", "cloud.js", "view.js"
_FILES |= {name: (f"view/{name}", "text/javascript") for name in _SCRIPTS}
_SAFETY = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src data:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
# A connection that sends nothing for this time is closed.
_SILENCE_S = 20.0
_MOST_CONNECTIONS = 64
# A render takes seconds, and renders run one after the other: calls beyond this limit would wait for minutes.
_MOST_CALLS = 16
_BUSY = f"this server is busy: it takes {_MOST_CALLS} calls on {_MOST_CONNECTIONS} connections at a time; ask again"


class Refused(Exception):
    """Reports a refused request. args: its HTTP status, and one line with the reason."""


class ViewServer(ThreadingHTTPServer):
    """Serves the page at `address`. calls: {name: function from the call's JSON object to the answer}; the page shows
    their ValueErrors and OSErrors. port: 0 for a free one. token: a secret, with which all served paths begin."""

    daemon_threads = True
    request_queue_size = 2 * _MOST_CONNECTIONS

    def __init__(self, calls: Mapping[str, Call], port: int = 0) -> None:
        self._free = threading.BoundedSemaphore(_MOST_CONNECTIONS)
        self.free_calls = threading.BoundedSemaphore(_MOST_CALLS)
        super().__init__((HOSTS[0], port), partial(_Handler, calls, copy_context()))
        self.token = secrets.token_urlsafe(24)
        self.address = f"http://{HOSTS[0]}:{self.server_port}/{self.token}/"

    def process_request(self, request: Any, client_address: Any) -> None:
        """Starts a thread for a connection, or refuses it beyond a limit."""
        if not self._free.acquire(blocking=False):
            with suppress(OSError):
                request.settimeout(0.0)
                head = f"HTTP/1.1 503 Service Unavailable\r\nContent-Length: {len(_BUSY)}\r\nConnection: close\r\n\r\n"
                request.sendall((head + _BUSY).encode())
            self.shutdown_request(request)
            return
        super().process_request(request, client_address)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._free.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Stays silent on a broken connection: the client has gone."""


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    timeout = _SILENCE_S
    server: ViewServer

    def __init__(self, calls: Mapping[str, Call], context: Any, *connection: Any) -> None:
        self._calls, self._context = calls, context
        super().__init__(*connection)

    def do_GET(self) -> None:
        def file(name: str) -> tuple[bytes, str]:
            if name not in _FILES:
                raise Refused(HTTPStatus.NOT_FOUND, "there is no such file")
            place, kind = _FILES[name]
            return web_file(place).encode(), kind

        self._answer(file)

    def do_POST(self) -> None:
        self._answer(self._call)

    def log_message(self, format: str, *args: Any) -> None:
        """Prints nothing, because requests carry the token."""

    def version_string(self) -> str:
        return "activestereo"

    def _answer(self, make: Callable[[str], tuple[bytes, str]]) -> None:
        try:
            content, kind = make(self._inner_path())
        except Refused as refusal:
            status, text = refusal.args
        except (ValueError, OSError, RuntimeError) as error:
            status, text = HTTPStatus.BAD_REQUEST, " ".join(str(error).split())
        except Exception as error:  # a fault of the program: the page shows it, and the next call is answered
            status, text = HTTPStatus.INTERNAL_SERVER_ERROR, f"a fault of the program: {error!r}"
        else:
            self._send(HTTPStatus.OK, content, kind)
            return
        self._send(status, text.encode(errors="backslashreplace"), "text/plain")  # JSON may hold half a character

    def _inner_path(self) -> str:
        """Returns the request's path after the token, without a query. Raises Refused for a wrong host, token or
        origin.

        A page of another origin may send requests here, and a name that it owns may resolve to this address.
        """
        port, host = self.server.server_port, self.headers.get("Host", "")
        if host not in {f"{own}:{port}" for own in HOSTS}:
            raise Refused(HTTPStatus.FORBIDDEN, f"this server is {HOSTS[0]}:{port} and answers to no other name")
        if self.headers.get("Origin", f"http://{host}") != f"http://{host}":
            raise Refused(HTTPStatus.FORBIDDEN, "pages of other origins are not answered")
        if self.headers.get("Sec-Fetch-Site", "none") not in ("none", "same-origin"):
            raise Refused(HTTPStatus.FORBIDDEN, "pages of other sites are not answered")
        empty, token, *rest = self.path.partition("?")[0].split("/")
        if empty or not rest or not hmac.compare_digest(token.encode("utf-8", "replace"), self.server.token.encode()):
            raise Refused(HTTPStatus.NOT_FOUND, "there is nothing here: open the whole address that was printed")
        return "/".join(rest)

    def _body_bytes(self) -> int:
        """Returns the size of a call's body in bytes. Raises Refused if the origin, the size or the JSON content type
        is missing, or the body is too large."""
        if self.headers.get("Origin") is None:
            raise Refused(HTTPStatus.FORBIDDEN, "a call needs the header Origin")
        if self.headers.get("Content-Type", "").partition(";")[0].strip().lower() != _JSON:
            raise Refused(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, f"a call's body is {_JSON}")
        length = self.headers.get("Content-Length", "")
        if not (length.isascii() and length.isdecimal() and len(length) <= 9):
            raise Refused(HTTPStatus.LENGTH_REQUIRED, "a call needs the header Content-Length, a whole number of bytes")
        if int(length) > LARGEST_BODY_BYTES:
            most = f"{LARGEST_BODY_BYTES} bytes"
            raise Refused(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, f"the body has {length} bytes, at most {most} are read")
        return int(length)

    def _call(self, name: str) -> tuple[bytes, str]:
        body = self.rfile.read(self._body_bytes())
        if name not in self._calls:
            raise Refused(HTTPStatus.NOT_FOUND, "there is no such call")
        try:
            given = json.loads(body)
        except (ValueError, RecursionError):
            raise ValueError("the call's body is no JSON") from None
        if not isinstance(given, dict):
            raise ValueError("the call's body is no JSON object")
        if not self.server.free_calls.acquire(blocking=False):
            raise Refused(HTTPStatus.SERVICE_UNAVAILABLE, _BUSY)
        try:  # the command line's permissions, a context variable, hold in this thread too
            return self._context.copy().run(self._calls[name], given), "application/octet-stream"
        finally:
            self.server.free_calls.release()

    def _send(self, status: HTTPStatus, content: bytes, kind: str) -> None:
        self.close_connection = self.close_connection or status is not HTTPStatus.OK
        self.send_response(status)
        self.send_header("Content-Type", f"{kind}; charset=utf-8" if kind.startswith("text") else kind)
        self.send_header("Content-Length", str(len(content)))
        if self.close_connection:
            self.send_header("Connection", "close")
        for name, value in _SAFETY.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(content)
