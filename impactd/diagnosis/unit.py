"""The unit in which a page shows what was recorded."""

from __future__ import annotations

from dataclasses import dataclass

from impactd.aliases import Json


@dataclass(frozen=True)
class Unit:
    """A unit for signals and residuals.

    Attributes
    ----------
    label : str
        As it stands behind a number.
    factor : float
        What a number of the JSON is multiplied by to be shown in it.
    """

    label: str
    factor: float

    @property
    def density(self) -> str:
        """Return the unit of a power density, which is shown as the JSON has it."""
        if self == MILLIVOLT:
            return "V²/Hz"
        return f"{self.label}²/Hz" if self.label.isalpha() else f"({self.label})²/Hz"


MILLIVOLT = Unit("mV", 1e3)
MIXED = Unit("unit of the record", 1.0)
"""Where the recordings of a campaign have no unit in common."""
_UNITS = {
    "voltage": MILLIVOLT,
    "force_N": Unit("N", 1.0),
    "acceleration_m_per_s2": Unit("m/s²", 1.0),
}


def unit_of(document: Json) -> Unit:
    """Return the unit for everything that is as large as a signal.

    Parameters
    ----------
    document : dict
        ``impactd-diagnosis/1``; its ``_V`` stands for the unit of ``campaign.quantities``, which
        documents from before other quantities were read do not have: those are voltages.

    Returns
    -------
    Unit
        mV, N or m/s²; the unit of the record where quantities are mixed.
    """
    quantities = set(document["campaign"].get("quantities") or ["voltage"])
    return _UNITS.get(quantities.pop(), MIXED) if len(quantities) == 1 else MIXED
