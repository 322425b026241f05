r"""Sensor nonlinearity: sensitivity that changes with load.

.. math:: V \to V + b V^2

Source: first term past the linear one of any smooth characteristic. Validity: abs(b V) far below 1.
Validation: closed form in the tests.

Scope: the rig's, there is one cell. b is per unit of the recorded signal, 1/V for voltages.
"""

from analysis.effects.effect import Effect, EffectParameter

EFFECT = Effect(
    id="sensor_nonlinearity",
    slot="sensor",
    title="the sensitivity changes with load",
    tell_tale="misfit only at the peak, growing with its square",
    source="second-order characteristic",
    validation="closed form",
    parameters=(
        EffectParameter("curvature_per_v", "1/V", "rig", "linear", 0.05, -5.0, 5.0, (0.01,), "b"),
    ),
    order=20,
    output=lambda x, v, c: x + v["curvature_per_v"] * x * x,
)
