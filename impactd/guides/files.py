"""The files of the built manual, read once: what is not in this list is not served."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from impactd.page.files import PageFile, files_below

SITE = Path(__file__).parent / "site"
"""Where `make docs` builds it, and where a wheel carries it."""
FIRST = "impactd/guides/README.html"
"""The page that the manual begins with."""
DOWNLOADS = "_downloads/"
"""Below it are files of the repository that pages link to: sources, settings, a report."""
_LAST_WRITTEN = "searchindex.js"
_MEDIA_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
    ".png": "image/png",
}
_TEXT = "text/plain; charset=utf-8"


def manual_is_built() -> bool:
    """Tell whether there is a manual to be served; without reading it."""
    return (SITE / _LAST_WRITTEN).is_file()


def guide_files() -> dict[str, PageFile]:
    """Return every file of the manual by its name below ``/guides/``; none where none was built."""
    try:
        built_ns = (SITE / _LAST_WRITTEN).stat().st_mtime_ns
    except FileNotFoundError:
        return {}
    return _files(built_ns)


@lru_cache(maxsize=1)
def _files(_built_ns: int) -> dict[str, PageFile]:
    """Return the files of one build."""
    downloads = files_below(SITE / DOWNLOADS, {".html": _MEDIA_TYPES[".html"]}, other=_TEXT)
    found = {f"{DOWNLOADS}{name}": file for name, file in downloads.items()}
    return files_below(SITE, _MEDIA_TYPES) | found
