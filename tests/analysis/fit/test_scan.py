"""The scan of contact times finds what made a record, and a calibrated cell needs no search."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from analysis.campaign import Campaign, Quantity, Sensor, Shot, Sphere, Surface
from analysis.fit import start
from analysis.fit.problem import FitShot, build
from analysis.fit.scan import best_contact_time
from analysis.model import solver
from analysis.model.hertz import contact_time, damping_coefficient
from analysis.model.impact_model import model_named

OMEGA0, ZETA, MASS_KG, RADIUS_M, SPEED = 1.08e5, 0.073, 6.1e-4, 4.76e-3, 0.77
TOUCH = 1500
SENSOR = Sensor(
    compliance_m_per_v=Quantity(1.2e-8, 3.6e-10),
    crystal_mass_kg=Quantity(35.4e-3, 3.1e-3),
    crystal_stiffness_n_per_m=Quantity(35.4e-3 * OMEGA0**2, 0.1 * 35.4e-3 * OMEGA0**2),
    crystal_damping_n_s_per_m=Quantity(2 * ZETA * 35.4e-3 * OMEGA0, 60.0),
)


def _campaign(stiffness: float) -> Campaign:
    rng = np.random.default_rng(0)
    signal = rng.normal(0.0, 1e-3, 5000)
    signal[TOUCH:] += solver.trace(
        kind=solver.KV,
        sample_times_start_s=0.0,
        sample_interval_s=1e-6,
        samples=5000 - TOUCH,
        stiffness=stiffness,
        mass_kg=MASS_KG,
        speed_m_per_s=SPEED,
        alpha=damping_coefficient(0.75),
        crystal_mass_kg=35.4e-3,
        crystal_stiffness_n_per_m=35.4e-3 * OMEGA0**2,
        crystal_damping_n_s_per_m=2 * ZETA * 35.4e-3 * OMEGA0,
        gain=1 / 1.2e-8,
    )[0]
    height = SPEED**2 / (2 * 9.80665)
    shot = Shot("one", signal, 1e6, TOUCH + 3, "voltage", "ball", "plate", height)
    spheres = {"ball": Sphere("ball", RADIUS_M, MASS_KG)}
    return Campaign((shot,), spheres, {"plate": Surface("plate")}, SENSOR)


def _item(stiffness: float) -> FitShot:
    return build(_campaign(stiffness), model_named("kv"), by_pair=True).shots[0]


@pytest.mark.parametrize("stiffness", [2e7, 1.4e8, 1e9])
def test_the_scan_finds_the_contact_time_and_the_touch_down(stiffness: float) -> None:
    """The grid's step is 16 %; amplitude and shift follow."""
    item = _item(stiffness)
    _, duration, amplitude, shift = best_contact_time(
        item, model_named("kv"), speed=SPEED, omega0=OMEGA0, zeta=ZETA, e=0.75
    )
    true = contact_time(stiffness, MASS_KG, SPEED)
    assert abs(math.log(duration / true)) < 0.1
    assert shift == pytest.approx(TOUCH - item.window.first, abs=3)
    gain = 35.4e-3 * OMEGA0**2 * 1.2e-8
    assert amplitude * gain == pytest.approx(1.0, rel=0.2)


def test_a_cell_whose_frequency_is_known_is_not_searched_for_its_ring(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A covariance that fixes k / M is enough, however uncertain both are by themselves."""
    loose = np.diag([0.1, 0.1, 0.1, 0.1]) ** 2
    sharp = loose.copy()
    sharp[0, 1] = sharp[1, 0] = 0.1**2 - 1e-8
    asked = []
    monkeypatch.setattr(start, "ring_in_tails", lambda items, near: asked.append(near))
    for covariance in (loose, sharp):
        cell = dataclasses.replace(SENSOR, covariance=covariance)
        campaign = dataclasses.replace(_campaign(1.4e8), sensor=cell)
        start.with_start(build(campaign, model_named("kv"), by_pair=True))
    assert len(asked) == 1
