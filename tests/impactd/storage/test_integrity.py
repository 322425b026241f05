"""verify finds what is wrong; reindex rebuilds the index from the files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from impactd.storage.archive import (
    Archive,
    ArchiveError,
    CorruptShotError,
    DropRequest,
    Problem,
)
from impactd.storage.jobs import DIAGNOSE

Store = Callable[..., int]


def _problems(archive: Archive) -> list[str]:
    return [f"{found.subject}: {found.problem}" for found in archive.verify() if found.problem]


def test_a_sound_archive_verifies(archive: Archive, stored: Store) -> None:
    """Every shot and the index are looked at and found well."""
    stored(), stored()

    findings = list(archive.verify())

    number = str(archive.directory / "last-number")
    looked_at = [found.subject for found in findings]
    assert looked_at == ["index", "journal", "shot 1", "shot 2", number]
    assert _problems(archive) == []


def test_verify_names_what_is_wrong(archive: Archive, stored: Store) -> None:
    """Changed, missing and unknown files and leftovers are each told apart."""
    for _ in range(3):
        stored()
    path = archive.shot_path(1)
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    archive.shot_path(2).unlink()
    (path.parent / "000099.h5").write_bytes(b"?")
    (path.parent / ".000098.h5.1.draft").write_bytes(b"?")

    told = "\n".join(_problems(archive))

    assert "shot 1: " in told
    assert "SHA-256" in told
    assert "shot 2: " in told
    assert "000099.h5: no row" in told
    assert "draft: left by a writer" in told
    assert "shot 3" not in told


@pytest.fixture
def filled(archive: Archive, stored: Store) -> Path:
    """Return the folder of a closed archive with two shots, a failed drop and results."""
    stored(), stored()
    drop, _ = archive.begin_drop(DropRequest("a", "b", 0.1, "x"), owner="a", idempotency_key="k3")
    archive.set_drop_state(drop.number, "failed", Problem("x", "x", 500, "x", "x"))
    archive.calibrations.begin("slot-1", [{"sphere": "acetal"}], "timer")
    archive.calibrations.finish(1, {"gain": 2.0}, "2027-01-01T00:00:00.000000Z")
    archive.fits.add(1, "kv", 1, {"r2": 0.99})
    archive.tokens.create("anna")
    archive.set_drop_state(1, "analysed")
    archive.close()
    return archive.directory


def test_a_whole_index_is_rebuilt_without_loss(filled: Path) -> None:
    """Drops, shots, fits, calibrations and tokens are all there again."""
    report = Archive.reindex(filled)

    assert (report.shots, report.drops, report.last_number) == (2, 3, 3)
    assert (report.damaged, report.lost) == ((), ())
    with Archive.open(filled, reserve_bytes=0) as archive:
        assert archive.drop(1).state == "analysed"
        assert archive.drop(3).state == "failed"
        assert archive.fits.for_shot(1)[0].result == {"r2": 0.99}
        assert archive.calibrations.get(1).result == {"gain": 2.0}
        assert archive.tokens.list()[0].name == "anna"
        assert _problems(archive) == []


@pytest.mark.parametrize("damage", ["lost", "garbage", "truncated"])
def test_without_an_index_the_journal_gives_everything_back(filled: Path, damage: str) -> None:
    """Keys, failed drops, fits and tokens too; a repeated request is the old drop."""
    path = filled / "index.sqlite"
    if damage == "lost":
        path.unlink()
    elif damage == "garbage":
        path.write_bytes(b"no index" * 1000)
    else:
        path.write_bytes(path.read_bytes()[:5000])

    report = Archive.reindex(filled)

    assert (report.shots, report.drops, report.last_number) == (2, 3, 3)
    assert (report.damaged, report.lost) == ((), ())
    with Archive.open(filled, reserve_bytes=0) as archive:
        assert archive.fits.for_shot(1)[0].result == {"r2": 0.99}
        assert archive.tokens.list()[0].name == "anna"
        request = DropRequest("a", "b", 0.1, "x")
        again, created = archive.begin_drop(request, owner="a", idempotency_key="k3")
        assert (again.number, again.state, created) == (3, "failed", False)
        assert archive.begin_drop(request, owner="a")[0].number == 4
        assert _problems(archive) == []


def test_without_index_and_journal_the_files_give_drops_and_shots(filled: Path) -> None:
    """Shots, their drops and calibrations come back, no number twice; what is lost is named."""
    _forget_all_but_files(filled)

    report = Archive.reindex(filled)

    assert (report.shots, report.last_number) == (2, 3)
    (lost,) = report.lost
    assert "fits, tokens" in lost
    with Archive.open(filled, reserve_bytes=0) as archive:
        assert archive.drop(2).state == "stored"
        assert archive.drop(2).owner == "anna"
        assert archive.read_shot(2).shot.sphere == "acetal"
        assert archive.calibrations.get(1).result == {"gain": 2.0}
        assert archive.begin_drop(DropRequest("a", "b", 0.1, "x"), owner="a")[0].number == 4


def _forget_all_but_files(folder: Path) -> None:
    (folder / "index.sqlite").unlink()
    (folder / "journal.jsonl").unlink()


DEFINITION = {"name": "kv+echo", "base": "kv", "effects": []}


@pytest.fixture
def diagnosed(archive: Archive) -> Path:
    """Return the folder of a closed archive with two diagnoses, one with a chosen named model."""
    for number, model in ((1, DEFINITION), (2, None)):
        job = archive.jobs.enqueue(DIAGNOSE, {"shots": [1], "base": "kv"}, "1 shot(s)")
        with archive.transaction():
            named = archive.models.add(model, {"diagnosis": job.id}) if model else None
            told = {"name": named.name, "version": named.version} if named else None
            found = {"diagnosis": {"verdict": "identified"}, "report_html": "<p>", "model": told}
            archive.diagnoses.publish(archive.jobs.finish(job.id, found), named)
        assert job.id == number
    archive.jobs.enqueue("fit_shot", {"shot": 1}, "shot 1")
    archive.models.set_active("kv+echo", 1)
    archive.models.set_active("kv")
    archive.models.set_active("kv+echo", 1)
    archive.close()
    return archive.directory


@pytest.mark.parametrize("lost", [True, False])
def test_diagnoses_and_named_models_come_back(diagnosed: Path, lost: bool) -> None:
    """With or without the old index: results, reports, named models and the active one."""
    if lost:
        _forget_all_but_files(diagnosed)

    report = Archive.reindex(diagnosed)

    assert (report.damaged, len(report.lost)) == ((), int(lost))
    with Archive.open(diagnosed, reserve_bytes=0) as archive:
        first, second = archive.jobs.get(1), archive.jobs.get(2)
        assert first.state == second.state == "done"
        assert first.result is not None
        assert first.result["model"] == {"name": "kv+echo", "version": 1}
        assert first.result["report_html"] == "<p>"
        assert archive.models.named("kv+echo").definition == DEFINITION
        assert archive.models.named("kv+echo").provenance == {"diagnosis": 1}
        assert (archive.models.active(), archive.models.active_version()) == ("kv+echo", 1)
        assert [name for name, _ in archive.models.history()] == ["kv+echo", "kv", "kv+echo"]
        assert archive.models.add(DEFINITION, {}).version == 2
        later = archive.jobs.enqueue(DIAGNOSE, {"shots": [2], "base": "kv"}, "1 shot(s)")
        assert later.id == (3 if lost else 4)
        assert _problems(archive) == []


def test_a_damaged_diagnosis_is_named_and_its_number_never_used_again(diagnosed: Path) -> None:
    """A changed file is refused by reindex and by verify; the others come back."""
    _forget_all_but_files(diagnosed)
    path = diagnosed / "diagnoses/000002.json"
    path.write_text(path.read_text().replace("identified", "idemtified"))

    report = Archive.reindex(diagnosed)

    assert len(report.damaged) == 1
    assert "000002.json" in report.damaged[0]
    with Archive.open(diagnosed, reserve_bytes=0) as archive:
        assert archive.jobs.get(1).state == "done"
        assert archive.jobs.enqueue(DIAGNOSE, {"shots": [2], "base": "kv"}, "x").id == 3
        (problem,) = _problems(archive)
        assert "diagnosis 2" in problem
        assert "SHA-256" in problem


def test_a_diagnosis_that_only_the_index_has_gets_its_file(diagnosed: Path) -> None:
    """An archive of an older version, whose diagnoses had no files, has them after a reindex."""
    before = (diagnosed / "diagnoses/000001.json").read_text()
    (diagnosed / "diagnoses/000001.json").unlink()
    Archive.reindex(diagnosed)
    assert (diagnosed / "diagnoses/000001.json").read_text() == before


def test_the_old_index_is_kept(filled: Path) -> None:
    """Rebuilding throws nothing away."""
    report = Archive.reindex(filled)

    assert report.old_index is not None
    assert Path(report.old_index).is_file()


def test_a_tampered_file_is_not_made_good_by_reindexing(filled: Path, metadata: object) -> None:
    """A readable file that is not the one that was stored stays refused."""
    first, second = filled / "shots/000001.h5", filled / "shots/000002.h5"
    content = bytearray(first.read_bytes())
    at = content.index(b"Shot 1: acetal")
    content[at : at + 14] = b"Shot 1: acetol"
    first.write_bytes(content)

    report = Archive.reindex(filled)

    assert len(report.damaged) == 1
    assert "Shot 1" in report.damaged[0]
    with Archive.open(filled, reserve_bytes=0) as archive:
        with pytest.raises(CorruptShotError):
            archive.read_shot(1)
        assert archive.read_shot(2).shot.file == f"shots/{second.name}"


def test_a_calibration_that_left_no_file_is_named_as_lost(
    archive: Archive, record: Callable[..., object], metadata: object
) -> None:
    """Drops of a calibration whose result is gone still belong to it."""
    archive.calibrations.begin(None, [], "timer")
    drop, _ = archive.begin_drop(DropRequest("a", "b", 0.1, "x"), owner="a", calibration=1)
    archive.store_shot(drop.number, record(), metadata)  # type: ignore[arg-type]
    archive.close()
    _forget_all_but_files(archive.directory)

    Archive.reindex(archive.directory)

    with Archive.open(archive.directory, reserve_bytes=0) as again:
        lost = again.calibrations.get(1)
        assert (lost.state, lost.drops) == ("failed", (1,))
        assert lost.problem is not None
        assert lost.problem.type == "result-lost"


def test_a_running_daemon_is_not_pulled_from_under(archive: Archive) -> None:
    """While somebody has the archive open, its index is not rebuilt, whatever file was deleted."""
    for path in archive.directory.glob("*lock*"):
        path.unlink()
    with pytest.raises(ArchiveError, match="Stop the daemon"):
        Archive.reindex(archive.directory)
