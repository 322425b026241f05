"""Operators' mistakes: wrong numbers and names, one bad shot, changes between two shots.

A mistake leaves the rig as it is. Wrong is what the technician states (mass, radius, height, name),
or what was done at the rig beside the plan: one sphere that fell badly, another piece under the
same name, a switch that was touched, an instrument that warmed up.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.campaign import (
    CampaignSettings,
    draw_certificate,
    simulate_campaign,
    simulate_drops,
)
from drivers.simulated.campaign_format import trigger_index
from drivers.simulated.drops import Drops, draw_drops
from drivers.simulated.specimens import SPECIMEN

Json = dict[str, Any]

LABEL_ERROR = (0.005, 0.06)
"""|ln| of a stated over the true mass or radius: from a few times what a balance and a calliper
leave to a neighbouring size of ball."""
HEIGHT_ERROR = (0.03, 0.3)
"""The same for a height: from a scale read at the sphere's side to another mark."""
ODD_FACTOR = (0.8, 0.97)
"""Of one shot's signal: a sphere that strikes off-centre or grazes something loses a part."""
COUPON_CHANGE = (0.02, 0.2)
"""|ln| of the other piece's modulus over the first's: batches and moulding of one polymer."""
GAIN_CHANGE = (0.005, 0.1)
"""|ln| of the gain behind the switch over the one before."""
DRIFT = (0.005, 0.05)
"""Relative change of the signal from the first shot to the last: a cell that warms up."""
MIDDLE = (0.2, 0.8)
"""Part of the order in time in which something changes: both sides have shots to tell it by."""


@dataclass(frozen=True)
class Mistake:
    """One mistake."""

    id: str
    scope: Mapping[str, Any]
    """What it concerns: ``sphere``, ``surface`` or ``cell`` to a name, ``drop_height_m`` to the
    wrong height as stated, ``shot`` to the shot's place. Places count from 0 in the order of
    ``shots`` in ``campaign.json``."""
    numbers: Mapping[str, float]
    """``factor`` on the stated number, the signal or the modulus; ``drop_height_m``, the right one;
    ``first_shot``, the place of the first shot that shows a change, and ``last_before``, that of
    the last one without it, between which no shot could tell; ``relative_change`` of the signal
    from the first shot to the last."""
    label: Mapping[str, str] = field(default_factory=dict)
    """``sphere`` or ``surface`` to the name that is written instead of the right one."""

    def to_json(self) -> Json:
        """Return the mistake as the sealed truth states it."""
        return {
            "id": self.id,
            "scope": dict(self.scope),
            "numbers": dict(self.numbers),
            "label": dict(self.label),
        }


def draw_mistake(
    rng: np.random.Generator, drops: Drops, among: Sequence[str] | None = None
) -> Mistake:
    """Draw a mistake of any of the kinds, all of `MISTAKES` by default, each as often.

    Its size is log-uniform within its limits and of either sign; of an odd shot uniform. ``drops``
    are those of the campaign in which it is made. A ValueError says that the campaign has no place
    for it: one sphere and one surface cannot be confused, and no specimen can be exchanged where
    none lies.
    """
    mistake_id = str(rng.choice(list(among or MISTAKES)))
    return _DRAWS[mistake_id](mistake_id, rng, drops)


def make_mistake(settings: CampaignSettings, seed: int, mistake: Mistake) -> Json:
    """Simulate a campaign in which a mistake is made.

    All that the mistake does not touch is as without it, to the last code, stated uncertainties
    included: a wrong number is stated as surely as a right one. ``mistake`` is from `draw_mistake`,
    with the drops of the same settings and seed. The result is as of ``simulate_campaign``, with
    ``mistake`` in the truth.
    """
    if mistake.id not in _DRAWS:
        raise ValueError(f"No mistake is called {mistake.id!r}; there are {', '.join(MISTAKES)}.")
    if mistake.id == "coupon_exchanged":
        made = _with_another_coupon(settings, seed, mistake)
    else:
        made = simulate_campaign(settings, seed)
        if mistake.id in _MISWRITTEN:
            _MISWRITTEN[mistake.id](made["campaign"], mistake)
        else:
            _rescale(settings, made, _factors(mistake, len(made["codes"])))
    made["truth"]["mistake"] = mistake.to_json()
    return made


