"""What the demo found, rung by rung, beside the truth that the simulated rig had sealed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from analysis.model.hertz import reduced_modulus
from impactd.aliases import Json
from impactd.demo.judgement import Judgement, judge
from impactd.diagnosis.repair import is_repaired

SPECIMEN = "specimen"
"""The surface whose modulus nobody stated."""
CLOSED = "closed KV"
"""The base that the diagnosis starts from, for people."""


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
class Rung:
    """One model of the ladder with everything it says about the same drops.

    Attributes
    ----------
    key : str
        ``hsd``, ``kv``, ``kv2`` or ``after``: stable, whatever was found.
    name : str
        For people: ``HSD``, ``KV``, ``closed KV``, ``closed KV + coupler_highpass``.
    block : dict
        ``heldout_rms_V``, ``pairs``, ``moduli`` as `impactd-fit/1` and a diagnosis have them.
    """

    key: str
    name: str
    block: Json

    @property
    def heldout_rms_v(self) -> float | None:
        """Return the error on shots that the shared numbers were not fitted to. [V]"""
        found: float | None = self.block.get("heldout_rms_V")
        return found

    @property
    def specimen(self) -> Estimate | None:
        """Return the specimen's plane-strain modulus, what an impact knows of it."""
        entry = self.block.get("moduli", {}).get(SPECIMEN, {})
        return Estimate.of(entry.get("plane_strain_modulus_Pa"))


@dataclass(frozen=True)
class Row:
    """A pair's reduced modulus or a material's Young's modulus, by every rung.

    Attributes
    ----------
    name : str
        ``acetal on specimen``, or a material.
    shots : int
        How many shots it rests on.
    estimates : dict
        By the rung's key; ``None``: withheld.
    truth_pa : float
        What the simulated rig has. [Pa]
    known : bool
        Whether a modulus was stated before the first drop, so that the result is a prior improved.
    """

    name: str
    shots: int
    estimates: dict[str, Estimate | None]
    truth_pa: float
    known: bool = False

    def to_json(self) -> Json:
        """Return the row as JSON-ready values.

        Returns
        -------
        dict
            Each rung's estimate and whether its interval holds the truth, and the truth.
        """
        found: Json = {"shots": self.shots, "truth_Pa": self.truth_pa}
        for key, estimate in self.estimates.items():
            found[key] = None if estimate is None else estimate.to_json()
            found[f"{key}_holds_truth"] = (
                None if estimate is None else estimate.holds(self.truth_pa)
            )
        return found


@dataclass(frozen=True)
class Outcome:
    """Everything the demo shows at its end.

    Attributes
    ----------
    rungs : list of Rung
        HSD, KV, closed KV, and that with what was found where anything was.
    pairs : list of Row
        Reduced moduli E*, the one number a contact knows.
    materials : list of Row
        Young's moduli.
    diagnosis : dict
        ``impactd-diagnosis/1``.
    model : str or None
        What was made the active model, with its version.
    calibration : dict
        The calibration as the API gives it.
    seed : int
        Of the simulated rig.
    """

    rungs: list[Rung]
    pairs: list[Row]
    materials: list[Row]
    diagnosis: Json
    model: str | None
    calibration: Json
    truth: Json
    seed: int

    @property
    def last(self) -> Rung:
        """Return the rung the demo ends on."""
        return self.rungs[-1]

    @property
    def base(self) -> Rung:
        """Return the rung that the diagnosis started from."""
        return next(rung for rung in self.rungs if rung.key == "kv2")

    @property
    def mean_waveform_rms_v(self) -> float | None:
        """Return the error of a mean of the other drops' records, without any model. [V]"""
        found: float | None = self.diagnosis.get("mean_waveform", {}).get("heldout_rms_V")
        return found

    @property
    def judgement(self) -> Judgement:
        """Return whether the verdict was right."""
        return judge(self.diagnosis, self.truth.get("effects") or [])

    @property
    def specimen_truth_pa(self) -> float:
        """Return the specimen's true plane-strain modulus. [Pa]"""
        return _plane_strain(self.truth, "surfaces", SPECIMEN)

    def held(self, key: str) -> tuple[int, int]:
        """Return for how many pairs a rung's interval holds the truth, and of how many."""
        stated = [(row, row.estimates[key]) for row in self.pairs]
        known = [(row, found) for row, found in stated if found is not None]
        return sum(found.holds(row.truth_pa) for row, found in known), len(known)

    def to_json(self) -> Json:
        """Return the content of ``moduli.json``.

        Returns
        -------
        dict
            ``impactd-demo/1``; ``moduli`` are those of the last rung, whose model is named.
        """
        judgement = self.judgement
        return {
            "format": "impactd-demo/1",
            "seed": self.seed,
            "model": self.last.block["model"],
            "active_model": self.model,
            "moduli": self.last.block["moduli"],
            "ladder": [self._rung_json(rung) for rung in self.rungs],
            "noise_rms_V": self.diagnosis["noise_rms_V"],
            "verdict": self.diagnosis["verdict"],
            "sentence": self.diagnosis["sentence"],
            "right": judgement.right,
            "judgement": judgement.sentence,
            "pairs": {row.name: row.to_json() for row in self.pairs},
            "materials": {row.name: row.to_json() for row in self.materials},
            "calibration": self.calibration["number"],
            "truth": {
                key: self.truth.get(key) for key in ("effects", "spheres", "surfaces", "sensor")
            },
        }

    def _rung_json(self, rung: Rung) -> Json:
        found = rung.specimen
        return {
            "rung": rung.key,
            "model": rung.block["model"],
            "heldout_rms_V": rung.heldout_rms_v,
            "specimen_plane_strain_modulus_Pa": None if found is None else found.to_json(),
            "truth_Pa": self.specimen_truth_pa,
        }


