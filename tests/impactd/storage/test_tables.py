"""The tables beside drops and shots."""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from impactd.storage.archive import (
    Archive,
    ArchiveError,
    IdempotencyConflictError,
    NotFoundError,
    Problem,
)
from impactd.storage.timestamp import as_utc, utc_after, utc_now


def test_jobs_are_claimed_in_order_and_once(archive: Archive) -> None:
    """The oldest waiting job is taken, by one only."""
    first = archive.jobs.enqueue("fit_shot", {"shot": 1}, "shot 1")
    second = archive.jobs.enqueue("fit_shot", {"shot": 2}, "shot 2")

    claimed = [archive.jobs.claim(), archive.jobs.claim(), archive.jobs.claim()]

    assert [job and job.id for job in claimed] == [first.id, second.id, None]
    assert archive.jobs.get(1).state == "running"
    assert archive.jobs.finish(1, {"fits": [3]}).result == {"fits": [3]}
    assert archive.jobs.waiting() == 1


def test_a_job_is_retried_once(archive: Archive) -> None:
    """The first lost worker costs an attempt, the second one the job."""
    archive.jobs.enqueue("fit_shot", {}, "shot 1")

    archive.jobs.claim()
    assert archive.jobs.fail(1, "crashed", retry=True).state == "queued"
    archive.jobs.claim()
    failed = archive.jobs.fail(1, "crashed again", retry=True)

    assert (failed.state, failed.reason, failed.attempts) == ("failed", "crashed again", 2)


def test_a_job_given_back_costs_no_attempt(archive: Archive) -> None:
    """A restart of the daemon is not the job's fault."""
    archive.jobs.enqueue("fit_shot", {}, "shot 1")
    archive.jobs.claim()

    job = archive.jobs.give_back(1)

    assert (job.state, job.attempts) == ("queued", 0)


def test_a_jobs_key_gives_the_same_job(archive: Archive) -> None:
    """A repeated request is the same job; another body under the key is refused."""
    job = archive.jobs.enqueue("fit_shot", {"shot": 1}, "shot 1", key="k")

    assert archive.jobs.enqueue("fit_shot", {"shot": 1}, "shot 1", key="k") == job
    with pytest.raises(IdempotencyConflictError):
        archive.jobs.enqueue("fit_shot", {"shot": 2}, "shot 2", key="k")


def test_jobs_of_a_dead_process_wait_again(tmp_path: Path) -> None:
    """A job whose daemon was killed is found at the next opening, and only then."""
    script = (
        "import sys, pathlib; from impactd.storage.archive import Archive\n"
        "a = Archive.open(pathlib.Path(sys.argv[1]), reserve_bytes=0)\n"
        "a.jobs.enqueue('fit_shot', {}, 'shot 1'); a.jobs.claim()\n"
        "print('claimed', flush=True); sys.stdin.read()\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", script, tmp_path], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as process:
        assert process.stdout is not None
        process.stdout.readline()
        with Archive.open(tmp_path, reserve_bytes=0) as archive:
            assert archive.jobs.get(1).state == "running"
        process.kill()

    with Archive.open(tmp_path, reserve_bytes=0) as archive:
        assert archive.jobs.get(1).state == "queued"


def test_a_daemon_that_ends_costs_its_jobs_no_attempt(tmp_path: Path) -> None:
    """Killed as often as you like, the job waits again; only its own worker's crash counts."""
    with Archive.open(tmp_path, reserve_bytes=0) as archive:
        archive.jobs.enqueue("fit_shot", {"shot": 1}, "shot 1")
    script = (
        "import os, sys, pathlib; from impactd.storage.archive import Archive\n"
        "Archive.open(pathlib.Path(sys.argv[1]), reserve_bytes=0).jobs.claim(); os._exit(9)\n"
    )
    for _ in range(3):
        died = subprocess.run([sys.executable, "-c", script, tmp_path], check=False)
        assert died.returncode == 9
    with Archive.open(tmp_path, reserve_bytes=0) as archive:
        assert (archive.jobs.get(1).state, archive.jobs.get(1).attempts) == ("queued", 0)
        archive.jobs.claim()
        assert archive.jobs.fail(1, "the worker crashed", retry=True).attempts == 1


