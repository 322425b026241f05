"""What import, export, verify and reindex do."""

from __future__ import annotations
