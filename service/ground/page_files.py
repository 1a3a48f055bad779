"""The page's files, read once: nothing else can ever be asked for."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from importlib.resources import files
from typing import Final

_TYPES: Final = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
}


@dataclass(frozen=True)
class PageFile:
    """One file.

    Args:
        data: its bytes.
        media_type: for Content-Type.
        etag: of these bytes.
    """

    data: bytes
    media_type: str
    etag: str


def load_page() -> dict[str, PageFile]:
    """The files by the path that they are asked for with; the page itself is `/`."""
    page = {}
    for item in files("service.ground").joinpath("page").iterdir():
        media_type = _TYPES.get("." + item.name.rpartition(".")[2])
        if media_type is None or not item.is_file():
            continue
        data = item.read_bytes()
        path = "/" if item.name == "index.html" else f"/{item.name}"
        page[path] = PageFile(data, media_type, f'"{hashlib.sha256(data).hexdigest()[:32]}"')
    return page