def _size(rng: np.random.Generator, limits: tuple[float, float]) -> float:
    """Return a size between limits, log-uniform, of either sign."""
    return float(rng.choice((-1.0, 1.0)) * np.exp(rng.uniform(*np.log(limits))))


def _names(drops: Drops, side: str) -> list[str]:
    at = ("sphere", "surface").index(side)
    return sorted({str(drop[at]) for drop in drops.in_order})


def _draw_wrong_label_of_sphere(which: str, rng: np.random.Generator, drops: Drops) -> Mistake:
    sphere = str(rng.choice(_names(drops, "sphere")))
    return Mistake(which, {"sphere": sphere}, {"factor": float(np.exp(_size(rng, LABEL_ERROR)))})


def _draw_wrong_height(which: str, rng: np.random.Generator, drops: Drops) -> Mistake:
    right = float(rng.choice(sorted({height for _, _, height in drops.in_order})))
    factor = float(np.exp(_size(rng, HEIGHT_ERROR)))
    return Mistake(
        which, {"drop_height_m": factor * right}, {"factor": factor, "drop_height_m": right}
    )


def _draw_wrong_name(which: str, rng: np.random.Generator, drops: Drops) -> Mistake:
    place = int(rng.integers(len(drops.in_order)))
    sphere, surface, _ = drops.in_order[place]
    others = [
        (side, name)
        for side, right in (("sphere", sphere), ("surface", surface))
        for name in _names(drops, side)
        if name != right
    ]
    if not others:
        raise ValueError("A campaign of one sphere and one surface has no other name to write.")
    side, name = others[int(rng.integers(len(others)))]
    return Mistake(which, {"shot": place}, {}, {side: name})


def _draw_odd_shot(which: str, rng: np.random.Generator, drops: Drops) -> Mistake:
    place = int(rng.integers(len(drops.in_order)))
    return Mistake(which, {"shot": place}, {"factor": float(rng.uniform(*ODD_FACTOR))})


def _draw_coupon_exchanged(which: str, rng: np.random.Generator, drops: Drops) -> Mistake:
    own = [i for i, (_, surface, _) in enumerate(drops.in_order) if surface == SPECIMEN]
    inside = [b for b in _middle(drops) if own and own[0] < b <= own[-1]]
    if not inside:
        raise ValueError(f"No shots on {SPECIMEN!r} lie on both sides of the campaign's middle.")
    begins = int(rng.choice(inside))
    numbers = {
        "factor": float(np.exp(_size(rng, COUPON_CHANGE))),
        "first_shot": min(place for place in own if place >= begins),
        "last_before": max(place for place in own if place < begins),
    }
    return Mistake(which, {"surface": SPECIMEN}, numbers)


def _draw_gain_switched(which: str, rng: np.random.Generator, drops: Drops) -> Mistake:
    begins = int(rng.choice(_middle(drops)))
    factor = float(np.exp(_size(rng, GAIN_CHANGE)))
    numbers = {"factor": factor, "first_shot": begins, "last_before": begins - 1}
    return Mistake(which, {"cell": "gain"}, numbers)


def _draw_drift(which: str, rng: np.random.Generator, _: Drops) -> Mistake:
    return Mistake(which, {"cell": "gain"}, {"relative_change": _size(rng, DRIFT)})


def _middle(drops: Drops) -> list[int]:
    """Return the places at which something may change."""
    low, high = (round(share * len(drops.in_order)) for share in MIDDLE)
    return list(range(max(low, 1), max(high, 1) + 1))


