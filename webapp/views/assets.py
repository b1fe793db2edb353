"""Styles, scripts and symbols, and how text travels.

The address of such a file changes whenever any of them does: it holds a digest of the whole folder, so that scripts
that import one another by relative addresses are always of one release, and a browser may keep what it has for good.
"""

import gzip
import hashlib
import mimetypes
from collections.abc import Mapping
from pathlib import Path

from flask import Flask, Response, abort, request

from webapp.views.security import vary_by

MAX_AGE_S = 365 * 24 * 3600
# Below this a response is in its first packet either way.
_MIN_PACKED_BYTES = 600
_PACKED_TYPES = frozenset(
    {"application/javascript", "application/json", "image/svg+xml", "text/css", "text/html", "text/javascript"}
)


def init_assets(app: Flask, folder: Path) -> None:
    """Serve the files of a folder as they are now, by the endpoint `static`; let every text travel packed."""
    files = {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}

    def _send(filename: str) -> Response:
        if filename not in files:
            abort(404)
        response = Response(files[filename], mimetype=mimetypes.guess_type(filename)[0])
        response.cache_control.public = True
        response.cache_control.max_age = MAX_AGE_S
        response.cache_control.immutable = True
        return response

    base = f"/static/{digest_of(files)}"
    app.add_url_rule(f"{base}/<path:filename>", "static", _send)
    # Each page names a dozen of them.
    app.jinja_env.globals["asset"] = {name: f"{base}/{name}" for name in files}.__getitem__
    app.after_request(_pack)


def digest_of(files: Mapping[str, bytes]) -> str:
    """Return twelve hexadecimal digits that change with the name or the content of any file."""
    digest = hashlib.sha256()
    for name, content in sorted(files.items()):
        digest.update(f"{name}\0{len(content)}\0".encode() + content)
    return digest.hexdigest()[:12]


def _pack(response: Response) -> Response:
    """Compress a text for browsers that can unpack it.

    The length of a packed page can tell a secret in it to somebody who makes a browser ask for it again and again with
    guesses in the address, where the page repeats the address. No page of ours holds both.
    """
    if response.mimetype not in _PACKED_TYPES or response.direct_passthrough or response.is_streamed:
        return response
    vary_by(response, "Accept-Encoding")
    content = response.get_data()
    if len(content) >= _MIN_PACKED_BYTES and request.accept_encodings["gzip"] > 0:
        response.set_data(gzip.compress(content, compresslevel=6, mtime=0))
        response.content_encoding = "gzip"
    return response
