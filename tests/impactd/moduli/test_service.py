"""Moduli over the archive, from fits written by hand with known moduli behind them."""

from __future__ import annotations

import json
import math
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analysis.campaign import Environment, Quantity, Sphere, Surface
from drivers.digitizer import Record
from impactd.moduli import service as moduli_service
from impactd.moduli.observations import IDS_AT_ONCE, Observations
from impactd.moduli.service import MODELS_KEPT, NETWORKS_KEPT, ModuliService
from impactd.settings.materials import Materials
from impactd.storage.archive import Archive, DropRequest, Recording, ShotMetadata
from impactd.storage.timestamp import utc_after, utc_now

NU = Quantity(0.35, 0.01)
TRUE_PA = {"acetal": 3.15e9, "aluminium": 69e9, "specimen": 2.3e9}
MATERIALS = Materials(
    {"acetal": Sphere("acetal", 4.76e-3, 0.6e-3, Quantity(3.15e9, 6e7), NU)},
    {
        "aluminium": Surface("aluminium", Quantity(69e9, 1e9), NU),
        "specimen": Surface("specimen", None, NU),
    },
)


def moduli(
    archive: Archive, materials: Materials, service: ModuliService | None = None, **choice: Any
) -> dict[str, Any]:
    """Return the answer as a client sees it, by default of a service that has seen nothing yet."""
    answer = (service or ModuliService(archive)).answer(materials, **choice)
    return answer.head | {name: json.loads(text) for name, text in answer.lists.items()}


@pytest.fixture
def archive(tmp_path: Path) -> Iterator[Archive]:
    """Return an open, empty archive."""
    with Archive.open(tmp_path, reserve_bytes=0) as opened:
        yield opened


@pytest.fixture
def fitted(archive: Archive) -> Callable[..., int]:
    """Return a function that stores a shot and a fit which saw the true moduli."""
    generator = np.random.default_rng(0)

    def make(
        surface: str = "specimen",
        *,
        clip: bool = False,
        cell: int | None = None,
        around: Environment | None = None,
        **begin: Any,
    ) -> int:
        codes = generator.normal(0, 5, 3000)
        codes[1000:1100] += 9000 * np.sin(np.linspace(0, np.pi, 100))
        if clip:
            codes = np.minimum(codes, 4000)
        drop, _ = archive.begin_drop(
            DropRequest("acetal", surface, 0.047, "ab"), owner="a", **begin
        )
        metadata = ShotMetadata(
            utc_now(),
            0,
            9.81,
            sphere=MATERIALS.spheres["acetal"],
            surface=MATERIALS.surfaces[surface],
            environment=around,
        )
        record = Record(codes.astype(np.int16), 3e-4, 0, True, 1e6, 1, 10, 1000, 0, 0)
        number = archive.store_shot(drop.number, record, metadata).number
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
            "model": "kv2",
            "outcome": {"status": "converged", "message": "ok"},
            "pairs": {f"acetal/{surface}": pair},
        }
        archive.fits.add(number, "kv2", cell, result)
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


def test_stated_moduli_are_those_at_the_temperature_of_the_shots(
    archive: Archive, fitted: Callable[..., int]
) -> None:
    """References that were 5 % stiffer on the day of their data sheet, ten kelvins colder."""
    coefficient = Quantity(-5e-3, 1e-6)
    stiffer = {
        name: replace(
            surface,
            youngs_modulus_pa=Quantity(surface.youngs_modulus_pa.value * math.exp(0.05), 0.2e9),
            modulus_coefficient_per_k=coefficient,
        )
        for name, surface in MATERIALS.surfaces.items()
        if surface.youngs_modulus_pa is not None
    }
    colder = replace(MATERIALS, surfaces=MATERIALS.surfaces | stiffer)
    service = ModuliService(archive)
    for surface in ("aluminium", "specimen"):
        fitted(surface, around=Environment(Quantity(33.0, 0.01)))
    found = moduli(archive, colder, service)
    stated = MATERIALS.surfaces["aluminium"].youngs_modulus_pa
    assert stated is not None
    at_33 = found["moduli"]["aluminium"]["youngs_modulus_Pa"]["value"]
    assert at_33 == pytest.approx(stated.value, rel=1e-3)
    assert not any("temperature" in said for said in found["warnings"])

    fitted("aluminium")
    found = moduli(archive, colder, service)
    as_stated = found["moduli"]["aluminium"]["youngs_modulus_Pa"]["value"]
    assert as_stated == pytest.approx(stated.value * math.exp(0.05), rel=1e-3)
    assert any("temperature of the shots is not known" in said for said in found["warnings"])


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
    archive.fits.add(failed, "kv2", None, {"model": "kv2", "outcome": outcome})

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


