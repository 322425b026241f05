"""What the network of moduli found, as a value and as JSON."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2 as chi2_distribution
from scipy.stats import norm

from analysis.aliases import Json
from analysis.campaign import Sphere, Surface
from analysis.fit.result import WITHHOLD_ABOVE, measurand, young_from_plane_strain
from analysis.parameters import ParameterName, key_in_moduli

FORMAT = "impactd-moduli/1"

CONTRADICTION_P = 0.01
"""Chance that any pair of a sound network is called contradicting."""
NETWORK_P = 0.01
"""Below this the network as a whole does not hold together and uncertainty is added."""


def contradiction_limit(pairs: int) -> float:
    """Return the score beyond which one of so many pairs contradicts.

    A sound network rarely has one.
    """
    return float(norm.isf(CONTRADICTION_P / (2 * max(pairs, 1))))


@dataclass(frozen=True)
class Network:
    """How well the observations hold together."""

    chi2: float
    """Weighted squares of observations, stated moduli and calibrations."""
    degrees_of_freedom: int
    """Number of redundant observations."""

    @property
    def p_value(self) -> float | None:
        """Return the chance of a chi2 this large, None where nothing is redundant."""
        if self.degrees_of_freedom < 1:
            return None
        return float(chi2_distribution.sf(self.chi2, self.degrees_of_freedom))


@dataclass(frozen=True)
class PairCheck:
    """A pair's observations, and the same by the network."""

    sphere: str
    surface: str
    observations: int
    log_observed: float
    """Weighted mean of ln E*."""
    log_adjusted: float
    """The same with the network's moduli and calibration errors."""
    u_observed: float
    """Random standard uncertainty of the mean. [1]"""
    score: float | None
    """Difference over its own standard deviation; None where nothing controls the pair."""
    scatter_chi2: float
    """Weighted squares of the observations about their mean; ``observations - 1`` expected."""

    @property
    def pair(self) -> str:
        """Return the pair's key."""
        return f"{self.sphere}/{self.surface}"


