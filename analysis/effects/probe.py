r"""A contact force that is nobody's: powers of indentation and rate, for the closures of a slot.

.. math:: F \to F + c\, K \delta^{3/2}\, \delta^{i} \dot\delta^{j}

It defines no ``EFFECT``, so the library never lists it.
"""

from __future__ import annotations

from numba import njit

from analysis.effects.effect import Effect
from analysis.model.effect_solver import TERM

PROBE_ID = "probe"


@njit(TERM, cache=True)
def probe_term(delta, rate, elastic, z, p0, p1, p2, p3):  # type: ignore[no-untyped-def]  # noqa: PLR0917 - TERM has them
    """Return the force p0 K delta^(3/2) delta^p1 rate^p2, on the sphere alone where p3 is 1."""
    force = 0.0
    if delta > 0.0:
        force = p0 * elastic * delta**p1
        if p2 == 1.0:
            force *= rate
        elif p2 == 2.0:
            force *= rate * abs(rate)
    if p3 == 1.0:
        return 0.0, force, 0.0, 0.0
    return force, 0.0, 0.0, 0.0


def probe(strength: float, power: float, rate_power: int, *, sphere_only: bool) -> Effect:
    """Return the probe as an effect without parameters.

    Parameters
    ----------
    strength : float
        Coefficient c. [m^-i (m/s)^-j]
    power, rate_power : float, int
        i and j; j is 0, 1 or 2 (2 keeps the sign of the rate).
    sphere_only : bool
        Whether the force spares the cell, as the paper's dashpot does.

    Returns
    -------
    Effect
        To be added to a model.
    """
    numbers = (strength, power, float(rate_power), float(sphere_only))
    return Effect(
        PROBE_ID,
        "contact",
        "",
        "",
        "",
        "not validated",
        (),
        contact=probe_term,
        pack=lambda values, context: numbers,
    )