CELL = {
    "format": "impactd-calibration/1",
    "outcome": {"status": "converged", "message": "ok"},
    "parameters": {},
    "covariance": {"matrix": np.diag([9e-4, 4e-4, 1e-4, 4e-6]).tolist()},
    "hsd": None,
}


def _from_the_tables(archive: Archive, model: str, since: str, until: str) -> dict[str, Any]:
    """Return which shots count and why others do not, row by row, with nothing kept."""
    latest = {}
    for row in archive._index.rows(
        "SELECT * FROM fits WHERE model=? AND shot > 0 ORDER BY id", (model,)
    ):
        latest[row["shot"]] = json.loads(row["result"])
    shots, excluded = [], []
    for number in sorted(latest):
        shot, outcome = archive.shot(number), latest[number]["outcome"]
        if not since <= shot.started_utc < until:
            continue
        if shot.source == "import":
            reason = "it was recorded on another rig; fit its campaign instead"
        elif outcome["status"] != "converged":
            reason = outcome["message"]
        elif shot.clipped:
            reason = "it reaches a limit of the converter or amplifier"
        elif (series := archive.drop(number).calibration) is not None:
            reason = f"it belongs to calibration {series}"
        else:
            shots.append({"number": number, "sha256": shot.sha256})
            continue
        excluded.append({"shot": number, "reason": reason})
    return {"shots": shots, "excluded": excluded}


def _import(archive: Archive, origin: str) -> int:
    generator = np.random.default_rng(5)
    signal = generator.normal(0, 1e-3, 3000)
    signal[1000:1100] += np.sin(np.linspace(0, np.pi, 100))
    recording = Recording(signal, 1.0, 0.0, "voltage", 1e6, 10.0, 1000)
    metadata = ShotMetadata(utc_now(), 0, 9.81, source="import", origin=origin)
    return archive.store_import(recording, metadata).number


def test_what_is_kept_gives_the_answer_of_the_tables(
    archive: Archive, fitted: Callable[..., int]
) -> None:
    """A service that watched an archive grow answers as one that reads it anew, for any choice."""
    watching = ModuliService(archive)
    moments = [utc_now()]
    archive.calibrations.begin(None, [], "timer")
    for number, surface in enumerate(("aluminium", "specimen", "specimen")):
        fitted(surface), fitted(surface, clip=number == 1), fitted("aluminium", calibration=1)
        moduli(archive, MATERIALS, watching)
        moments.append(utc_now())
    archive.calibrations.finish(1, CELL, utc_after(30))
    failed, again = fitted(cell=1), fitted("aluminium", cell=1)
    moments.append(utc_now())
    outcome = {"status": "not_converged", "message": "moving \ud800 on"}
    archive.fits.add(failed, "kv2", 1, {"model": "kv2", "outcome": outcome})
    archive.fits.add(again, "kv2", None, archive.fits.for_shot(1)[0].result)
    imported = _import(archive, "elsewhere")
    archive.fits.add(imported, "kv2", None, archive.fits.for_shot(1)[0].result)
    archive.fits.add(1, "hsd", None, {"model": "hsd", "outcome": outcome})
    archive.fits.add(None, "kv2", None, {"model": "kv2", "outcome": outcome})
    moments.append(utc_now())

    for model in ("kv2", "hsd"):
        for since in moments:
            for until in moments:
                choice = {"model": model, "since": since, "until": until}
                kept = moduli(archive, MATERIALS, watching, **choice, specimen="specimen")
                assert kept == moduli(archive, MATERIALS, **choice, specimen="specimen")
                expected = _from_the_tables(archive, model, since, until)
                for one in expected["excluded"]:
                    one["reason"] = one["reason"].encode("utf-8", "replace").decode()
                assert {name: kept[name] for name in expected} == expected


