"""What the demo found, beside the truth that the simulated rig had sealed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from analysis.fit.shot_fit import MISFIT_ABOVE
from analysis.model.hertz import reduced_modulus

Json = dict[str, Any]


@dataclass(frozen=True)
class Estimate:
    """A modulus as the daemon states it.

    Attributes
    ----------
    value_pa : float
        Best estimate. [Pa]
    u_pa : float
        Standard uncertainty. [Pa]
    interval95_pa : tuple of float
        95 % interval. [Pa]
    """

    value_pa: float
    u_pa: float
    interval95_pa: tuple[float, float]

    @classmethod
    def of(cls, measurand: Json | None) -> Estimate | None:
        """Return the estimate in an API answer, ``None`` where it was withheld.

        Parameters
        ----------
        measurand : dict or None
            ``value``, ``u``, ``interval95``.

        Returns
        -------
        Estimate or None
            The same numbers.
        """
        if measurand is None:
            return None
        low, high = measurand["interval95"]
        return cls(measurand["value"], measurand["u"], (low, high))

    def holds(self, truth_pa: float) -> bool:
        """Return whether the 95 % interval holds a value.

        Parameters
        ----------
        truth_pa : float
            The value. [Pa]

        Returns
        -------
        bool
            Limits included.
        """
        return self.interval95_pa[0] <= truth_pa <= self.interval95_pa[1]

    def to_json(self) -> Json:
        """Return the estimate as the API's measurand.

        Returns
        -------
        dict
            ``value``, ``u``, ``interval95``, ``unit``.
        """
        return {
            "value": self.value_pa,
            "u": self.u_pa,
            "interval95": list(self.interval95_pa),
            "unit": "Pa",
        }


@dataclass(frozen=True)
class Row:
    """A pair's reduced modulus or a material's Young's modulus, by both models.

    Attributes
    ----------
    name : str
        ``acetal on specimen``, or a material.
    shots : int
        How many shots it rests on.
    hsd, kv : Estimate or None
        ``None``: withheld.
    truth_pa : float
        What the simulated rig has. [Pa]
    known : bool
        Whether a modulus was stated before the first drop, so that the result is a prior improved.
    """

    name: str
    shots: int
    hsd: Estimate | None
    kv: Estimate | None
    truth_pa: float
    known: bool = False

    def to_json(self) -> Json:
        """Return the row as JSON-ready values.

        Returns
        -------
        dict
            Both estimates, the truth, and whether each interval holds it.
        """
        return {
            "shots": self.shots,
            "hsd": None if self.hsd is None else self.hsd.to_json(),
            "kv": None if self.kv is None else self.kv.to_json(),
            "truth_Pa": self.truth_pa,
            "hsd_holds_truth": None if self.hsd is None else self.hsd.holds(self.truth_pa),
            "kv_holds_truth": None if self.kv is None else self.kv.holds(self.truth_pa),
        }


@dataclass(frozen=True)
class Outcome:
    """Everything the demo shows at its end.

    Attributes
    ----------
    pairs : list of Row
        Reduced moduli E*, the one number a contact knows.
    materials : list of Row
        Young's moduli.
    fits : dict
        ``impactd-fit/1`` by model.
    calibration : dict
        The calibration as the API gives it.
    truth : dict
        What was sealed.
    seed : int
        Of the simulated rig.
    """

    pairs: list[Row]
    materials: list[Row]
    fits: dict[str, Json]
    calibration: Json
    truth: Json
    seed: int

    def sentence(self) -> str:
        """Return the result in two sentences, and a third where the model does not suffice.

        Returns
        -------
        str
            How many intervals hold the truth, how far HSD is off, what KV leaves over.
        """
        kv = [row for row in self.pairs if row.kv is not None]
        held = sum(row.kv is not None and row.kv.holds(row.truth_pa) for row in kv)
        off = [row.hsd.value_pa / row.truth_pa - 1 for row in self.pairs if row.hsd is not None]
        said = f"KV: the stated 95 % interval holds the truth for {held} of {len(kv)} pairs."
        if off:
            said += f" HSD: off by {min(off):+.0%} to {max(off):+.0%}."
        misfit = self.fits["kv"].get("chi2_per_dof")
        if misfit is not None and misfit > MISFIT_ABOVE:
            said += (
                f" KV leaves {misfit:.3g} times the noise's variance: the instrument has something "
                "that the model lacks, and no interval covers that."
            )
        return said

    def to_json(self) -> Json:
        """Return the content of ``moduli.json``.

        Returns
        -------
        dict
            ``impactd-demo/1``.
        """
        return {
            "format": "impactd-demo/1",
            "seed": self.seed,
            "moduli": self.fits["kv"]["moduli"],
            "pairs": {row.name: row.to_json() for row in self.pairs},
            "materials": {row.name: row.to_json() for row in self.materials},
            "calibration": self.calibration["number"],
            "truth": {
                key: self.truth.get(key) for key in ("effects", "spheres", "surfaces", "sensor")
            },
        }


def compare(hsd: Json, kv: Json, calibration: Json, truth: Json, seed: int) -> Outcome:
    """Lay both fits beside the truth.

    Parameters
    ----------
    hsd, kv : dict
        ``impactd-fit/1`` of the same shots.
    calibration : dict
        As the API gives it.
    truth : dict
        As the simulated rig unsealed it.
    seed : int
        Of the simulated rig.

    Returns
    -------
    Outcome
        Pairs and materials in the order of the fit.
    """
    pairs = []
    for key, found in kv["pairs"].items():
        sphere, _, surface = key.partition("/")
        true_pa = reduced_modulus(
            _plane_strain(truth, "spheres", sphere), _plane_strain(truth, "surfaces", surface)
        )
        other = hsd["pairs"].get(key, {})
        pairs.append(
            Row(
                f"{sphere} on {surface}",
                found["shots"],
                Estimate.of(other.get("reduced_modulus_Pa")),
                Estimate.of(found.get("reduced_modulus_Pa")),
                true_pa,
            )
        )
    materials = []
    for name, found in kv["moduli"].items():
        group = "spheres" if found["side"] == "sphere" else "surfaces"
        plain = name.partition(":")[2] or name
        materials.append(
            Row(
                plain,
                sum(plain in (shot["sphere"], shot["surface"]) for shot in kv["shots"]),
                Estimate.of(hsd["moduli"].get(name, {}).get("youngs_modulus_Pa")),
                Estimate.of(found["youngs_modulus_Pa"]),
                float(truth[group][plain]["youngs_modulus_Pa"]),
                known=found["status"] == "reference",
            )
        )
    return Outcome(pairs, materials, {"hsd": hsd, "kv": kv}, calibration, truth, seed)


def _plane_strain(truth: Json, group: str, name: str) -> float:
    return float(truth[group][name]["plane_strain_modulus_Pa"])
