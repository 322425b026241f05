"""The quantities of the identifiability report, each as a direction in the space of the globals."""

from __future__ import annotations

import numpy as np

from analysis.fit.estimates import pair_modulus
from analysis.fit.joint import Fitted
from analysis.fit.priors import SEEN, SENSOR_FIELDS
from analysis.fit.problem import JointProblem, sensor_transform
from analysis.identifiability_words import Asked
from analysis.parameters import CELL, DAMPING, FREQUENCY, GAIN, of_pair

_COMBINATIONS = {
    FREQUENCY: ("sensor.natural_frequency_Hz", "the crystal's frequency omega0"),
    DAMPING: ("sensor.damping_ratio", "the crystal's damping ratio zeta"),
    GAIN: ("sensor.gain_N_per_V", "the cell's gain S (k c of the crystal)"),
}
_ALONE = (
    "the crystal's mass M alone",
    "the crystal's stiffness k alone",
    "the crystal's damping mu alone",
    "the crystal's compliance c alone",
)


def asked_of(problem: JointProblem, fitted: Fitted) -> list[Asked]:
    """Return what a report on a fit speaks about, identifiable combinations first.

    The cell's combinations, the pairs' stiffness, the cell's single numbers, moduli, effects.
    """
    names = problem.names
    unit = np.eye(len(names))
    found = []
    for name, (label, words) in _COMBINATIONS.items():
        if name in names:
            found.append(Asked(label, words, problem.gradient_of(name), kind="cell"))
    found.extend(_pairs(problem, fitted))
    if problem.positions(CELL) is not None:
        cell = sensor_transform() @ np.array([problem.gradient_of(name) for name in CELL])
        for field, words, gradient in zip(SENSOR_FIELDS, _ALONE, cell, strict=True):
            found.append(Asked(f"sensor.{field}", words, gradient, kind="alone"))
    for j, name in enumerate(names):
        if name.is_modulus:
            words = f"the modulus E/(1-nu^2) of the {name.kind} {name.owner}"
            pairs = {i.pair for i in problem.shots if name in (problem.material_keys(i) or ())}
            found.append(Asked(name, words, unit[j], kind="modulus", pairs=tuple(sorted(pairs))))
        elif name == SEEN:
            words = "how long after lift-off the stated rebound speeds were seen (in ms)"
            found.append(Asked(name, words, unit[j], kind="delay", log=False))
        elif name.kind == "effect":
            found.append(Asked(name, f"the effect's {name}", unit[j], kind="effect", log=False))
    return found


def _pairs(problem: JointProblem, fitted: Fitted) -> list[Asked]:
    found: dict[str, Asked] = {}
    for item in problem.shots:
        if item.pair in found:
            continue
        modulus = pair_modulus(problem, fitted, item)
        if modulus is None:
            gradient = problem.shared_local(item, fitted.theta)[1][0]
            words = f"the stiffness over mass K/m of {item.pair}"
        else:
            gradient = modulus[2]
            words = f"the stiffness K (and E*) of {item.pair}"
        found[item.pair] = Asked(
            of_pair(item.pair), words, gradient, kind="pair", pairs=(item.pair,)
        )
    return list(found.values())