def test_an_unchanged_archive_is_not_read_again(
    archive: Archive, fitted: Callable[..., int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Only fits that were written since are read, and a network is adjusted once."""
    fitted("aluminium"), fitted()
    service = ModuliService(archive)
    first = service.answer(MATERIALS)
    read: list[int] = []
    of_shots = archive.fits.of_shots

    def counted(model: str, *, after: int, last: int) -> list[Any]:
        found = of_shots(model, after=after, last=last)
        read.extend(one.fit.id for one in found)
        return found

    monkeypatch.setattr(archive.fits, "of_shots", counted)

    assert service.answer(MATERIALS).lists is first.lists
    assert read == []
    new = fitted()
    assert service.answer(MATERIALS).lists is not first.lists
    assert read == [archive.fits.for_shot(new)[0].id]


def test_budgets_account_for_what_the_answer_states(
    archive: Archive, fitted: Callable[..., int]
) -> None:
    """Every stated modulus has rows that add up to its u; the filter limits what is shown."""
    for surface in ("aluminium", "specimen") * 4:
        fitted(surface)
    service = ModuliService(archive)
    stated = moduli(archive, MATERIALS, service)["moduli"]

    found = service.budget(MATERIALS)

    assert (found["format"], found["shots"]) == ("impactd-budget/1", 8)
    assert set(found["moduli"]) == set(stated)
    assert found["status"]["specimen"] == "fitted"
    for name, budgets in found["moduli"].items():
        for measurand, one in budgets.items():
            assert one["u"] == pytest.approx(stated[name][measurand]["u"], rel=1e-8)
            assert sum(row["share"] for row in one["rows"]) == pytest.approx(1.0)
    only = service.budget(MATERIALS, specimen="specimen")
    assert only["moduli"] == {"specimen": found["moduli"]["specimen"]}
    assert service.budget(MATERIALS, model="hsd")["moduli"] == {}
    json.dumps(found, allow_nan=False)


def test_a_budget_is_made_when_asked_for_and_follows_the_archive(
    archive: Archive, fitted: Callable[..., int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Moduli never wait for one; an unchanged one is not made again, a new fit changes it."""
    made: list[int] = []
    real = moduli_service._budgets

    def counted(*given: Any) -> Any:
        made.append(1)
        return real(*given)

    monkeypatch.setattr(moduli_service, "_budgets", counted)
    fitted("aluminium"), fitted()
    service = ModuliService(archive)
    service.answer(MATERIALS)
    assert made == []
    first = service.budget(MATERIALS)
    first["moduli"]["specimen"]["youngs_modulus_Pa"]["conformity"] = {"decision": "pass"}
    second = service.budget(MATERIALS)
    assert made == [1]
    assert "conformity" not in second["moduli"]["specimen"]["youngs_modulus_Pa"]
    fitted()
    assert service.budget(MATERIALS)["shots"] == 3
    assert made == [1, 1]


def test_changed_materials_give_another_network(
    archive: Archive, fitted: Callable[..., int]
) -> None:
    """What is kept belongs to the materials it was made with."""
    fitted("aluminium"), fitted()
    service = ModuliService(archive)
    before = moduli(archive, MATERIALS, service)
    stiffer = replace(MATERIALS.spheres["acetal"], youngs_modulus_pa=Quantity(3.4e9, 6e7))
    others = Materials({"acetal": stiffer}, MATERIALS.surfaces)

    after = moduli(archive, others, service)

    assert after == moduli(archive, others)
    assert after["moduli"] != before["moduli"]


def test_only_so_many_networks_are_kept(archive: Archive, fitted: Callable[..., int]) -> None:
    """Whatever choices are asked for, memory stays bounded."""
    fitted()
    service = ModuliService(archive)

    for number in range(3 * NETWORKS_KEPT):
        service.answer(MATERIALS, since=f"2026-01-01T00:00:{number:02d}.000000Z")
        service.answer(MATERIALS, model=f"kv2+{number}")

    assert len(service._networks) == NETWORKS_KEPT
    assert len(service._observations) == MODELS_KEPT


def test_the_archive_is_taken_in_beforehand_and_the_thread_ends(
    archive: Archive, fitted: Callable[..., int]
) -> None:
    """The thread waits for what is more urgent, takes the fits in, and ends when it is told to.

    Whoever asks first afterwards gets the network that it adjusted.
    """
    fitted("aluminium"), fitted()
    urgent = threading.Event()
    service = ModuliService(archive)
    service.start("kv2", lambda: MATERIALS, urgent.wait)
    urgent.set()
    assert service._thread is not None
    service._thread.join(60)
    assert service._observations["kv2"].version == 2
    (adjusted,) = service._networks.values()
    assert service.answer(MATERIALS, model="kv2").lists is adjusted.lists
    service.stop()

    waiting = ModuliService(archive)
    waiting.start("kv2", lambda: MATERIALS, threading.Event().wait)
    waiting.stop()
    assert not waiting._observations


def test_taking_fits_in_stops_between_batches_and_goes_on_later(
    archive: Archive, fitted: Callable[..., int]
) -> None:
    """No step holds the index for long; what a stop left out is taken in the next time."""
    number = fitted()
    result = archive.fits.for_shot(number)[0].result
    with archive.transaction():
        for _ in range(2 * IDS_AT_ONCE):
            archive.fits.add(number, "kv2", None, result)
    observations = Observations(archive, "kv2")
    answers = iter([False, True])

    observations.update(lambda: next(answers))
    assert observations.version == IDS_AT_ONCE
    observations.update()
    assert observations.version == 2 * IDS_AT_ONCE + 1
