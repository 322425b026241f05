"""The files of the page, read once: what is not in this list is not served."""

from __future__ import annotations

import hashlib
import importlib.util
from dataclasses import dataclass
from functools import cache
from pathlib import Path

STATIC = Path(__file__).parent / "static"
PLOTLY_NAME = "vendor/plotly.min.js"
"""Where the page finds the drawing library, which comes with the Python package ``plotly``."""

_MEDIA_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
}


@dataclass(frozen=True)
class PageFile:
    """One file as it goes over the wire.

    Attributes
    ----------
    media_type : str
        For ``Content-Type``.
    etag : str
        Of its content, in quotes.
    """

    path: Path
    media_type: str
    etag: str


@cache
def page_files() -> dict[str, PageFile]:
    """Return every file of the page by its name below ``/page/``.

    Returns
    -------
    dict of str to PageFile
        Without the drawing library where the package ``plotly`` is not installed; the page then
        says so in place of its charts.
    """
    found = {
        path.relative_to(STATIC).as_posix(): path
        for path in sorted(STATIC.rglob("*"))
        if path.suffix in _MEDIA_TYPES
    }
    plotly = _plotly()
    if plotly is not None:
        found[PLOTLY_NAME] = plotly
    return {name: _page_file(path) for name, path in found.items()}


def _page_file(path: Path) -> PageFile:
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    return PageFile(path, _MEDIA_TYPES[path.suffix], f'"{digest[:32]}"')


def _plotly() -> Path | None:
    # Found, never imported: the daemon needs one file of the package and none of its code.
    spec = importlib.util.find_spec("plotly")
    if spec is None or spec.origin is None:
        return None
    path = Path(spec.origin).parent / "package_data" / "plotly.min.js"
    return path if path.is_file() else None
