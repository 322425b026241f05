r"""Crystal dynamics: the cell's crystal is a mass on a spring, not a rigid seat.

.. math:: M\ddot\Delta = F_{el} - k\Delta - \mu\dot\Delta, \quad V = \Delta/c

This is the KV base itself (Eqs 8-11), listed so that a search that starts from HSD can find it: it
has no hook. Adding it means going on with the base named in ``replaces_base`` or with its closed
form, whichever fits better. Their ``ln_w`` and ``ln_z`` are the logarithms of 2 pi times the first
number below and of the second.

Source: Maranzano & Hancock 2016. Validity: one mode of the cell below its others. Validation: the
base model's own tests.

Scope: the rig's, there is one cell.
"""

from analysis.effects.effect import Effect, EffectParameter

EFFECT = Effect(
    id="crystal_dynamics",
    slot="sensor",
    title="the crystal rings",
    tell_tale="delay, asymmetry, ring after the pulse",
    source="Maranzano & Hancock 2016, Eqs 8-11",
    validation="tests of the base model",
    parameters=(
        EffectParameter(
            "natural_frequency_hz",
            "Hz",
            "rig",
            "log",
            1e4,
            1e3,
            3e5,
            (1.7e4, 8e3, 4e4),
            "omega0 / 2 pi",
        ),
        EffectParameter("damping_ratio", "1", "rig", "log", 0.1, 1e-3, 2.0, (0.07,), "zeta"),
    ),
    bases=("hsd",),
    replaces_base="kv",
)
