"""Fits that crash, hang or eat memory, by the number of their shot; workers import this."""

from __future__ import annotations

import json
import os
import re
import time
from typing import Any

import numpy as np

from impactd.jobs import tasks

KINDS = ("crashes", "hangs", "eats memory", "is well")
"""Of shots 1, 2, 3 and 4."""


def fit_shot(order: dict[str, Any]) -> dict[str, Any]:
    """Do what the shot's number says; only the last one is a fit."""
    found = re.search(r"(\d{6})\.h5", json.dumps(order))
    kind = KINDS[int(found[1]) - 1] if found else "is well"
    if kind == "crashes":
        os.abort()
    while kind == "hangs":
        time.sleep(1)
    held = []
    while kind == "eats memory":
        # In leaps and untouched: a starved host is no slower at it than any other.
        held.append(np.empty(25_000_000))
    return tasks.fit_shot(order)