def compare(
    fits: Mapping[str, Json],
    diagnosis: Json,
    calibration: Json,
    truth: Json,
    *,
    seed: int,
    model: str | None = None,
) -> Outcome:
    """Compare every model with the truth.

    Parameters
    ----------
    fits : mapping
        ``impactd-fit/1`` of the same shots by the paper's models, ``hsd`` and ``kv``.
    diagnosis : dict
        ``impactd-diagnosis/1`` from the closed base.
    truth : dict
        As the simulated rig unsealed it.
    model : str, optional
        What was made the active model.

    Returns
    -------
    Outcome
        Pairs and materials in the order of the diagnosis.
    """
    rungs = [Rung(key, key.upper(), fit) for key, fit in fits.items()]
    rungs.append(Rung("kv2", CLOSED, diagnosis["before"]))
    if diagnosis["effects"]:
        named = " + ".join(effect["id"] for effect in diagnosis["effects"])
        rungs.append(Rung("after", f"{CLOSED} + {named}", diagnosis["after"]))
    elif is_repaired(diagnosis):
        rungs.append(Rung("after", f"{CLOSED} + learned discrepancy", diagnosis["after"]))
    pairs = [
        Row(
            f"{found['sphere']} on {found['surface']}",
            found["shots"],
            {r.key: Estimate.of(_entry(r, "pairs", key, "reduced_modulus_Pa")) for r in rungs},
            reduced_modulus(
                _plane_strain(truth, "spheres", found["sphere"]),
                _plane_strain(truth, "surfaces", found["surface"]),
            ),
        )
        for key, found in diagnosis["before"]["pairs"].items()
    ]
    materials = [
        _material(name, rungs, diagnosis["before"], truth) for name in diagnosis["before"]["moduli"]
    ]
    return Outcome(rungs, pairs, materials, diagnosis, model, calibration, truth, seed)


def _material(name: str, rungs: list[Rung], before: Json, truth: Json) -> Row:
    entry = before["moduli"][name]
    plain = name.partition(":")[2] or name
    group = "spheres" if entry["side"] == "sphere" else "surfaces"
    return Row(
        plain,
        sum(pair["shots"] for pair in before["pairs"].values() if plain == pair[entry["side"]]),
        {r.key: Estimate.of(_entry(r, "moduli", name, "youngs_modulus_Pa")) for r in rungs},
        float(truth[group][plain]["youngs_modulus_Pa"]),
        known=entry["status"] == "reference",
    )


def _entry(rung: Rung, group: str, key: str, what: str) -> Json | None:
    found: Json | None = rung.block.get(group, {}).get(key, {}).get(what)
    return found


def _plane_strain(truth: Json, group: str, name: str) -> float:
    return float(truth[group][name]["plane_strain_modulus_Pa"])
