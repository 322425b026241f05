"""One self-contained page that says what was seen, what it is, and what it changes."""

from __future__ import annotations

import html
from pathlib import Path
from typing import Any

Json = dict[str, Any]


def write_report(file: Path, document: Json) -> None:
    """Write the page.

    Parameters
    ----------
    file : Path
        Where to.
    document : dict
        ``impactd-diagnosis/1``.
    """
    file.write_text(page(document), encoding="utf-8")


def page(document: Json) -> str:
    """Return the page.

    Parameters
    ----------
    document : dict
        ``impactd-diagnosis/1``.

    Returns
    -------
    str
        HTML, complete in itself.
    """
    said = html.escape(document["sentence"])
    return f"<!doctype html><title>impactd diagnosis</title><p>{said}</p>"
