"""A type alias that most modules use."""

from __future__ import annotations

from typing import Any

Json = dict[str, Any]
"""What JSON calls an object."""
