"""Effects of the mounting, and the stand's, against DOP853 with the masses written anew."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from scipy.linalg import eigvals

from analysis.diagnosis.base_choice import MOST_STEPS
from analysis.effects.library import effect_named
from analysis.model.impact_model import model_named
from analysis.model.structure import Structure

from .conftest import Rig, apart
from .reference import Ground, Law

RIG = Rig()
K = RIG.stiffness
CELL = (RIG.cell_stiffness, RIG.cell_damping)


def law(d: float, r: float, z: object) -> tuple[float, float, tuple[()]]:
    """Return the base contact."""
    return K * d**1.5, RIG.dashpot(d, r), ()


BASE: Law = law


def taped(k: float, zeta: float, mass: float) -> Ground:
    """Return a coupon on its tape on the crystal."""
    c = 2 * zeta * math.sqrt(k * mass)
    return Ground([RIG.cell_mass, mass], [(0, -1, *CELL), (1, 0, k, c)], top=1)


def flexing(share: float, frequency: float, zeta: float) -> Ground:
    """Return an oscillator on the side of the crystal."""
    mass, omega = share * RIG.cell_mass, 2 * math.pi * frequency
    link = (1, 0, mass * omega**2, 2 * zeta * mass * omega)
    return Ground([RIG.cell_mass, mass], [(0, -1, *CELL), link])


def on_stand(ratio: float, frequency: float, zeta: float) -> Ground:
    """Return the cell on a base on the stand."""
    mass, omega = RIG.cell_mass / ratio, 2 * math.pi * frequency
    links = [(0, 1, *CELL), (1, -1, mass * omega**2, 2 * zeta * mass * omega)]
    return Ground([RIG.cell_mass, mass], links, base=1)


@pytest.mark.parametrize(("k", "zeta"), [(3e7, 0.1), (5e8, 0.02), (2e9, 1.5)])
def test_a_taped_coupon_agrees_with_two_masses(k: float, zeta: float) -> None:
    """Soft, stiff and overdamped tapes agree with DOP853 of two masses."""
    damping = 2 * zeta * math.sqrt(k * RIG.coupon_mass)
    values = {"adhesive_layer.stiffness_n_per_m": k, "adhesive_layer.damping_n_s_per_m": damping}
    found = RIG.predict("kv+adhesive_layer", values)
    form = "adhesive_layer:loss_factor"
    by_ratio = {f"{form}.stiffness_n_per_m": k, f"{form}.damping_ratio": zeta}
    same = RIG.predict(f"kv+{form}", by_ratio)
    assert apart(same.signal, found.signal) < 1e-12
    wanted = RIG.reference(law=BASE, ground=taped(k, zeta, RIG.coupon_mass))
    assert apart(found.signal, wanted.compression) < 3e-6
    assert found.rebound_ratio == pytest.approx(wanted.rebound / RIG.speed, abs=3e-6)


def test_a_search_turns_back_from_a_tape_as_good_as_rigid() -> None:
    """What asks for more solver steps than it may has no trace; the best of real tapes has one."""
    damping = "adhesive_layer.damping_n_s_per_m"
    model = dataclasses.replace(model_named("kv2+adhesive_layer"), most_steps=MOST_STEPS)
    for stiffness, there in ((3e10, True), (1e12, False)):
        values = {"adhesive_layer.stiffness_n_per_m": stiffness, damping: 1000.0}
        local = RIG.local(model, values)
        assert math.isfinite(model.predict(local, RIG.frame()).rebound_ratio) == there
        assert math.isfinite(RIG.predict("kv2+adhesive_layer", values).rebound_ratio)


def test_a_stiff_tape_is_a_heavier_crystal() -> None:
    """The limit of a stiff tape is the base model with the coupon's mass on the crystal."""
    heavy = RIG.but(cell_mass=RIG.cell_mass + RIG.coupon_mass).predict("kv").signal
    misses = []
    for k in (1e10, 1e11):
        damping = math.sqrt(k * RIG.coupon_mass)
        values = {
            "adhesive_layer.stiffness_n_per_m": k,
            "adhesive_layer.damping_n_s_per_m": damping,
        }
        misses.append(apart(RIG.predict("kv+adhesive_layer", values).signal, heavy))
    assert misses[0] < 0.02
    assert misses[1] < 0.2 * misses[0]


def test_the_ring_shifts_with_the_coupon() -> None:
    """The tell-tale: a heavier coupon rings lower."""

    def ring_hz(mass: float) -> float:
        rig = RIG.but(coupon_mass=mass, samples=6000)
        tail = rig.predict("kv+adhesive_layer").signal[400:2400]
        spectrum = np.abs(np.fft.rfft(tail * np.hanning(tail.size), 2**16))
        return float(np.argmax(spectrum)) * 1e6 / 2**16

    assert ring_hz(1e-3) > ring_hz(4e-3) + 300


