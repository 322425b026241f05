"""Temperature and humidity in the archive: files, index, journal, and what came before them."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import pytest

from analysis.campaign import Environment, Quantity
from drivers.digitizer import Record
from impactd.storage import checksums, journal_rows, schema
from impactd.storage.archive import Archive, CorruptShotError, ShotMetadata
from impactd.storage.drops import DropRequest
from impactd.storage.exchange import export_shots
from impactd.storage.index import Index
from impactd.storage.shot_file import build_shot_file, read_shot_file, recording_of

WARM = Environment(Quantity(31.5, 0.2), Quantity(0.4, 0.03))
ABOUT = ShotMetadata("2026-03-01T12:00:00.000000Z", 0, 9.81, drop_height_m=0.047)
_CIRCUMSTANCES = "entry/process/circumstances/data"


def _changed(content: bytes, change: Callable[[dict[str, Any]], object]) -> bytes:
    """Return a shot file with changed circumstances."""
    buffer = io.BytesIO(content)
    with h5py.File(buffer, "r+") as file:
        facts = json.loads(file[_CIRCUMSTANCES][()])
        change(facts)
        del file[_CIRCUMSTANCES]
        file[_CIRCUMSTANCES] = json.dumps(facts)
    return buffer.getvalue()


@pytest.mark.parametrize(
    "around", [None, WARM, Environment(relative_humidity=WARM.relative_humidity)]
)
def test_a_shot_file_keeps_the_environment(
    record: Callable[..., Record], around: Environment | None
) -> None:
    """What is known comes back, and what is not known stays unknown."""
    metadata = replace(ABOUT, environment=around)
    content = build_shot_file(7, recording_of(record()), metadata, None)
    assert read_shot_file(content, "7.h5")[2].environment == around
    with h5py.File(io.BytesIO(content)) as file:
        assert ("environment" in file["entry"]) == (around is not None)


def test_files_of_earlier_versions_have_no_environment(record: Callable[..., Record]) -> None:
    """They read as before."""
    content = build_shot_file(7, recording_of(record()), ABOUT, None)
    older = _changed(content, lambda facts: facts["about"].pop("environment"))
    assert read_shot_file(older, "7.h5")[2] == ABOUT


def test_an_impossible_environment_is_no_shot(record: Callable[..., Record]) -> None:
    """A file that somebody else made is held to the same limits as a request."""
    content = build_shot_file(7, recording_of(record()), ABOUT, None)
    wrong = {"temperature_C": {"value": 1e9, "u": 1.0}}
    foreign = _changed(content, lambda facts: facts["about"].update(environment=wrong))
    with pytest.raises(CorruptShotError, match="temperature_C"):
        read_shot_file(foreign, "7.h5")


def test_an_archive_gives_back_what_was_asked_and_what_was_seen(
    tmp_path: Path, record: Callable[..., Record]
) -> None:
    """From the index, and from a new one made of journal or files alone."""
    asked = DropRequest("acetal", "aluminium", 0.047, "ab", Environment(WARM.temperature_c))
    with Archive.open(tmp_path, reserve_bytes=0) as archive:
        drop, _ = archive.begin_drop(asked, owner="ab", idempotency_key="k")
        archive.store_shot(drop.number, record(), replace(ABOUT, environment=WARM))
    for lost in ((), ("index.sqlite",), ("index.sqlite", "journal.jsonl")):
        for name in lost:
            (tmp_path / name).unlink()
        if lost:
            Archive.reindex(tmp_path)
        with Archive.open(tmp_path, reserve_bytes=0) as archive:
            assert archive.drop(1).request == asked
            assert archive.shot(1).environment == WARM
            assert archive.shots()[0].environment == WARM
            assert [found for found in archive.verify() if found.problem] == []


def test_an_exported_campaign_comes_back_with_its_environment(
    tmp_path: Path, record: Callable[..., Record]
) -> None:
    """What a campaign says as a whole completes what its shots say."""
    with Archive.open(tmp_path / "one", reserve_bytes=0) as archive:
        request = DropRequest("acetal", "aluminium", 0.047, "ab")
        for number, around in enumerate((Environment(WARM.temperature_c), None), start=1):
            archive.begin_drop(request, owner="ab")
            metadata = replace(ABOUT, environment=around)
            archive.store_shot(number, record(seed=number), metadata)
        export_shots([archive.read_shot(n) for n in (1, 2)], "campaign", tmp_path / "out")
    file = tmp_path / "out" / "campaign.json"
    campaign = json.loads(file.read_text())
    assert [shot.get("environment") for shot in campaign["shots"]] == [
        {"temperature_C": {"value": 31.5, "u": 0.2}},
        None,
    ]
    campaign["environment"] = {
        "temperature_C": {"value": 20.0, "u": 1.0},
        "relative_humidity": {"value": 0.4, "u": 0.03},
    }
    file.write_text(json.dumps(campaign))
    with Archive.open(tmp_path / "two", reserve_bytes=0) as archive:
        archive.import_campaign(file)
        assert archive.shot(1).environment == WARM
        assert archive.shot(2).environment == Environment(Quantity(20.0, 1.0), Quantity(0.4, 0.03))


_DROP = (
    "INSERT INTO drops (number, state, sphere, surface, drop_height_m, operator, owner, "
    "requested_utc, updated_utc) VALUES (?, 'failed', 'acetal', ?, 0.03, 'ab', 'ab', 'x', 'x')"
)


def test_an_index_of_the_version_before_gets_the_columns(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its rows stay, its journal goes on, and a row that was damaged before is still found."""
    path = tmp_path / "index.sqlite"
    with monkeypatch.context() as older:
        for table in ("drops", "shots"):
            older.setitem(checksums.COLUMNS, table, " ".join(checksums.first_columns(table)))
        older.setattr(schema, "MIGRATIONS", schema.MIGRATIONS[:-2])
        later = {"comparisons"}
        older.setattr(journal_rows, "TABLES", [t for t in journal_rows.TABLES if t not in later])
        older.setattr(Index, "_check_form", lambda _: None)
        with closing(Index(path)) as index:
            for number, surface in ((11, "aluminium"), (12, "polycarbonate"), (13, "aluminium")):
                index.write(_DROP, (number, surface))
    content = path.read_bytes()
    assert content.count(b"polycarbonate") == 1
    path.write_bytes(content.replace(b"polycarbonate", b"polycarbonite"))

    with Archive.open(tmp_path, reserve_bytes=0) as archive:
        assert [archive.drop(n).request.environment for n in (11, 12, 13)] == [None] * 3
        with archive._index.raw() as connection:
            assert list(checksums.changed_rows(connection, "drops")) == [12]
        request = DropRequest("acetal", "aluminium", 0.03, "ab", WARM)
        drop, _ = archive.begin_drop(request, owner="ab")
        with archive._index.raw() as connection:
            assert list(checksums.changed_rows(connection, "drops")) == [12]
    path.unlink()
    report = Archive.reindex(tmp_path)
    assert report.lost == ()
    with Archive.open(tmp_path, reserve_bytes=0) as archive:
        assert archive.drop(drop.number).request == request
        assert archive.drop(12).request.surface == "polycarbonate"
