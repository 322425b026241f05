"""Charts that answer the mouse, in a page that is still one file: the drawing library goes inside.

A page with charts has ``<script type="application/json" id="charts">``. `with_library` completes
it where it is written or served, so that the archive does not keep the library with every page.
"""

from __future__ import annotations

import base64
import gzip
import hashlib
import importlib.util
from functools import cache
from importlib import resources
from pathlib import Path

_LOADER = resources.files("impactd.reports").joinpath("charts.js").read_text(encoding="utf-8")

_LOADER_DIGEST = base64.b64encode(hashlib.sha256(_LOADER.encode()).digest()).decode()

REPORT_POLICY = (
    "default-src 'none'; style-src 'unsafe-inline'; img-src data:; frame-ancestors 'none'; "
    f"script-src 'sha256-{_LOADER_DIGEST}' blob:"
)
"""Content security policy of a report, which is complete in itself: its styles, its pictures and
the one script are inside, the loader known by its digest, with what it unpacks."""


def with_library(page: str) -> str:
    """Return a page with all that its charts need; as it is if it has none, or plotly is missing.

    Packed, plotly is 2 MB rather than 4.8 MB; every browser since 2023 can unpack it.
    """
    if 'id="charts"' not in page or plotly_file() is None:
        return page
    before, end, after = page.rpartition("</body>")
    packed = f'<script type="text/plain" id="plotly">{_packed_plotly()}</script>\n'
    return f'{before}{packed}<script id="draw">{_LOADER}</script>\n{end}{after}'


@cache
def plotly_file() -> Path | None:
    """Return plotly's JavaScript, which comes with its Python package; None if not installed."""
    # Found, never imported: one file of the package is needed and none of its code.
    spec = importlib.util.find_spec("plotly")
    if spec is None or spec.origin is None:
        return None
    path = Path(spec.origin).parent / "package_data" / "plotly.min.js"
    return path if path.is_file() else None


@cache
def _packed_plotly() -> str:
    file = plotly_file()
    assert file is not None
    return base64.b64encode(gzip.compress(file.read_bytes(), mtime=0)).decode()
