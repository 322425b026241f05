r"""The drift of a cell between two calibrations, without the errors that both share.

Both rest on the same reference materials and the same certificate, whose errors move both alike. A
fit with posterior covariance C and prior precision P follows an error d of the stated values by
:math:`s d, s = g C P`; what is left of its variance, :math:`g C g - s P^{-1} s`, is that run's own.

.. math:: u^2 = u_1^2 + u_2^2 + (s_2 - s_1) P^{-1} (s_2 - s_1)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np

from analysis.aliases import Json
from analysis.calibration_document import IDENTIFIABLE
from analysis.fit.joint import Fitted
from analysis.fit.problem import JointProblem
from analysis.parameters import DAMPING, FREQUENCY, GAIN

DRIFT_LIMIT = 3.0
"""Drift in combined standard uncertainties from which it is called one."""
SAME_STATEMENT = 1e-9
_GLOBALS = {
    "gain_N_per_V": GAIN,
    "natural_frequency_Hz": FREQUENCY,
    "damping_ratio": DAMPING,
}


class Documented(Protocol):
    """Anything that can state itself as JSON."""

    def to_json(self) -> Json:
        """Return the document."""
        ...


def drift_basis(problem: JointProblem, fitted: Fitted) -> Json:
    """Return the part of a calibration's fit that a later comparison needs.

    What was stated (logarithms, covariance), and for each combination of the cell how the fit
    follows it (``sensitivity``) and the run's own standard uncertainty (``u_own``).
    """
    precision = problem.prior_precision
    stated = np.linalg.inv(precision + 1e-6 * np.eye(precision.shape[0]))
    found: Json = {}
    for label, name in _GLOBALS.items():
        j = problem.index(name)
        if j is None:
            continue
        follows = fitted.covariance[j] @ precision
        own = float(fitted.covariance[j, j]) - float(follows @ stated @ follows)
        # what rounding leaves below zero is a run that adds nothing of its own
        found[label] = {"sensitivity": follows.tolist(), "u_own": math.sqrt(max(own, 0.0))}
    return {
        "names": list(problem.names),
        "stated": problem.prior_mean.tolist(),
        "covariance": stated.tolist(),
        "combinations": found,
    }


def _combined_u(before: Json, after: Json, label: str) -> float | None:
    """Return u of the change of one combination, None where a document lacks the basis."""
    bases = [x.get("drift_basis") for x in (before, after)]
    if any(not b or label not in b["combinations"] for b in bases):
        return None
    one, two = bases
    assert one is not None
    assert two is not None
    both = _shared_names(one, two)
    total = 0.0
    difference = np.zeros(len(both))
    for sign, basis in ((-1, one), (1, two)):
        found = basis["combinations"][label]
        follows = np.array(found["sensitivity"])
        at = [basis["names"].index(n) for n in both]
        rest = [i for i in range(len(basis["names"])) if i not in at]
        covariance = np.array(basis["covariance"])
        difference += sign * follows[at]
        total += found["u_own"] ** 2
        total += float(follows[rest] @ covariance[np.ix_(rest, rest)] @ follows[rest])
    at = [two["names"].index(n) for n in both]
    shared = np.array(two["covariance"])[np.ix_(at, at)]
    return math.sqrt(max(total + float(difference @ shared @ difference), 0.0))


def _shared_names(one: Json, two: Json) -> list[str]:
    """Return what both runs were told in the same words, value and uncertainty alike."""
    found = []
    for i, name in enumerate(one["names"]):
        if name not in two["names"]:
            continue
        j = two["names"].index(name)
        same_value = abs(one["stated"][i] - two["stated"][j]) <= SAME_STATEMENT
        u, v = one["covariance"][i][i], two["covariance"][j][j]
        if same_value and abs(u - v) <= 1e-6 * max(u, v):
            found.append(name)
    return found


def drift(previous: Json | Documented, current: Json | Documented) -> Json:
    """Return how far the cell moved between two calibrations.

    Parameters
    ----------
    previous, current : dict or CalibrationResult
        Two calibrations of one cell.

    Returns
    -------
    dict
        Per identifiable combination the relative ``change``, its standard uncertainty ``u``,
        ``in_u``, change over u, and ``common_cancels``; ``largest_in_u``; ``drifted``; and one
        ``sentence``.

    Notes
    -----
    Source: linear propagation through both fits. What both were told in the same words cancels as
    far as both follow it alike; a document without ``drift_basis`` is compared by its whole
    uncertainty, on the careful side. Validation: repeated calibrations of one made cell in
    ``tests/analysis/test_cell_drift.py``.
    """
    before, after = (x if isinstance(x, dict) else x.to_json() for x in (previous, current))
    found: Json = {}
    for label in IDENTIFIABLE.values():
        a = (before.get("identifiable") or {}).get(label)
        b = (after.get("identifiable") or {}).get(label)
        if not a or not b:
            continue
        change = math.log(b["value"] / a["value"])
        u = _combined_u(before, after, label)
        cancels = u is not None
        if u is None:
            u = math.hypot(a["u"] / a["value"], b["u"] / b["value"])
        found[label] = {
            "change": math.expm1(change),
            "u": u,
            "in_u": change / u if u > 0 else 0.0,
            "common_cancels": cancels,
        }
    if not found:
        return {
            "combinations": {},
            "largest_in_u": None,
            "drifted": False,
            "sentence": "Nothing to compare.",
        }
    worst = max(found, key=lambda name: abs(found[name]["in_u"]))
    size = abs(found[worst]["in_u"])
    verdict = "drifted" if size > DRIFT_LIMIT else "is stable"
    return {
        "combinations": found,
        "largest_in_u": size,
        "drifted": size > DRIFT_LIMIT,
        "sentence": (
            f"The cell {verdict}: {worst} changed by {found[worst]['change']:+.2%}, "
            f"{size:.1f} combined standard uncertainties."
        ),
    }


def drift_series(documents: Sequence[Json]) -> list[Json]:
    """Return each calibration's change since the one before and since the first.

    ``documents`` are ``impactd-calibration/1`` of one cell, oldest first. Each entry has the
    identifiable combinations, ``since_previous`` and ``since_first`` (as `drift`; None for the
    first).
    """
    series = []
    for i, one in enumerate(documents):
        series.append(
            {
                "identifiable": one.get("identifiable") or {},
                "since_previous": drift(documents[i - 1], one) if i else None,
                "since_first": drift(documents[0], one) if i else None,
            }
        )
    return series
