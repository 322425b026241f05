r"""Stress relaxation: a standard linear solid instead of an elastic contact.

.. math:: F_{el} \to F_{el} + g K (\delta^{3/2} - z), \quad \dot z = (\delta^{3/2} - z)/\tau

Source: Lee & Radok, J. Appl. Mech. 27 (1960) 438, in the internal-variable form for growing and
shrinking contact. Validity: small strain; during unloading an approximation. Validation: DOP853 of
the coupled equations; limits tau -> 0 (no effect) and tau -> infinity (K (1 + g)) in the tests.

Scope: a material's. It starts as one number of the rig, the smallest hypothesis: K is free in every
pair and takes up the stiffness at one contact time; surface or sphere come second.
"""

from numba import njit

from analysis.effects.effect import (
    Effect,
    EffectParameter,
    ShotContext,
    Values,
    resolving_steps,
)
from analysis.model.effect_solver import TERM


@njit(TERM, cache=True)
def _term(delta, rate, elastic, z, p0, p1, p2, p3):  # type: ignore[no-untyped-def]  # noqa: PLR0917 - TERM has them
    return p0 * (elastic - z), 0.0, (elastic - z) / p1, 0.0


def _steps(values: Values, context: ShotContext) -> float:
    # an explicit scheme must resolve the relaxation, however short
    return resolving_steps(1.0 / values["relaxation_time_s"], context)


EFFECT = Effect(
    id="stress_relaxation",
    slot="contact",
    title="the material relaxes within the contact",
    tell_tale="stiffness depends on contact time",
    source="Lee & Radok 1960",
    validation="DOP853; limits of the relaxation time",
    parameters=(
        EffectParameter(
            "strength",
            "1",
            "rig",
            "linear",
            0.3,
            0.0,
            3.0,
            (0.1,),
            "unrelaxed over relaxed stiffness, less one",
        ),
        EffectParameter(
            "relaxation_time_s",
            "s",
            "rig",
            "log",
            1e-5,
            2e-7,
            1e-3,
            (1.5e-5, 4e-6, 6e-5, 2.5e-4),
            "time constant",
            resolved=True,
        ),
    ),
    contact=_term,
    pack=lambda v, c: (v["strength"], v["relaxation_time_s"], 0.0, 0.0),
    steps=_steps,
)