@dataclass(frozen=True)
class ModuliResult:
    """Plane-strain moduli of all materials, adjusted together.

    Attributes
    ----------
    names : tuple of ParameterName
        The materials' moduli.
    log_plane_strain : ndarray, shape (n,)
        ln E', E' in Pa.
    covariance : ndarray, shape (n, n)
        Of ``log_plane_strain``, dark uncertainty included.
    dark_u : float
        Added to each u(ln E*) so that the network holds together; 0 where it does. [1]
    checks : tuple of PairCheck
        Consistency by pair.
    contradicting : tuple of str
        Pairs that contradict the rest, worst first.
    anchored : tuple of bool
        Whether a material hangs together with a reference at all.
    """

    model: str
    names: tuple[ParameterName, ...]
    log_plane_strain: NDArray[np.float64]
    covariance: NDArray[np.float64]
    network: Network
    dark_u: float
    checks: tuple[PairCheck, ...]
    contradicting: tuple[str, ...]
    anchored: tuple[bool, ...]
    spheres: dict[str, Sphere]
    surfaces: dict[str, Surface]
    shots: tuple[str, ...]
    calibrations: tuple[str, ...]

    def plane_strain(self, name: str) -> tuple[float, float]:
        """Return ln E', E' in Pa, and its standard uncertainty.

        The name is ``sphere.<name>`` or ``surface.<name>``.
        """
        j = self.names.index(name)
        u = math.sqrt(float(self.covariance[j, j]))
        return float(self.log_plane_strain[j]), u

    def _material(self, name: ParameterName) -> Sphere | Surface:
        return (self.spheres if name.kind == "sphere" else self.surfaces)[name.owner]

    def _modulus(self, name: ParameterName) -> Json:
        """Return one material's entry."""
        material = self._material(name)
        log, u = self.plane_strain(name)
        entry: Json = {
            "youngs_modulus_Pa": None,
            "plane_strain_modulus_Pa": None,
            "side": name.side,
        }
        reason = self.why_withheld(name, u)
        if reason is not None:
            return entry | {"status": "withheld", "reason": reason}
        plane = math.exp(log)
        entry["plane_strain_modulus_Pa"] = measurand(plane, plane * u, "Pa")
        entry["status"] = "fitted" if material.youngs_modulus_pa is None else "reference"
        if material.poissons_ratio is None:
            return entry | {"reason": "E needs Poisson's ratio, which no normal impact can tell"}
        e, u_e = young_from_plane_strain(
            log, u, material.youngs_modulus_pa, material.poissons_ratio
        )
        entry["youngs_modulus_Pa"] = measurand(e, e * u_e, "Pa")
        return entry

    def why_withheld(self, name: str, u: float) -> str | None:
        """Return why a material's modulus is not stated, None if it is.

        The name is ``sphere.<name>`` or ``surface.<name>``; u is the relative standard uncertainty.
        """
        j = self.names.index(name)
        if not self.anchored[j]:
            return (
                "no pair that it hangs together with contains a material of stated modulus; drop "
                "a reference sphere on it, or this sphere on a reference surface"
            )
        if not (math.isfinite(u) and u <= WITHHOLD_ABOVE):
            return (
                f"the relative standard uncertainty is {min(u, 9.99):.0%}: its partners leave "
                "nearly all the compliance to themselves; drop it with a stiffer reference"
            )
        return None

    def moduli(self) -> Json:
        """Return ``moduli`` of the results' JSON: by material, withheld where not known."""
        return {key_in_moduli(name, self.names): self._modulus(name) for name in self.names}

    def _pair_json(self, check: PairCheck) -> Json:
        observed, adjusted = math.exp(check.log_observed), math.exp(check.log_adjusted)
        return {
            "sphere": check.sphere,
            "surface": check.surface,
            "shots": check.observations,
            "reduced_modulus_Pa": measurand(observed, observed * check.u_observed, "Pa"),
            "adjusted_reduced_modulus_Pa": adjusted,
            "score": check.score,
            "scatter_chi2_per_dof": (
                check.scatter_chi2 / (check.observations - 1) if check.observations > 1 else None
            ),
        }

    def warnings(self) -> list[str]:
        """Return what a user must know before trusting the moduli, in words."""
        found = []
        p = self.network.p_value
        if p is None:
            found.append("no observation is redundant: nothing checks these moduli")
        elif p < NETWORK_P:
            found.append(
                f"the pairs do not fit together (p = {p:.2g}); {self.dark_u:.2%} was added to the "
                "uncertainty of every reduced modulus: look at the model before the moduli"
            )
        if 2 * len(self.contradicting) > len(self.checks):
            found.append(
                f"{len(self.contradicting)} of {len(self.checks)} pairs contradict the others: "
                f"this model ({self.model}) or this calibration does not describe the rig"
            )
            return found
        found.extend(
            f"{c.pair} contradicts the rest: its E* is "
            f"{math.expm1(c.log_observed - c.log_adjusted):+.1%} from what the others say "
            f"({abs(c.score or 0.0):.1f} standard deviations)"
            for c in self.checks
            if c.pair in self.contradicting
        )
        return found

    def to_json(self) -> Json:
        """Return the result as ``impactd-moduli/1``; NaN and infinity never appear."""
        return {
            "format": FORMAT,
            "model": self.model,
            "moduli": self.moduli(),
            "pairs": {c.pair: self._pair_json(c) for c in self.checks},
            "network": {
                "chi2": self.network.chi2,
                "degrees_of_freedom": self.network.degrees_of_freedom,
                "p_value": self.network.p_value,
                "dark_uncertainty": self.dark_u,
                "contradicting": list(self.contradicting),
            },
            "covariance": {
                "of": "natural logarithms of plane-strain moduli of",
                "names": list(self.names),
                "matrix": self.covariance.tolist(),
            },
            "shots": list(self.shots),
            "calibrations": list(self.calibrations),
            "warnings": self.warnings(),
        }
