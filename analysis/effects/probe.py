r"""A contact force that is nobody's: powers of indentation and rate, for the closures of a slot.

.. math:: F \to F + c\, K \delta^{3/2}\, \delta^{i} \dot\delta^{j}

It defines no ``EFFECT``, so the library never lists it.
"""

from __future__ import annotations

from collections.abc import Mapping

from numba import njit

from analysis.effects.effect import Effect, ShotContext
from analysis.model.effect_solver import TERM

PROBE_ID = "probe"
NUMBERS = ("strength", "power", "rate_power", "sphere_only")
"""c [m^-i (m/s)^-j], i, j (0, 1, or 2 with the rate's sign), and 1 where the force spares the cell,
as the paper's dashpot does."""


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


def _numbers(values: Mapping[str, float], context: ShotContext) -> tuple[float, ...]:
    return tuple(values.get(name, 0.0) for name in NUMBERS)


PROBE = Effect(
    PROBE_ID, "contact", "", "", "", "not validated", (), contact=probe_term, pack=_numbers
)
"""The probe as an effect without parameters; a trace is given its `NUMBERS`, zeros by default."""
