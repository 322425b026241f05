"""A rig from a script: drops, series, calibrations, errors."""

from __future__ import annotations

import subprocess
import sys

import pytest

from impactd.client import (
    EndedError,
    InvalidError,
    NotFoundError,
    ProblemError,
    Rig,
    RigError,
    TokenError,
    UnreachableError,
    cm,
    mm,
)
from impactd.client.talk import shot_of_drop, silent
from tests.impactd.api.conftest import Rig as Served
from tests.impactd.client.line import Line


def test_a_drop_is_one_line(rig: Rig) -> None:
    """A drop of 45 mm comes back as a shot with its modulus, its advice and why."""
    told = []
    with Rig(rig.connection.url, _token(rig), progress=lambda *how: told.append(how)) as own:
        shot = own.drop("acetal", "specimen", 45 * mm, operator="ab")
    assert (shot.sphere, shot.surface, shot.operator) == ("acetal", "specimen", "ab")
    assert shot.drop_height_m == 0.045
    assert {fit.model for fit in shot.fits or []} >= {"hsd", "kv", "kv2"}
    assert shot.advice in ("use", "check", "repeat")
    assert shot.repetitions is not None
    assert any("armed" in text or "released" in text or "stored" in text for text, _ in told)


def test_lengths_are_the_numbers_of_the_settings() -> None:
    """Millimetres and centimetres give the very float that stands in a file."""
    assert [count * mm for count in (3, 9, 45, 47)] == [0.003, 0.009, 0.045, 0.047]
    assert 4.5 * cm == 0.045


def test_millimetres_without_their_unit_are_refused(rig: Rig) -> None:
    """A height of 45 is no height; the error says how to write it, and nothing falls."""
    before = next(rig.shots(limit=1), None)
    with pytest.raises(RigError, match=r"write 45 \* mm"):
        rig.drop("acetal", "specimen", 45)
    after = next(rig.shots(limit=1), None)
    assert (before and before.number) == (after and after.number)


def test_temperature_goes_with_the_drop(rig: Rig) -> None:
    """What the technician read is kept with its uncertainty."""
    rig.wait_until_ready()
    shot = rig.drop("acetal", "aluminium", 30 * mm, temperature_C=(22.4, 0.2))
    assert shot.environment is not None
    assert shot.environment["temperature_C"] == {"value": 22.4, "u": 0.2}


def test_a_series_repeats_and_a_second_run_of_the_script_drops_nothing(rig: Rig) -> None:
    """A series with a key of its own, run twice, is the same shots; the rest is dropped."""
    with rig.series("acetal", "aluminium", 30 * mm, repeats=2, key="monday") as series:
        numbers = [shot.number for shot in series]
    with rig.series("acetal", "aluminium", 30 * mm, repeats=3, key="monday") as series:
        again = [shot.number for shot in series]
    assert again[:2] == numbers
    assert len(set(again)) == 3


def test_an_error_in_a_series_aborts_its_drop(served: Served, rig: Rig) -> None:
    """Ctrl-C while a drop waits for its sphere ends that drop on the rig, too."""
    rig.wait_until_ready()

    def interrupt(text: str, share: float | None) -> None:
        raise KeyboardInterrupt

    with (
        Rig(served.url, served.token("operate"), progress=interrupt) as own,
        pytest.raises(KeyboardInterrupt),
        own.series("acetal", "aluminium", 30 * mm, repeats=2) as series,
    ):
        list(series)
    (newest,) = served.reader.get("/v1/drops", params={"limit": 1}).json()["items"]
    assert served.ended(newest["number"])["state"] == "aborted"
    with pytest.raises(EndedError, match="abort") as failed:
        rig.connection.run(_shot_of(newest["number"]))
    assert failed.value.answer["number"] == newest["number"]


def test_a_calibration_is_waited_for(rig: Rig) -> None:
    """Leaving the block of a calibration without an error waits until it is done."""
    rig.wait_until_ready()
    with rig.calibration() as run:
        assert run.answer.state in ("requested", "running")
    assert run.answer.state == "done"
    assert rig.current_calibration().number == run.answer.number


def test_a_fit_of_several_shots_comes_back_done(rig: Rig) -> None:
    """A joint fit is asked for and waited for."""
    numbers = [shot.number for shot in rig.shots(limit=2, surface="aluminium")]
    fit = rig.fit(numbers, "hsd")
    assert fit.state == "done"
    assert fit.fits[0].model == "hsd"


def test_a_lost_answer_makes_one_drop(served: Served) -> None:
    """A line that breaks between drop and answer is tried again, and one sphere falls."""
    with Line(served.url) as line, Rig(line.url, served.token("operate"), operator="ab") as own:
        own.wait_until_ready()
        before = served.reader.get("/v1/drops", params={"limit": 1}).json()["items"][0]["number"]
        line.swallow()
        shot = own.drop("acetal", "aluminium", 30 * mm)
    assert shot.number == before + 1
    newest = served.reader.get("/v1/drops", params={"limit": 1}).json()["items"][0]["number"]
    assert newest == before + 1


def test_a_problem_is_an_exception_with_its_remedy(served: Served, rig: Rig) -> None:
    """Each kind of problem has its class, the stable type, what happened and what to do."""
    with pytest.raises(NotFoundError) as missing:
        rig.shot(999_999)
    assert missing.value.type == "urn:impactd:problem:not-found"
    assert missing.value.remedy
    assert missing.value.remedy in str(missing.value)
    with pytest.raises(NotFoundError, match="unobtainium"):
        rig.drop("unobtainium", "aluminium", 30 * mm)
    with pytest.raises(InvalidError):
        rig.drop("acetal", "aluminium", -1)
    with Rig(served.url, "nonsense") as stranger, pytest.raises(TokenError):
        next(stranger.shots())
    with Rig(served.url, served.token("read")) as reader, pytest.raises(TokenError) as small:
        reader.abort()
    assert isinstance(small.value, ProblemError)
    assert small.value.status == 403


def test_a_daemon_that_is_not_there_is_named() -> None:
    """No daemon at the address: the error says so and what to do."""
    with Rig("http://127.0.0.1:9", "x") as nobody, pytest.raises(UnreachableError, match="serve"):
        nobody.status()


def test_the_client_loads_nothing_of_the_daemon() -> None:
    """A process with a rig has no module of daemon, drivers or analysis."""
    code = (
        "import sys, impactd.client.rig, impactd.client.async_rig\n"
        "own = ('impactd', 'drivers', 'analysis')\n"
        "ours = {m for m in sys.modules if m.partition('.')[0] in own}\n"
        "foreign = {m for m in ours if not m.startswith(('impactd.client', 'impactd.wire'))}\n"
        "heavy = {'fastapi', 'numpy', 'h5py', 'pandas', 'numba'} & set(sys.modules)\n"
        "print(foreign - {'impactd', 'impactd.aliases'}, heavy)"
    )
    made = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert made.stdout.strip() == "set() set()"


def _token(rig: Rig) -> str:
    return rig.connection._http.headers["Authorization"].removeprefix("Bearer ")


def _shot_of(number: int):
    return shot_of_drop(number, silent)
