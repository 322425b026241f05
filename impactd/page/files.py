"""The files of the page, read once: what is not in this list is not served."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from impactd.reports.charts import plotly_file

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
    found = files_below(STATIC, _MEDIA_TYPES)
    plotly = plotly_file()
    if plotly is not None:
        found[PLOTLY_NAME] = _page_file(plotly, _MEDIA_TYPES[".js"])
    return found


def files_below(
    folder: Path, media_types: Mapping[str, str], *, other: str | None = None
) -> dict[str, PageFile]:
    """Return the files of a folder and its folders by their path in it.

    Parameters
    ----------
    media_types : mapping of str to str
        By ending.
    other : str, optional
        The media type of every other ending; without it such files are left out.
    """
    return {
        path.relative_to(folder).as_posix(): _page_file(path, kind)
        for path in sorted(folder.rglob("*"))
        if path.is_file() and (kind := media_types.get(path.suffix, other)) is not None
    }


def _page_file(path: Path, media_type: str) -> PageFile:
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    return PageFile(path, media_type, f'"{digest[:32]}"')
