"""Whether a diagnosis repaired the model, so that there is a before and an after."""

from __future__ import annotations

from typing import Any

MEAN_WAVEFORM = "mean of the other hits"
"""What stands beside before and after: a prediction without any model."""


def is_repaired(document: dict[str, Any]) -> bool:
    """Return whether a diagnosis names effects or learned a closure.

    Parameters
    ----------
    document : dict
        ``impactd-diagnosis/1``.

    Returns
    -------
    bool
        False where the model explains the data, or where what is there anyway is no part of it.
    """
    return bool(document["effects"]) or document.get("closure") is not None
