# SPDX-License-Identifier: Apache-2.0
"""Decides which requests are answered: those of the page at its own address, and no other page's."""

from __future__ import annotations

import hmac
from dataclasses import dataclass
from email.message import Message
from http import HTTPStatus

HOSTS = ("127.0.0.1", "localhost")
LARGEST_BODY_BYTES = 1 << 20
_JSON = "application/json"


class Refused(Exception):
    """A refused request; the text is one line with the reason."""

    def __init__(self, status: HTTPStatus, text: str) -> None:
        super().__init__(text)
        self.status = status


@dataclass(frozen=True)
class Guard:
    """The address of one server: its port, and the token that its paths begin with."""

    port: int
    token: str

    def inner_path(self, path: str, headers: Message) -> str:
        """The path below the token, without a query. Refused for another host, token or origin: a page of another
        origin may send requests here, and a name that it owns may lead here."""
        hosts = {f"{host}:{self.port}" for host in HOSTS}
        host = headers.get("Host", "")
        if host not in hosts:
            raise Refused(HTTPStatus.FORBIDDEN, f"this server is {HOSTS[0]}:{self.port} and answers to no other name")
        origin = headers.get("Origin")
        if origin is not None and origin != f"http://{host}":
            raise Refused(HTTPStatus.FORBIDDEN, "pages of other origins are not answered")
        if headers.get("Sec-Fetch-Site", "none") not in ("none", "same-origin"):
            raise Refused(HTTPStatus.FORBIDDEN, "pages of other sites are not answered")
        empty, token, *rest = path.partition("?")[0].split("/")
        if empty or not rest or not hmac.compare_digest(token.encode("utf-8", "replace"), self.token.encode()):
            raise Refused(HTTPStatus.NOT_FOUND, "there is nothing here: open the whole address that was printed")
        return "/".join(rest)

    def body_bytes(self, headers: Message) -> int:
        """The size of a call's body. Refused without an origin, for another kind of content, and without a size or
        beyond the largest."""
        if headers.get("Origin") is None:
            raise Refused(HTTPStatus.FORBIDDEN, "a call needs the header Origin")
        if headers.get("Content-Type", "").partition(";")[0].strip().lower() != _JSON:
            raise Refused(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, f"a call's body is {_JSON}")
        length = headers.get("Content-Length", "")
        if not (length.isascii() and length.isdecimal() and len(length) <= 9):
            raise Refused(HTTPStatus.LENGTH_REQUIRED, "a call needs the header Content-Length, a whole number of bytes")
        if int(length) > LARGEST_BODY_BYTES:
            most = f"{LARGEST_BODY_BYTES} bytes"
            raise Refused(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, f"the body has {length} bytes, at most {most} are read")
        return int(length)
