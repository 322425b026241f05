"""The temperature of stored shots reaches the daemon's calibrations and fits."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from analysis.campaign import Environment, Quantity
from drivers.digitizer import Record
from drivers.simulated.campaign import CampaignSettings, simulate_campaign
from impactd.jobs import tasks
from impactd.jobs.orders import order_for, request_calibration_fit, request_fit
from impactd.settings.materials import Materials
from impactd.storage.archive import DropRequest, ShotMetadata
from impactd.storage.timestamp import utc_now

COEFFICIENT = Quantity(-5e-3, 1e-4)


@dataclass(frozen=True)
class Softening:
    """An archive with the same shots at two temperatures, and materials whose acetal softens."""

    bench: Any
    materials: Materials
    runs: dict[float, int]
    shots: dict[float, list[int]]

    def order(self, job: Any) -> dict[str, Any]:
        """Return what the worker gets."""
        return order_for(job, self.bench.archive, self.bench.settings, self.materials)


@pytest.fixture
def softening(bench: Any) -> Softening:
    """Store a small calibration at 20 and at 30 degC."""
    usual = CampaignSettings()
    made = simulate_campaign(
        replace(
            usual,
            spheres={"acetal": usual.spheres["acetal"]},
            surfaces={"aluminium": usual.surfaces["aluminium"]},
            drop_heights_m=(0.015, 0.045),
            repeats=2,
        ),
        3,
    )
    acetal = replace(bench.materials.spheres["acetal"], modulus_coefficient_per_k=COEFFICIENT)
    materials = replace(bench.materials, spheres=bench.materials.spheres | {"acetal": acetal})
    found = Softening(bench, materials, {}, {})
    for celsius in (20.0, 30.0):
        run, _ = bench.archive.calibrations.begin(None, [], "ab")
        found.runs[celsius] = run.number
        found.shots[celsius] = [
            _store(found, told, codes, celsius)
            for told, codes in zip(made["campaign"]["shots"], made["codes"], strict=True)
        ]
    return found


def _store(softening: Softening, told: dict[str, Any], codes: Any, celsius: float) -> int:
    archive, height_m = softening.bench.archive, told["drop_height_m"]
    height_m = height_m["value"] if isinstance(height_m, dict) else height_m
    drop, _ = archive.begin_drop(
        DropRequest("acetal", "aluminium", height_m, "ab"),
        owner="ab",
        calibration=softening.runs[celsius],
    )
    per_code = told["volts_per_code"]
    per_code = per_code["value"] if isinstance(per_code, dict) else per_code
    trigger = told["trigger_index"]
    record = Record(np.asarray(codes), per_code, 0.0, True, 1e6, 10.0, 10.0, trigger, 0, 0)
    metadata = ShotMetadata(
        utc_now(),
        0,
        softening.bench.settings.release.gravity_m_per_s2,
        sphere=softening.materials.spheres["acetal"],
        surface=softening.materials.surfaces["aluminium"],
        drop_height_m=height_m,
        speed_repeatability=0.003,
        environment=Environment(Quantity(celsius, 0.1)),
    )
    return archive.store_shot(drop.number, record, metadata).number


@pytest.mark.parametrize("side", ["spheres", "surfaces"])
def test_an_order_carries_the_coefficients_of_the_materials(
    softening: Softening, side: str
) -> None:
    """What the materials file states of temperature reaches the worker, and nothing else does."""
    known = softening.bench.materials
    one = {"spheres": "acetal", "surfaces": "specimen"}[side]
    changed = replace(
        getattr(known, side)[one],
        modulus_coefficient_per_k=COEFFICIENT,
        modulus_temperature_c=20.0,
    )
    materials = replace(known, **{side: getattr(known, side) | {one: changed}})
    archive, settings = softening.bench.archive, softening.bench.settings
    order = order_for(
        request_fit(archive, softening.shots[20.0], "kv2"), archive, settings, materials
    )
    told = order[side][one]
    assert told["modulus_coefficient_per_K"] == {"value": -5e-3, "u": 1e-4}
    assert told["modulus_temperature_C"] == 20.0
    assert [n for n, one in order[side].items() if "modulus_coefficient_per_K" in one] == [one]


def test_a_calibration_takes_its_references_at_the_temperature_of_its_drops(
    softening: Softening,
) -> None:
    """Ten kelvins warmer acetal is e^(-0.05) as stiff, and the gain moves as it depends on that."""
    found = {}
    for celsius, run in softening.runs.items():
        job = request_calibration_fit(softening.bench.archive, run)
        found[celsius] = tasks.calibrate(softening.order(job))["calibration"]
        assert found[celsius]["outcome"]["status"] == "converged"
    cold, warm = found[20.0], found[30.0]
    place = cold["drift_basis"]["names"].index("sphere.acetal")
    stated = [one["drift_basis"]["stated"][place] for one in (cold, warm)]
    assert stated[1] - stated[0] == pytest.approx(-0.05)
    follows = cold["drift_basis"]["combinations"]["gain_N_per_V"]["sensitivity"][place]
    gains = [one["identifiable"]["gain_N_per_V"]["value"] for one in (cold, warm)]
    # That is how it follows at 20 degC; at 30 it is a little otherwise.
    assert math.log(gains[1] / gains[0]) == pytest.approx(-0.05 * follows, rel=0.1)
    assert abs(follows) > 1e-4
    rigid = [one["hsd"]["gain_N_per_V"]["value"] for one in (cold, warm)]
    assert rigid[1] > rigid[0]


def test_a_joint_fit_takes_its_references_at_the_temperature_of_its_shots(
    softening: Softening,
) -> None:
    """The same records at another temperature are judged by another stated modulus."""
    moved = []
    for numbers in softening.shots.values():
        job = request_fit(softening.bench.archive, numbers, "kv2")
        fit = tasks.fit_campaign(softening.order(job))["fit"]
        moved.append(fit["moduli"]["acetal"]["shift_from_stated_in_u"])
        assert not any("temperature of the shots" in said for said in fit["assumptions"])
    # The shots know the modulus much better than the statement, which alone moves by 5 %.
    stated = softening.materials.spheres["acetal"].youngs_modulus_pa
    assert stated is not None
    assert moved[1] - moved[0] == pytest.approx(0.05 * stated.value / stated.u, rel=0.2)


def test_a_shot_without_temperature_says_what_was_assumed(softening: Softening) -> None:
    """Its references are taken as stated, and the fit lists that."""
    bench, known = softening.bench, softening.materials
    bench.materials = known
    number = bench.store("acetal", "polycarbonate")
    order = softening.order(request_fit(bench.archive, [number], "hsd"))
    (fit,) = tasks.fit_shot(order)["fits"]
    assert any("temperature of the shots is not known" in said for said in fit["assumptions"])