@pytest.mark.parametrize(
    ("share", "frequency", "zeta"), [(0.05, 12e3, 0.03), (0.3, 40e3, 0.01), (-0.01, 9e3, 0.05)]
)
def test_a_coupon_mode_agrees_with_an_attached_mass(
    share: float, frequency: float, zeta: float
) -> None:
    """A side oscillator agrees with DOP853, on the far side of neutral too."""
    values = {
        "coupon_mode.mass_share": share,
        "coupon_mode.frequency_hz": frequency,
        "coupon_mode.damping_ratio": zeta,
    }
    found = RIG.predict("kv+coupon_mode", values)
    wanted = RIG.reference(law=BASE, ground=flexing(share, frequency, zeta))
    assert apart(found.signal, wanted.compression) < 3e-6


def test_a_mode_at_the_ring_splits_it() -> None:
    """A light oscillator tuned to the crystal splits its frequency by about sqrt(share)."""
    structure = Structure.kelvin_voigt(RIG.cell_mass, RIG.cell_stiffness, 0.0)
    omega = math.sqrt(RIG.cell_stiffness / RIG.cell_mass)
    from analysis.effects.library import effect_named  # noqa: PLC0415 - only here

    hook = effect_named("coupon_mode").structure
    assert hook is not None
    share = 1e-3
    values = {"mass_share": share, "frequency_hz": omega / (2 * math.pi), "damping_ratio": 1e-9}
    hook(structure, values, RIG.context())
    found = np.sort(np.unique(np.round(np.abs(eigvals(structure.assemble().system).imag), 3)))
    assert (found[-1] - found[0]) / omega == pytest.approx(math.sqrt(share), rel=0.01)


@pytest.mark.parametrize(("ratio", "frequency", "zeta"), [(0.05, 3e3, 0.05), (0.5, 8e3, 0.01)])
def test_a_cell_on_its_stand_agrees_with_two_masses(
    ratio: float, frequency: float, zeta: float
) -> None:
    """A base on the stand agrees with DOP853; what is read is the crystal less the base."""
    values = {
        "base_compliance.crystal_over_base_mass": ratio,
        "base_compliance.frequency_hz": frequency,
        "base_compliance.damping_ratio": zeta,
    }
    found = RIG.predict("kv+base_compliance", values)
    wanted = RIG.reference(law=BASE, ground=on_stand(ratio, frequency, zeta))
    assert apart(found.signal, wanted.compression) < 3e-6


def test_a_heavy_base_stands_still() -> None:
    """The effect falls in proportion to the base's lightness."""

    def effect_of(ratio: float) -> float:
        values = {"base_compliance.crystal_over_base_mass": ratio}
        return apart(RIG.predict("kv+base_compliance", values).signal, RIG.predict("kv").signal)

    assert effect_of(1e-5) < 1e-4
    assert effect_of(2e-4) / effect_of(1e-4) == pytest.approx(2.0, rel=0.01)


def test_the_base_is_the_same_under_every_coupon() -> None:
    """A coupon that rides on the crystal is no part of the crystal's mass over the base's."""
    effect = effect_named("base_compliance")
    assert effect.structure is not None
    for coupon_kg in (0.0, 5e-3):
        structure = Structure.kelvin_voigt(0.04, 4e8, 500.0, coupon_kg)
        values = {"crystal_over_base_mass": 0.1, "frequency_hz": 3e3, "damping_ratio": 0.05}
        effect.structure(structure, values, None)
        assert structure.masses["base"] == pytest.approx(0.4)


def test_structures_and_laws_act_together() -> None:
    """Tape, flexing coupon, stand and the whole reaction at once agree with one reference."""
    k, mass = 5e8, RIG.coupon_mass
    side, omega = 0.1 * mass, 2 * math.pi * 2e4
    base, slow = RIG.cell_mass / 0.1, 2 * math.pi * 3e3
    ground = Ground(
        [RIG.cell_mass, base, mass, side],
        [
            (0, 1, *CELL),
            (1, -1, base * slow**2, 2 * 0.05 * base * slow),
            (2, 0, k, 2 * 0.1 * math.sqrt(k * mass)),
            (3, 2, side * omega**2, 2 * 0.03 * side * omega),
        ],
        top=2,
        base=1,
    )
    found = RIG.predict(
        "kv+base_compliance+adhesive_layer+coupon_mode+dashpot_reaction",
        {
            "base_compliance.crystal_over_base_mass": 0.1,
            "base_compliance.frequency_hz": 3e3,
            "base_compliance.damping_ratio": 0.05,
            "adhesive_layer.stiffness_n_per_m": k,
            "adhesive_layer.damping_n_s_per_m": 2 * 0.1 * math.sqrt(k * mass),
            "coupon_mode.mass_share": 0.1,
            "coupon_mode.frequency_hz": 2e4,
            "coupon_mode.damping_ratio": 0.03,
            "dashpot_reaction.share": 1.0,
        },
    )
    wanted = RIG.reference(law=BASE, ground=ground, share=1.0)
    assert apart(found.signal, wanted.compression) < 3e-6
