"""The names of the base models, without importing the equations."""

from __future__ import annotations

from typing import Final

BASE_MODELS = {
    "hsd": "Hertz contact on a rigid load cell: force is volts times a constant",
    "kv": "Hertz contact on a Kelvin-Voigt load cell: crystal mass, stiffness and damping",
    "kv2": "kv, physically closed: third law, the coupon's mass, no tension, a fall in air",
}
RINGING_BASES: Final = ("kv2", "kv")
"""Those whose cell is a mass on a spring."""
DEFAULT_BASE: Final = "kv2"
"""The base of a real rig: fits, calibrations and diagnoses start from it unless told otherwise."""
