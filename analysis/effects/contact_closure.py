r"""A contact force of free form, for the discrepancy of the contact slot.

.. math::

    F \to F + K\delta^{3/2} \sum_i c_i u^{i}, \quad i = -1/2, 1/2, 1, 2
    \qquad\text{or}\qquad
    F \to F + K\delta^{3/2} \frac{\dot\delta}{v} \sum_i c_i u^{i}, \quad i = -1, -1/2, 0, 1

with u = delta/d; d and v are a campaign's usual indentation and speed, so that a coefficient of one
is a force as large as Hertz's. The first loads sphere and cell, the second sphere and cell or, as
the paper's dashpot does, the sphere alone.

It defines no ``EFFECT``, so the library never lists it.
"""

from __future__ import annotations

import math
from functools import partial

from numba import njit

from analysis.effects.effect import Effect, EffectParameter, ShotContext, Values
from analysis.model.effect_solver import TERM

ELASTIC_POWERS = (-0.5, 0.5, 1.0, 2.0)
RATE_POWERS = (-1.0, -0.5, 0.0, 1.0)
FORMS = ("elastic", "rate", "loss")
_LARGEST = 50.0


@njit(TERM, cache=True)
def _elastic(delta, rate, elastic, z, p0, p1, p2, p3):  # type: ignore[no-untyped-def]  # noqa: PLR0917 - TERM has them
    if delta <= 0.0:
        return 0.0, 0.0, 0.0, 0.0
    root = math.sqrt(delta)
    return elastic * (p0 / root + p1 * root + delta * (p2 + p3 * delta)), 0.0, 0.0, 0.0


@njit(TERM, cache=True)
def _rate(delta, rate, elastic, z, p0, p1, p2, p3):  # type: ignore[no-untyped-def]  # noqa: PLR0917 - TERM has them
    if delta <= 0.0:
        return 0.0, 0.0, 0.0, 0.0
    share = p0 / delta + p1 / math.sqrt(delta) + p2 + p3 * delta
    return elastic * rate * share, 0.0, 0.0, 0.0


@njit(TERM, cache=True)
def _loss(delta, rate, elastic, z, p0, p1, p2, p3):  # type: ignore[no-untyped-def]  # noqa: PLR0917 - TERM has them
    if delta <= 0.0:
        return 0.0, 0.0, 0.0, 0.0
    share = p0 / delta + p1 / math.sqrt(delta) + p2 + p3 * delta
    return 0.0, elastic * rate * share, 0.0, 0.0


_TERMS = {"elastic": _elastic, "rate": _rate, "loss": _loss}


def _pack(
    factors: dict[str, float], values: Values, context: ShotContext
) -> tuple[float, float, float, float]:
    """Return the coefficients with the campaign's sizes taken off."""
    del context
    a, b, c, d = (values[name] * factor for name, factor in factors.items())
    return a, b, c, d


def contact_closure(
    form: str, indentation_m: float, speed_m_per_s: float, scope: str = "rig"
) -> Effect:
    """Return a free contact force, one of `FORMS`, as an effect with four numbers, neutral at zero.

    ``indentation_m`` and ``speed_m_per_s`` are the usual sizes of the campaign, ``scope`` says who
    owns the numbers: rig, surface or sphere.
    """
    powers = ELASTIC_POWERS if form == "elastic" else RATE_POWERS
    rate = 1.0 if form == "elastic" else 1.0 / speed_m_per_s
    factors = tuple(rate * indentation_m**-p for p in powers)
    names = tuple(f"u^{p:g}" for p in powers)

    return Effect(
        f"closure_{form}",
        "contact",
        "a contact force of free form",
        "",
        "four powers of the indentation",
        "not validated: it is learned, not a law",
        tuple(
            EffectParameter(
                n, "1", scope, "linear", 1.0, -_LARGEST, _LARGEST, (0.01,), "share of Hertz's force"
            )
            for n in names
        ),
        contact=_TERMS[form],
        pack=partial(_pack, dict(zip(names, factors, strict=True))),
    )
