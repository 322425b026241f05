"""Moduli over the archive, from fits written by hand with known moduli behind them."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analysis.campaign import Quantity, Sphere, Surface
from drivers.digitizer import Record
from impactd.materials import Materials
from impactd.moduli_service import moduli
from impactd.storage.archive import Archive, DropRequest, ShotAbout
from impactd.storage.moment import utc_after, utc_now

NU = Quantity(0.35, 0.01)
TRUE_PA = {"acetal": 3.15e9, "aluminium": 69e9, "specimen": 2.3e9}
MATERIALS = Materials(
    {"acetal": Sphere("acetal", 4.76e-3, 0.6e-3, Quantity(3.15e9, 6e7), NU)},
    {
        "aluminium": Surface("aluminium", Quantity(69e9, 1e9), NU),
        "specimen": Surface("specimen", None, NU),
    },
)


@pytest.fixture
def archive(tmp_path: Path) -> Iterator[Archive]:
    """Return an open, empty archive."""
    with Archive.open(tmp_path, reserve_bytes=0) as opened:
        yield opened


@pytest.fixture
def fitted(archive: Archive) -> Callable[..., int]:
    """Return a function that stores a shot and a fit which saw the true moduli."""
    generator = np.random.default_rng(0)

    def make(surface: str = "specimen", *, clip: bool = False, **begin: Any) -> int:
        codes = generator.normal(0, 5, 3000)
        codes[1000:1100] += 9000 * np.sin(np.linspace(0, np.pi, 100))
        if clip:
            codes = np.minimum(codes, 4000)
        drop, _ = archive.begin_drop(
            DropRequest("acetal", surface, 0.047, "ab"), owner="a", **begin
        )
        about = ShotAbout(
            utc_now(),
            0,
            9.81,
            sphere=MATERIALS.spheres["acetal"],
            surface=MATERIALS.surfaces[surface],
        )
        record = Record(codes.astype(np.int16), 3e-4, 0, True, 1e6, 1, 10, 1000, 0, 0)
        number = archive.store_shot(drop.number, record, about).number
        plane = 1 - NU.value**2
        reduced = 1 / (plane / TRUE_PA["acetal"] + plane / TRUE_PA[surface])
        reduced *= math.exp(generator.normal(0, 0.002))
        pair = {
            "sphere": "acetal",
            "surface": surface,
            "shots": 1,
            "reduced_modulus_Pa": {"value": reduced, "u": 0.002 * reduced, "unit": "Pa"},
            "u_calibration_Pa": 0.0005 * reduced,
            "d_ln_reduced_modulus_d_ln_sensor": {
                "crystal_mass_kg": 0.01,
                "crystal_stiffness_n_per_m": 0.01,
                "crystal_damping_n_s_per_m": 0.01,
                "compliance_m_per_v": 0.01,
            },
        }
        result = {
            "model": "kv",
            "outcome": {"status": "converged", "message": "ok"},
            "pairs": {f"acetal/{surface}": pair},
        }
        archive.fits.add(number, "kv", None, result)
        return number

    return make


def test_the_true_modulus_lies_in_the_interval(
    archive: Archive, fitted: Callable[..., int]
) -> None:
    """Several drops on a reference and on the specimen give the specimen's modulus."""
    for surface in ("aluminium", "specimen") * 4:
        fitted(surface)

    found = moduli(archive, MATERIALS)

    low, high = found["moduli"]["specimen"]["youngs_modulus_Pa"]["interval95"]
    assert low < TRUE_PA["specimen"] < high
    assert found["moduli"]["specimen"]["status"] == "fitted"
    assert found["moduli"]["aluminium"]["status"] == "reference"
    assert [one["number"] for one in found["shots"]] == list(range(1, 9))
    json.dumps(found, allow_nan=False)


def test_without_fits_the_answer_is_empty_and_says_so(archive: Archive) -> None:
    """Nothing measured is an answer, not an error."""
    found = moduli(archive, MATERIALS, model="hsd")

    assert found["moduli"] == {}
    assert "hsd" in found["warnings"][0]


def test_a_specimen_is_reported_alone_but_all_shots_take_part(
    archive: Archive, fitted: Callable[..., int]
) -> None:
    """The filter limits what is shown, not what is known."""
    fitted("aluminium"), fitted("specimen")

    found = moduli(archive, MATERIALS, specimen="specimen")

    assert list(found["moduli"]) == ["specimen"]
    assert list(found["pairs"]) == ["acetal/specimen"]
    assert len(found["shots"]) == 2
    assert moduli(archive, MATERIALS, specimen="sand")["moduli"] == {}


def test_dates_choose_shots(archive: Archive, fitted: Callable[..., int]) -> None:
    """Only shots of the time asked for take part."""
    fitted()
    middle = utc_now()
    fitted()

    assert [s["number"] for s in moduli(archive, MATERIALS, since=middle)["shots"]] == [2]
    assert [s["number"] for s in moduli(archive, MATERIALS, until=middle)["shots"]] == [1]


def test_shots_that_must_not_count_are_listed_with_the_reason(
    archive: Archive, fitted: Callable[..., int]
) -> None:
    """Clipped records, calibration drops and failed fits stay out, by name."""
    archive.calibrations.begin(None, [], "timer")
    fitted()
    clipped, known = fitted(clip=True), fitted("aluminium", calibration=1)
    failed = fitted()
    outcome = {"status": "not_converged", "message": "still moving"}
    archive.fits.add(failed, "kv", None, {"model": "kv", "outcome": outcome})

    found = moduli(archive, MATERIALS)

    reasons = {one["shot"]: one["reason"] for one in found["excluded"]}
    assert set(reasons) == {clipped, known, failed}
    assert "limit" in reasons[clipped]
    assert "calibration 1" in reasons[known]
    assert reasons[failed] == "still moving"


@pytest.mark.parametrize(("days", "overdue"), [(30.0, False), (-1.0, True), (None, True)])
def test_an_overdue_calibration_shows_on_every_modulus(
    archive: Archive, fitted: Callable[..., int], days: float | None, overdue: bool
) -> None:
    """Before the first calibration, and after its end, every modulus says so."""
    if days is not None:
        archive.calibrations.begin(None, [], "timer")
        archive.calibrations.finish(1, {}, utc_after(days))
    fitted()

    found = moduli(archive, MATERIALS)

    assert {one["calibration_overdue"] for one in found["moduli"].values()} == {overdue}
    assert found["calibration"]["overdue"] is overdue
    assert any("calibrat" in one for one in found["warnings"]) is overdue
