"""Values without NaN, infinity and lone surrogates, as JSON requires."""

from __future__ import annotations

import math
from typing import Any


def without_nan(value: Any) -> Any:
    """Return a JSON-ready value in which every non-finite number is ``None``.

    ``value`` has nested dicts, lists and tuples of plain values or numpy scalars; tuples become
    lists, numpy scalars and arrays plain values.
    """
    if isinstance(value, str):
        # A lone surrogate is valid in a JSON escape and in no UTF-8 answer.
        return value.encode("utf-8", "replace").decode()
    if isinstance(value, dict):
        return {without_nan(str(key)): without_nan(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [without_nan(item) for item in value]
    if hasattr(value, "tolist"):  # numpy, without importing it here
        return without_nan(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value
