"""A recording that was refused, as a line of a report."""

from __future__ import annotations

from impactd.aliases import Json


def rejected_words(item: Json) -> str:
    """Return what a result says of a refused recording.

    Parameters
    ----------
    item : dict
        An item of ``rejected``; the path is empty where the recording stands in no campaign file.
    """
    where = f" ({item['path']})" if item["path"] else ""
    return f"Rejected: {item['name']}{where}: {item['reason']}"
