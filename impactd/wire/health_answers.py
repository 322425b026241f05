"""What the rig's state looks like on the wire."""

# ruff: noqa: N815 - units are written as SI writes them

from __future__ import annotations

from typing import Any

from pydantic import Field

from impactd.wire.answers import Answer


class RigCheck(Answer):
    """One thing that was looked at before drops."""

    name: str = Field(description="digitizer, valve, sphere, input, disk or calibration.")
    ok: bool
    sentence: str
    remedy: str


class Device(Answer):
    """A device as it told who it is."""

    name: str
    sentence: str
    answers: bool


class Disk(Answer):
    """The disk of the archive."""

    free_bytes: int
    reserve_bytes: int = Field(description="Drops end when less is free.")
    total_bytes: int
    shots_left: int = Field(description="Records that fit above the reserve.")


class NoiseTrend(Answer):
    """Noise before the trigger of the latest shots, oldest first."""

    numbers: list[int]
    started_utc: list[str]
    noise_rms_V: list[float]
    highest_allowed_V: float


class RigHealth(Answer):
    """How the rig was found at the last look."""

    sentence: str
    attention: str = Field(description="What to look at before the next sphere; may be empty.")
    checks: list[RigCheck]
    devices: list[Device]
    disk: Disk
    noise: NoiseTrend
    calibration: dict[str, Any]
    valve_has_gauge: bool
