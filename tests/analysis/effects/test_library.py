"""The library as a whole: complete, neutral, finite, documented."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

import analysis.effects
from analysis.effects.effect import SCOPES, SLOTS, Effect
from analysis.effects.library import effect_named, library, library_table, term_addresses
from analysis.errors import ParameterOutOfRangeError, UnknownModelError
from analysis.model.impact_model import model_named

from .conftest import Rig, apart, neutral

SLOT_OF = {
    "viscoelastic_damping": "contact",
    "hunt_crossley_damping": "contact",
    "stress_relaxation": "contact",
    "plastic_yield": "contact",
    "adhesion": "contact",
    "finite_thickness": "contact",
    "plate_radiation": "contact",
    "surface_roughness": "contact",
    "dashpot_reaction": "contact",
    "loss_law": "contact",
    "adhesive_layer": "mounting",
    "coupon_mode": "mounting",
    "crystal_dynamics": "sensor",
    "second_mode": "sensor",
    "base_compliance": "sensor",
    "sensor_nonlinearity": "sensor",
    "coupler_highpass": "electronics",
    "amplifier_lowpass": "electronics",
    "clipping": "electronics",
    "echo": "electronics",
    "mains_hum": "electronics",
    "gain_drift": "electronics",
    "release_speed_bias": "release",
    "recontact": "release",
}
EVERY = [e for listed in library().values() for e in (listed, *listed.variants)]
MODELLED = [e for e in EVERY if not e.replaces_base]
HERE = Path(analysis.effects.__file__).parent
RIG = Rig()


def named(effect: Effect) -> str:
    """Return the test's name."""
    return effect.id


def model_of(effect: Effect) -> str:
    """Return the name of the crystal model with this effect."""
    return f"kv+{effect.id}"


def test_every_effect_of_the_specification_is_in_its_slot() -> None:
    """The library lists each of the 23 effects, in the slot that the physics gives it."""
    assert {e.id: e.slot for e in library().values()} == SLOT_OF


@pytest.mark.parametrize("effect", EVERY, ids=named)
def test_an_effect_says_where_it_comes_from(effect: Effect) -> None:
    """Each effect names slot, scopes, source, validation and tell-tale; its starts are physical."""
    assert effect.slot in SLOTS
    assert effect.title
    assert effect.tell_tale
    assert effect.source
    assert effect.validation
    for p in effect.parameters:
        assert p.scope in SCOPES
        assert p.form in ("log", "linear", "inverse")
        assert p.starts
        assert all(p.low <= start <= p.high for start in p.starts)
        assert p.value(p.coordinate(p.starts[0])) == pytest.approx(p.starts[0], rel=1e-12)


@pytest.mark.parametrize("effect", EVERY, ids=named)
def test_the_slope_of_a_coordinate_is_its_derivative(effect: Effect) -> None:
    """An uncertainty is carried from coordinate to value by the true derivative."""
    for p in effect.parameters:
        at, step = p.coordinate(p.starts[0]), 1e-6
        slope = (p.value(at + step) - p.value(at - step)) / (2 * step)
        assert p.slope(at) == pytest.approx(slope, rel=1e-6)


@pytest.mark.parametrize("effect", list(library().values()), ids=named)
def test_a_file_is_an_effect(effect: Effect) -> None:
    """Each effect has the file of its name, whose docstring gives source, validity, scope."""
    text = (HERE / f"{effect.id}.py").read_text(encoding="utf-8")
    for word in ("Source:", "Validity:", "Validation:"):
        assert word in text or word.replace(":", " for") in text or "Valid for" in text
    assert all(form.id.startswith(f"{effect.id}:") for form in effect.variants)


@pytest.mark.parametrize("base_name", ["kv", "kv2"])
@pytest.mark.parametrize(
    "effect", [e for e in MODELLED if not e.id.startswith("adhesive_layer")], ids=named
)
def test_the_neutral_value_is_the_base_model(effect: Effect, base_name: str) -> None:
    """At its neutral value each effect leaves the base model to 1e-9 of the peak.

    Neutral is a limit for roughness (depth to 0) and recontact (speed ratio to 0); the adhesive
    layer has none, see its own test.
    """
    if base_name not in effect.bases:
        pytest.skip(f"not an effect on {base_name}")
    base = RIG.predict(base_name)
    same_steps = RIG.steps(model_named(base_name), RIG.local(model_named(base_name)))
    model = model_named(f"{base_name}+{effect.id}")
    local = RIG.local(model, neutral(effect))
    found = model.predict(local, RIG.frame(), steps=same_steps)
    assert apart(found.signal, base.signal) < 1e-9
    assert found.rebound_ratio == pytest.approx(base.rebound_ratio, abs=1e-9)
    assert model.speed_shift(local, RIG.frame()) == 0.0