_DRAWS: dict[str, Callable[[str, np.random.Generator, Drops], Mistake]] = {
    "wrong_mass": _draw_wrong_label_of_sphere,
    "wrong_radius": _draw_wrong_label_of_sphere,
    "wrong_height": _draw_wrong_height,
    "wrong_label": _draw_wrong_name,
    "odd_shot": _draw_odd_shot,
    "coupon_exchanged": _draw_coupon_exchanged,
    "gain_switched": _draw_gain_switched,
    "drift_in_time": _draw_drift,
}
MISTAKES = tuple(_DRAWS)
"""A number of a sphere or of a height, the name in one shot, one shot's signal, what changed from
one shot on, and a slow change of the signal."""
SINGLE_SHOT = ("wrong_label", "odd_shot")
"""Those that concern one shot alone."""


def _miswrite_mass(campaign: Json, mistake: Mistake) -> None:
    _miswrite(campaign["spheres"][mistake.scope["sphere"]], "mass_kg", mistake)


def _miswrite_radius(campaign: Json, mistake: Mistake) -> None:
    _miswrite(campaign["spheres"][mistake.scope["sphere"]], "radius_m", mistake)


def _miswrite_height(campaign: Json, mistake: Mistake) -> None:
    for shot in campaign["shots"]:
        if _number(shot["drop_height_m"]) == mistake.numbers["drop_height_m"]:
            _miswrite(shot, "drop_height_m", mistake)


def _miswrite_name(campaign: Json, mistake: Mistake) -> None:
    campaign["shots"][mistake.scope["shot"]].update(mistake.label)


def _miswrite(entry: Json, key: str, mistake: Mistake) -> None:
    """Write a stated number down wrong, as a plain number or with its uncertainty as it was."""
    wrong = mistake.numbers["factor"] * _number(entry[key])
    entry[key] = entry[key] | {"value": wrong} if isinstance(entry[key], dict) else wrong


def _number(stated: float | Json) -> float:
    return float(stated["value"] if isinstance(stated, dict) else stated)


_MISWRITTEN: dict[str, Callable[[Json, Mistake], None]] = {
    "wrong_mass": _miswrite_mass,
    "wrong_radius": _miswrite_radius,
    "wrong_height": _miswrite_height,
    "wrong_label": _miswrite_name,
}


def _factors(mistake: Mistake, count: int) -> NDArray[np.float64]:
    """Return what each shot's signal is multiplied by."""
    if mistake.id == "drift_in_time":
        return 1.0 + mistake.numbers["relative_change"] * np.linspace(0.0, 1.0, count)
    factors = np.ones(count)
    if mistake.id == "odd_shot":
        factors[mistake.scope["shot"]] = mistake.numbers["factor"]
    else:
        factors[int(mistake.numbers["first_shot"]) :] = mistake.numbers["factor"]
    return factors


def _rescale(settings: CampaignSettings, made: Json, factors: NDArray[np.float64]) -> None:
    """Multiply the records about the converter's zero, which is code 0; it stops at its ends."""
    top = 1 << (settings.bits - 1)
    for place in np.flatnonzero(factors != 1.0):
        codes = np.rint(factors[place] * made["codes"][place].astype(np.float64))
        made["codes"][place] = np.clip(codes, -top, top - 1).astype(np.int16)
        shot = made["campaign"]["shots"][place]
        shot["trigger_index"] = trigger_index(settings, made["codes"][place])


def _with_another_coupon(settings: CampaignSettings, seed: int, mistake: Mistake) -> Json:
    """Return a campaign whose specimen is another piece from one shot on."""
    drops = draw_drops(settings, seed)
    # the first piece's certificate for both: nobody chooses another gain half-way
    cell = draw_certificate(settings, drops, seed)
    made = simulate_drops(settings, drops, cell, seed)
    modulus = mistake.numbers["factor"] * made["truth"]["specimen_youngs_modulus_Pa"]
    piece = replace(drops.surfaces[SPECIMEN], youngs_modulus_pa=modulus, youngs_modulus_u_pa=0.0)
    exchanged = replace(drops, surfaces={**drops.surfaces, SPECIMEN: piece})
    other = simulate_drops(settings, exchanged, cell, seed)
    begins = int(mistake.numbers["first_shot"])
    made["codes"][begins:] = other["codes"][begins:]
    for side in ("campaign", "truth"):
        made[side]["shots"][begins:] = other[side]["shots"][begins:]
    return made