def test_fits_are_kept_and_the_latest_counts(archive: Archive, stored: Callable[..., int]) -> None:
    """Each model's newest fit stands for a shot; old ones can still be read."""
    one, two = stored(), stored()
    old = archive.fits.add(one, "kv", None, {"r2": 0.9})
    new = archive.fits.add(one, "kv", None, {"r2": 0.99}, job=5)
    archive.fits.add(one, "hsd", None, {"r2": 0.5})
    archive.fits.add(two, "kv", None, {"r2": 0.98})
    archive.fits.add(None, "kv", None, {"joint": True})

    assert archive.fits.get(old.id).result == {"r2": 0.9}
    assert [fit.model for fit in archive.fits.for_shot(one)] == ["hsd", "kv"]
    assert archive.fits.for_shot(one)[1] == new
    seen = archive.fits.of_shots("kv", after=old.id, last=archive.fits.last_id())
    assert [(found.number, found.fit.result["r2"]) for found in seen] == [(one, 0.99), (two, 0.98)]
    assert archive.fits.of_shots("kv", after=0, last=old.id)[0].fit == old
    assert archive.fits.of_job(5) == [new]


def test_results_never_hold_nan(archive: Archive) -> None:
    """A result that is no JSON is refused on the way in."""
    with pytest.raises(ValueError, match="not JSON compliant"):
        archive.fits.add(None, "kv", None, {"r2": math.nan})


def test_a_fit_of_an_unknown_shot_is_refused(archive: Archive) -> None:
    """Foreign keys hold."""
    with pytest.raises(ArchiveError, match="refused a row"):
        archive.fits.add(99, "kv", None, {})


def test_a_slot_runs_one_calibration(archive: Archive) -> None:
    """The timer's slot is idempotent, and another plan under it is refused."""
    plan = [{"sphere": "acetal", "surface": "aluminium", "drop_height_m": 0.03, "repeats": 3}]

    first, created = archive.calibrations.begin("2026-03", plan, "timer")
    again, created_again = archive.calibrations.begin("2026-03", plan, "timer")

    assert (first.number, created, again, created_again) == (1, True, first, False)
    with pytest.raises(IdempotencyConflictError):
        archive.calibrations.begin("2026-03", [], "timer")
    assert archive.calibrations.begin(None, plan, "anna")[0].number == 2


def test_the_current_calibration_is_the_last_one_done(archive: Archive) -> None:
    """A failed run does not replace the one before."""
    for _ in range(3):
        archive.calibrations.begin(None, [], "a")
    archive.calibrations.finish(1, {"gain": 1}, utc_after(30))
    archive.calibrations.finish(2, {"gain": 2}, utc_after(30))
    archive.calibrations.fail(3, Problem("x", "x", 500, "no sphere", "hang one"))

    current = archive.calibrations.current()

    assert current is not None
    assert current.number == 2
    assert [one.state for one in archive.calibrations.list()] == ["failed", "done", "done"]


def test_events_are_numbered_for_clients_that_come_back(archive: Archive) -> None:
    """After the last seen number come exactly the later ones."""
    for i in range(5):
        archive.events.append("drop.stored", {"number": i})

    assert [event.data["number"] for event in archive.events.since(2)] == [2, 3, 4]
    assert archive.events.last_id() == 5


def test_tokens_are_hashed_scoped_and_revocable(archive: Archive) -> None:
    """The secret is in no file; scopes contain one another; revoked and expired ones are dead."""
    token, secret = archive.tokens.create("anna", "operate", days=1)
    _, short = archive.tokens.create("bob", "read", days=1e-9)

    assert archive.tokens.check(secret) == token
    assert token.allows("read")
    assert not token.allows("admin")
    assert archive.tokens.check(short) is None
    assert archive.tokens.check("impactd_guess") is None
    for path in archive.directory.iterdir():
        assert path.is_dir() or secret.encode() not in path.read_bytes()
    archive.tokens.revoke(token.id)
    assert archive.tokens.check(secret) is None
    with pytest.raises(NotFoundError):
        archive.tokens.revoke(99)
    with pytest.raises(ArchiveError, match="read, operate, admin"):
        archive.tokens.create("x", "root")


def test_the_active_model_starts_with_kv(archive: Archive) -> None:
    """Choices are kept with their moment."""
    assert archive.models.active() == "kv2"
    archive.models.set_active("hsd")

    assert archive.models.active() == "hsd"
    assert archive.models.history()[0][0] == "hsd"


def test_moments_compare_as_text() -> None:
    """Any ISO moment becomes UTC of one length."""
    assert as_utc("2026-03-01T13:00:00+01:00") == "2026-03-01T12:00:00.000000Z"
    assert as_utc("2026-03-01") == "2026-03-01T00:00:00.000000Z"
    assert utc_now() < utc_after(1e-3)
