"""Materials with what people changed since: at once, for good, and with who and when."""

from __future__ import annotations

import json
import resource
import signal
from pathlib import Path

import pytest

from impactd.settings.errors import SettingsError
from impactd.settings.material_book import MaterialBook
from impactd.settings.settings import find_config
from impactd.storage.material_changes import MATERIAL_CHANGES_NAME


@pytest.fixture
def book(tmp_path: Path) -> MaterialBook:
    """The shipped materials beside an empty archive."""
    return MaterialBook(find_config("materials.toml"), tmp_path)


def heavier(book: MaterialBook) -> dict[str, object]:
    """Return acetal's entry with another mass."""
    return book.entries("sphere")["acetal"] | {"mass_kg": {"value": 6.2e-4, "u": 1e-7}}


def test_a_change_counts_at_once_and_after_a_restart(book, tmp_path):
    """Who, when, before and after are kept; the file stays as it is."""
    made = book.change("sphere", "acetal", heavier(book), by="ab", note="weighed")
    assert book.current.spheres["acetal"].mass_kg == 6.2e-4
    assert book.current.version == made.version == 1
    again = MaterialBook(find_config("materials.toml"), tmp_path)
    assert again.current == book.current
    (kept,) = again.changes
    assert (kept.by, kept.note) == ("ab", "weighed")
    assert kept.before is not None
    assert kept.before["mass_kg"] != kept.after["mass_kg"]


def test_an_earlier_version_can_be_had_again(book):
    """What a stored fit was made with."""
    before = book.current
    book.change("sphere", "acetal", heavier(book), by="ab", note="")
    assert book.at(0) == before
    assert book.at(1) == book.current


def test_a_wrong_entry_changes_nothing(book, tmp_path):
    """The path is named; neither memory nor disk has it."""
    wrong = heavier(book) | {"poissons_ratio": {"value": 0.7, "u": 0.01}}
    with pytest.raises(SettingsError) as error:
        book.change("sphere", "acetal", wrong, by="ab", note="")
    assert error.value.findings[0].path_in_file == "sphere.acetal.poissons_ratio.value"
    assert book.version == 0
    assert not (tmp_path / MATERIAL_CHANGES_NAME).exists()
    with pytest.raises(SettingsError, match="is not a valid name"):
        book.change("sphere", "../x", heavier(book), by="ab", note="")


def test_a_sphere_in_grams_is_refused(book):
    """No matter has the density that such a mass would mean."""
    with pytest.raises(SettingsError, match="in kilograms") as error:
        book.change("sphere", "acetal", heavier(book) | {"mass_kg": 0.6116}, by="ab", note="")
    assert error.value.findings[0].path_in_file == "sphere.acetal.mass_kg"
    assert book.version == 0


def test_half_a_line_of_a_power_cut_is_dropped(book, tmp_path):
    """Nobody was told that it counts; the next change follows the last whole one."""
    book.change("sphere", "acetal", heavier(book), by="ab", note="")
    log = tmp_path / MATERIAL_CHANGES_NAME
    with log.open("ab") as file:
        file.write(b'{"version": 2, "utc"')
    again = MaterialBook(find_config("materials.toml"), tmp_path)
    assert again.version == 1
    again.change("sphere", "new", heavier(book), by="ab", note="")
    assert [json.loads(line)["version"] for line in log.read_text().splitlines()] == [1, 2]


def test_a_damaged_log_is_not_guessed_at(book, tmp_path):
    """It is refused with its name."""
    (tmp_path / MATERIAL_CHANGES_NAME).write_text("nonsense\n")
    with pytest.raises(SettingsError, match=MATERIAL_CHANGES_NAME):
        MaterialBook(find_config("materials.toml"), tmp_path)


def test_a_change_that_the_disk_does_not_take_leaves_no_beginning(book, tmp_path):
    """The file stays as it was, and the next change stands on a line of its own."""
    book.change("sphere", "acetal", heavier(book), by="ab", note="")
    log = tmp_path / MATERIAL_CHANGES_NAME
    before = log.read_bytes()
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    kept = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (len(before) + 10, hard))
    try:
        with pytest.raises(SettingsError, match="cannot be written"):
            book.change("sphere", "new", heavier(book), by="ab", note="")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        signal.signal(signal.SIGXFSZ, kept)
    assert log.read_bytes() == before
    assert book.change("sphere", "new", heavier(book), by="ab", note="").version == 2
    assert MaterialBook(find_config("materials.toml"), tmp_path).version == 2