@pytest.mark.parametrize("effect", [e for e in MODELLED if "hsd" in e.bases], ids=named)
def test_the_neutral_value_is_the_rigid_base_model(effect: Effect) -> None:
    """On a rigid cell, whose force is read between steps, neutral means 1e-5 of the peak."""
    base = RIG.predict("hsd")
    found = RIG.predict(f"hsd+{effect.id}", neutral(effect))
    assert apart(found.signal, base.signal) < 1e-5


@pytest.mark.parametrize("effect", MODELLED, ids=named)
def test_a_trace_is_finite_wherever_a_fit_may_look(effect: Effect) -> None:
    """Starts, bounds and small steps across the neutral point all give finite traces."""
    model = model_named(model_of(effect))
    start = RIG.local(model)
    trials = [start]
    for p in effect.parameters:
        j = model.names.index(f"{effect.id}.{p.name}")
        extra = () if p.form == "log" else (1e-4, -1e-4, 0.0)
        values = [p.coordinate(x) for x in (*p.starts, p.low, p.high) if x != 0.0]
        for coordinate in (*values, *extra):
            moved = start.copy()
            moved[j] = coordinate
            trials.append(moved)
    for local in trials:
        found = model.predict(local, RIG.frame(), steps=RIG.steps(model, local))
        assert np.isfinite(found.signal).all(), model.effect_values(local)


@pytest.mark.parametrize("effect", [e for e in MODELLED if e.parameters], ids=named)
def test_every_parameter_moves_the_model(effect: Effect) -> None:
    """At the start each coordinate has a finite derivative that is not zero."""
    model = model_named(model_of(effect))
    rig = RIG.but(speed=3.0) if effect.id == "plastic_yield" else RIG
    values = {}
    if effect.id.startswith("clipping"):
        peak = float(rig.predict("kv").signal.max())
        values = {f"{effect.id}.ceiling_v": 0.98 * peak}
    local = rig.local(model, values)
    steps = rig.steps(model, local)
    for p in effect.parameters:
        j = model.names.index(f"{effect.id}.{p.name}")
        above, below = local.copy(), local.copy()
        above[j] += 1e-4
        below[j] -= 1e-4
        moved = model.predict(above, rig.frame(), steps=steps).signal
        moved -= model.predict(below, rig.frame(), steps=steps).signal
        shift = model.speed_shift(above, rig.frame()) - model.speed_shift(below, rig.frame())
        slope = np.abs(moved).max() / np.abs(rig.predict("kv").signal).max() / 2e-4
        assert math.isfinite(slope)
        assert slope > 1e-6 or shift > 0


@pytest.mark.parametrize("effect", [e for e in MODELLED if e.output], ids=named)
def test_an_output_is_repeatable_and_leaves_its_input(effect: Effect) -> None:
    """An output keeps shape and length, gives the same twice, and does not write on its input."""
    assert effect.output is not None
    signal = RIG.predict("kv").signal
    kept = signal.copy()
    values = {p.name: p.starts[0] for p in effect.parameters}
    one = effect.output(signal, values, RIG.context())
    two = effect.output(signal, values, RIG.context())
    assert one.shape == signal.shape
    assert np.array_equal(one, two)
    assert np.array_equal(signal, kept)
    quiet = effect.output(np.zeros(50), values, RIG.context())
    assert np.array_equal(quiet, np.zeros(50))


@pytest.mark.parametrize("effect", [e for e in MODELLED if e.needs], ids=named)
def test_what_an_effect_needs_is_asked_for(effect: Effect) -> None:
    """Without a field that it needs an effect refuses instead of inventing one."""
    context = RIG.context()
    for name in effect.needs:
        assert context.known(name) > 0
    unknown = type(context)(**{**context.__dict__, **dict.fromkeys(effect.needs)})
    for name in effect.needs:
        with pytest.raises(ParameterOutOfRangeError, match=name):
            unknown.known(name)


def test_every_term_has_its_address() -> None:
    """Each law of contact has a compiled function of its own, which forms of it may share."""
    addresses = term_addresses()
    having = {e.id: e.contact for e in EVERY if e.contact is not None}
    assert set(having) <= set(addresses)
    assert len({addresses[name] for name in having}) == len(set(having.values()))


def test_a_variant_is_found_by_name() -> None:
    """A variant is named like an effect; an unknown name gets the likeliest, or where they are."""
    assert effect_named("amplifier_lowpass:second_order").output is not None
    with pytest.raises(UnknownModelError, match="clipping:soft"):
        effect_named("clipping:sotf")
    with pytest.raises(UnknownModelError, match="impactd effects"):
        effect_named("gremlins")


def test_the_readme_lists_the_library() -> None:
    """The table in the folder's README is the one the library makes."""
    text = (HERE / "README.md").read_text(encoding="utf-8")
    between = re.search(r"<!-- library -->\n(.*)\n<!-- end -->", text, re.S)
    assert between is not None
    assert between.group(1) == library_table()
