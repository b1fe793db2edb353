"""One person's browser as a load generator needs it: a connection that is kept, cookies, redirects.

It speaks plain HTTP/1.1 over asyncio and does as little as possible: what the generator spends is taken from the
servers on the same machine.
"""

import asyncio
import time
import zlib
from dataclasses import dataclass, field
from types import TracebackType
from typing import Self
from urllib.parse import urlencode

TIMEOUT_S = 60.0
"""Who waits longer for a response is counted as cut off."""

_GZIP = 16 + zlib.MAX_WBITS
_REDIRECTS = frozenset({301, 302, 303, 307})


class CutOffError(ConnectionError):
    """The server did not answer, or answered with something that is no page."""


@dataclass(frozen=True, slots=True)
class Response:
    """What came back.

    Attributes:
        status: The status code.
        location: Where a redirect leads, without the host; empty for other responses.
        text: The body, unpacked.
    """

    status: int
    location: str
    text: str

    @property
    def leads_on(self) -> bool:
        """Whether it is a redirect."""
        return self.status in _REDIRECTS


@dataclass
class Browser:
    """A browser with one connection.

    Attributes:
        host: Such as 127.0.0.1.
        port: Where the server listens.
        cookies: By name.
        seconds: By kind of request (`page`, `post`, `picture`), how long each took.
    """

    host: str
    port: int
    cookies: dict[str, str] = field(default_factory=dict)
    seconds: dict[str, list[float]] = field(default_factory=lambda: {"page": [], "post": [], "picture": []})
    _streams: tuple[asyncio.StreamReader, asyncio.StreamWriter] | None = None

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._close()

    async def get(self, path: str, kind: str = "page") -> Response:
        """Ask for an address.

        Raises:
            CutOffError: No response came.
        """
        return await self._ask("GET", path, b"", kind)

    async def post(self, path: str, form: dict[str, str]) -> Response:
        """Send a form.

        Raises:
            CutOffError: No response came.
        """
        return await self._ask("POST", path, urlencode(form).encode(), "post")

    async def _ask(self, method: str, path: str, body: bytes, kind: str) -> Response:
        began = time.perf_counter()
        try:
            async with asyncio.timeout(TIMEOUT_S):
                response = await self._exchange(method, path, body)
        except (OSError, EOFError, TimeoutError, ValueError) as error:
            self._close()
            raise CutOffError(f"{method} {path.split('?', maxsplit=1)[0]}: {type(error).__name__} {error}") from error
        self.seconds[kind].append(time.perf_counter() - began)
        return response

    async def _exchange(self, method: str, path: str, body: bytes) -> Response:
        is_kept = self._streams is not None
        try:
            return await self._try(method, path, body)
        except (ConnectionError, EOFError):
            # A kept connection that the server has closed meanwhile: browsers open another one without a word.
            self._close()
            if not is_kept:
                raise
            return await self._try(method, path, body)

    async def _try(self, method: str, path: str, body: bytes) -> Response:
        if self._streams is None:
            self._streams = await asyncio.open_connection(self.host, self.port)
        reader, writer = self._streams
        writer.write(self._head(method, path, len(body)) + body)
        head = (await reader.readuntil(b"\r\n\r\n")).decode("latin-1")
        status_line, *lines = head.split("\r\n")
        headers = {name.lower(): value.strip() for name, _, value in (line.partition(":") for line in lines)}
        for line in lines:
            if line.lower().startswith("set-cookie:"):
                self._keep(line.partition(":")[2])
        content = await _body(reader, headers)
        if headers.get("content-encoding") == "gzip":
            content = zlib.decompress(content, _GZIP)
        if headers.get("connection", "").lower() == "close":
            self._close()
        location = headers.get("location", "")
        if "://" in location:
            location = "/" + location.split("/", 3)[3]
        is_text = headers.get("content-type", "").startswith("text/")
        return Response(int(status_line.split(" ", 2)[1]), location, content.decode() if is_text else "")

    def _head(self, method: str, path: str, length: int) -> bytes:
        lines = [
            f"{method} {path} HTTP/1.1",
            f"Host: {self.host}:{self.port}",
            "Accept: text/html,*/*",
            "Accept-Encoding: gzip",
            "Accept-Language: en",
            "Sec-Fetch-Site: same-origin",
        ]
        if self.cookies:
            lines.append("Cookie: " + "; ".join(f"{name}={value}" for name, value in self.cookies.items()))
        if method == "POST":
            lines += ["Content-Type: application/x-www-form-urlencoded", f"Content-Length: {length}"]
        return ("\r\n".join(lines) + "\r\n\r\n").encode()

    def _keep(self, cookie: str) -> None:
        name, _, value = cookie.partition(";")[0].strip().partition("=")
        if value.strip('"'):
            self.cookies[name] = value
        else:
            self.cookies.pop(name, None)

    def _close(self) -> None:
        if self._streams is not None:
            self._streams[1].close()
            self._streams = None


async def _body(reader: asyncio.StreamReader, headers: dict[str, str]) -> bytes:
    if headers.get("transfer-encoding", "").lower() != "chunked":
        return await reader.readexactly(int(headers.get("content-length", "0")))
    parts = []
    while length := int(await reader.readline(), 16):
        parts.append(await reader.readexactly(length))
        await reader.readexactly(2)
    await reader.readexactly(2)
    return b"".join(parts)
