"""What is wrong with a file is one sentence: what, why, what to do."""

from __future__ import annotations

import gzip
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import scipy.io.wavfile
from typer.testing import CliRunner

from analysis import fit_campaign, load_campaign
from impactd.cli import app
from impactd.importing import instrument_files
from impactd.importing.choices import Choices
from impactd.importing.errors import RecordingError
from impactd.importing.new_campaign import make_campaign
from tests.impactd.importing.conftest import Record, make_record


def table(path: Path, record: Record, head: str = "time_s,force_N", factor: float = 1.0) -> Path:
    """Write times, multiplied by a factor, and signal."""
    columns = np.column_stack((record.times_s * factor, record.signal))
    np.savetxt(path, columns, delimiter=",", header=head, comments="", fmt="%.9g")
    return path


def refused(*files: object, out: Path, **choices: object) -> str:
    """Return the sentence that a campaign is refused with."""
    with pytest.raises(RecordingError) as caught:
        make_campaign([str(one) for one in files], out, Choices(**choices))  # type: ignore[arg-type]
    assert not list(out.glob("*")), "something was written"
    return str(caught.value)


@pytest.fixture
def out(tmp_path: Path) -> Path:
    """A folder that is not there yet."""
    return tmp_path / "out"


def test_without_times_the_rate_must_be_said(tmp_path: Path, record: Record, out: Path) -> None:
    """A bare array has no rate, and none is made up."""
    np.save(tmp_path / "a.npy", record.signal)
    assert "--rate HZ" in refused(tmp_path / "a.npy", out=out)


@pytest.mark.parametrize(("factor", "unit"), [(1e3, "ms"), (1e6, "us")])
def test_milliseconds_called_seconds_are_noticed(
    tmp_path: Path, record: Record, out: Path, factor: float, unit: str
) -> None:
    """A contact of seconds is refused with the option that mends it, and that option does."""
    file = table(tmp_path / "a.csv", record, factor=factor)
    said = refused(file, out=out)
    assert f"--time {unit}" in said
    assert "--time s" in said
    made = make_campaign([str(file)], out, Choices(time_unit=unit))
    assert made.shots[0].rate_hz == pytest.approx(50_000)


def test_on_a_terminal_the_unit_of_the_times_is_asked(
    tmp_path: Path, record: Record, out: Path
) -> None:
    """Who answers `ms` gets milliseconds, and the answer is written down."""
    file = table(tmp_path / "a.csv", record, factor=1e3)
    asked = []

    def answer(question: str, answers: object, proposal: str) -> str:
        """Answer one question; nothing is proposed that only a person can know."""
        asked.append((question, proposal))
        return "ms"

    made = make_campaign([str(file)], out, Choices(), answer)
    assert made.shots[0].rate_hz == pytest.approx(50_000)
    assert len(asked) == 1
    assert asked[0][1] == ""
    assert any("as was answered" in one for one in made.said)


def test_rounded_times_are_even(tmp_path: Path, out: Path) -> None:
    """25.6 kHz printed in steps of 10 us: the rate is right to its stated uncertainty."""
    made = make_record(rate_hz=25_600.0)
    rows = [f"{t:.5f},{x:.6f}" for t, x in zip(made.times_s, made.signal, strict=True)]
    (tmp_path / "a.csv").write_text("time_s,force_N\n" + "\n".join(rows))
    found = make_campaign([str(tmp_path / "a.csv")], out)
    shot = load_campaign(out).shots[0]
    assert shot.u_sample_rate_hz is not None
    assert abs(shot.sample_rate_hz - 25_600.0) < 4 * shot.u_sample_rate_hz.u
    assert any("rounded to 1e-05 s" in one for one in found.said)


def test_a_gap_in_the_times_is_refused(tmp_path: Path, record: Record, out: Path) -> None:
    """Lost samples are not glued together."""
    kept = np.r_[0:5000, 5100 : record.signal.size]
    cut = Record(record.times_s[kept], record.signal[kept], (), 60)
    assert "not sampled evenly" in refused(table(tmp_path / "a.csv", cut), out=out)


@pytest.mark.parametrize(
    ("name", "content", "part"),
    [
        ("a.csv", b"", "is empty"),
        ("a.csv", b"dear colleague\nhere are the data\n", "no table of numbers"),
        ("a.bin", b"\0\1\2\3" * 100, "not a text file"),
        ("a.npy", b"not an array", "no array of plain numbers"),
        ("a.npz", b"not an archive", "no archive of arrays"),
        ("a.mat", b"not matlab at all", "no MATLAB file"),
        ("a.wav", b"RIFF....WAVE", "no WAV file"),
        ("a.h5", b"nothing", "no HDF5 file"),
        ("a.tdms", b"nothing", "no channel of numbers"),
        ("a.uff", b"nothing", "signal over time"),
        ("a.lvm", b"LabVIEW Measurement\t\n", "no LabVIEW file"),
    ],
)
def test_a_file_that_is_none_is_refused(
    tmp_path: Path, out: Path, name: str, content: bytes, part: str
) -> None:
    """Each reader says in its own words that it cannot read."""
    (tmp_path / name).write_bytes(content)
    said = refused(tmp_path / name, out=out, rate_hz=1e4)
    assert part in said
    assert name in said


def test_missing_files_and_folders_are_refused(tmp_path: Path, out: Path) -> None:
    """A folder is answered with the command for its files."""
    assert "does not exist" in refused(tmp_path / "none.csv", out=out)
    assert f"impactd new {tmp_path}/*" in refused(tmp_path, out=out)


def test_an_optional_reader_that_is_missing_names_its_package(
    tmp_path: Path, out: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The sentence holds the pip command."""

    def absent(name: str) -> object:
        """Fail as Python does."""
        raise ImportError(name)

    monkeypatch.setattr(instrument_files.importlib, "import_module", absent)
    (tmp_path / "a.tdms").write_bytes(b"TDSm")
    assert "pip install npTDMS" in refused(tmp_path / "a.tdms", out=out)


def test_unknown_columns_and_units_are_answered_with_those_there(
    tmp_path: Path, record: Record, out: Path
) -> None:
    """Nobody has to open the file to see what it holds."""
    file = table(tmp_path / "a.csv", record)
    assert "'force'" in refused(file, out=out, columns=("hammer",))
    assert "V, N, g, m/s2, strain" in refused(file, out=out, unit="furlong")


def test_a_rate_that_is_none_is_refused(tmp_path: Path, record: Record, out: Path) -> None:
    """Zero samples a second are no rate; nothing is divided by it first."""
    np.save(tmp_path / "a.npy", record.signal)
    assert "sampled at 0 Hz" in refused(tmp_path / "a.npy", out=out, rate_hz=0.0, unit="V")


def test_nothing_is_overwritten(tmp_path: Path, record: Record, out: Path) -> None:
    """A campaign, a picture or a shot that is there stays."""
    file = table(tmp_path / "a.csv", record)
    make_campaign([str(file)], out)
    before = {one.name: one.read_bytes() for one in out.iterdir()}
    with pytest.raises(RecordingError, match="nothing is overwritten"):
        make_campaign([str(file)], out)
    (out / "campaign.json").unlink()
    (out / "recordings.png").unlink()
    with pytest.raises(RecordingError, match=r"shot000\.npy already"):
        make_campaign([str(file)], out)
    assert {one.name: one.read_bytes() for one in out.iterdir()}.items() <= before.items()


def test_a_record_of_noise_says_that_no_hit_was_found(tmp_path: Path, out: Path) -> None:
    """With the largest excursion and the threshold beside it."""
    np.save(tmp_path / "a.npy", np.random.default_rng(1).normal(size=20_000))
    said = refused(tmp_path / "a.npy", out=out, rate_hz=1e4)
    assert "no hit was found" in said
    assert "--threshold" in said


def test_strain_is_stored_as_voltage_and_said(tmp_path: Path, record: Record, out: Path) -> None:
    """The format has no strain: 1 V stands for a microstrain, in words."""
    np.save(tmp_path / "a.npy", record.signal * 1e-6)
    made = make_campaign([str(tmp_path / "a.npy")], out, Choices(rate_hz=5e4, unit="strain"))
    shot = load_campaign(out).shots[0]
    assert shot.quantity == "voltage"
    assert shot.signal.max() == pytest.approx(100.0, rel=0.02)
    assert any("1 V stands for a strain of 1e-6" in one for one in made.said)


def test_wav_codes_keep_their_step(tmp_path: Path, record: Record, out: Path) -> None:
    """The converter's step is known to the analysis: noise below it is not mistaken."""
    codes = np.round(record.signal / 128 * 32768).astype(np.int16)
    scipy.io.wavfile.write(tmp_path / "a.wav", 50_000, codes)
    make_campaign([str(tmp_path / "a.wav")], out, Choices(unit="N", scale=128.0))
    assert load_campaign(out).shots[0].quantum == pytest.approx(128 / 32768)


def test_names_tell_the_shots_of_files_apart(tmp_path: Path, record: Record, out: Path) -> None:
    """The file's name, and the number of the hit in it; never shot000.npy."""
    first = table(tmp_path / "monday.csv", record)
    second = table(tmp_path / "tuesday.csv", make_record((4000,)))
    make_campaign([str(first), str(second)], out)
    names = [shot.name for shot in load_campaign(out).shots]
    assert names == ["monday hit 1", "monday hit 2", "monday hit 3", "tuesday"]


@pytest.mark.parametrize("command", ["fit", "diagnose", "budget"])
def test_other_commands_answer_recordings_with_the_one_that_helps(
    tmp_path: Path, record: Record, command: str
) -> None:
    """A bare CSV and a folder without campaign.json are no dead end."""
    file = table(tmp_path / "a.csv", record)
    for what, help_ in ((file, f"impactd new {file}"), (tmp_path, f"impactd new {tmp_path}/*.csv")):
        made = CliRunner().invoke(app, [command, str(what)])
        assert made.exit_code == 1
        assert help_ in str(made.exception)


def test_in_a_pipe_nothing_is_asked_and_json_is_json(tmp_path: Path, record: Record) -> None:
    """Two columns and no unit: the proposals are taken and written down."""
    columns = np.column_stack((record.times_s, record.signal, record.signal))
    np.savetxt(tmp_path / "a.txt", columns)
    made = subprocess.run(
        [sys.executable, "-m", "impactd", "new", "a.txt", "--json"],
        cwd=tmp_path, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False,
        timeout=120,
    )  # fmt: skip
    assert made.returncode == 0, made.stderr
    assert made.stderr == ""
    answer = json.loads(made.stdout)
    assert len(answer["shots"]) == 3
    assert any("taken for V" in one for one in answer["assumptions"])
    assert any("standard value, 9.80665" in one for one in answer["assumptions"])
    assert (tmp_path / "a-campaign" / "campaign.json").is_file()


def test_a_campaign_of_a_bare_csv_is_fitted(tmp_path: Path, record: Record, out: Path) -> None:
    """Nothing but times and newtons is enough for a fit in reduced units."""
    make_campaign([str(table(tmp_path / "a.csv", record))], out)
    fit = fit_campaign(load_campaign(out), "hsd")
    assert len(fit.shots) == 3
    assert fit.to_json()["shots"][0]["name"] == "a hit 1"


def test_what_was_measured_goes_into_the_campaign(
    tmp_path: Path, record: Record, out: Path
) -> None:
    """Values beside the recordings: keys of the campaign, and shots by their names."""
    file = table(tmp_path / "a.csv", record)
    values = tmp_path / "values.json"
    ball = {"radius_m": {"value": 0.005, "u": 1e-5}, "mass_kg": 6e-4}
    hit = {"sphere": "ball", "drop_height_m": 0.03}
    values.write_text(json.dumps({"spheres": {"ball": ball}, "shots": {"a hit 2": hit}}))
    made = make_campaign([str(file)], out, Choices(values=values))
    campaign = load_campaign(out)
    assert [shot.drop_height_m for shot in campaign.shots] == [None, 0.03, None]
    assert campaign.spheres["ball"].mass_kg == 6e-4
    assert not any("unknown and left out" in one for one in made.said)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{", "cannot be read as JSON"),
        ("[]", "no object"),
        ('{"shots": {"a hit 1": 0.03}}', "no object"),
        ('{"shots": {"b": {}}}', "no shot 'b'; the shots are a hit 1"),
        ('{"sphere": {}}', "spheres"),
        ('{"shots": {"a hit 1": {"drop_height_mm": 30}}}', "drop_height_m"),
    ],
)
def test_values_that_are_none_leave_nothing_behind(
    tmp_path: Path, record: Record, out: Path, text: str, words: str
) -> None:
    """The sentence names the file of values and what is wrong there."""
    values = tmp_path / "values.json"
    values.write_text(text)
    told = refused(table(tmp_path / "a.csv", record), out=out, values=values)
    assert str(values) in told
    assert words in told


def drops_table(path: Path, text: str) -> Path:
    """Write a table of drops."""
    path.write_text(text, encoding="utf-8")
    return path


def test_a_table_of_drops_labels_the_shots(tmp_path: Path, record: Record, out: Path) -> None:
    """The name of a recording stands for all its hits, that of a shot goes before it."""
    file = table(tmp_path / "a.csv", record, "time (s);force (N)")
    values = tmp_path / "values.json"
    values.write_text('{"spheres": {"ball": {}}, "surfaces": {"plate": {}}}')
    rows = "name;sphere;surface;drop_height_mm\na.csv;ball;plate;45,5\na hit 2;ball;plate;30\n"
    drops = drops_table(tmp_path / "drops.csv", rows)
    made = make_campaign([str(file)], out, Choices(values=values, drops=drops))
    heights = [shot["drop_height_m"] for shot in json.loads(made.path.read_text())["shots"]]
    assert heights == [0.0455, 0.030, 0.0455]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "has no column name"),
        ("file,height\na.csv,3\n", "has no column name; its first line has file, height"),
        ("name,drop_height_mm\na,45 mm\n", "'45 mm' is no number"),
        ("name,drop_height_mm\na.csv,3\na.csv,4\n", "names 'a.csv' a second time"),
        ("name,drop_height_mm\nb.csv,3\n", "there is no shot 'b.csv'"),
        ("name,drop_heigth_m\na.csv,3\n", "'drop_height_m' was probably meant"),
        ("name,drop_height_mm\na.csv,-3\n", "it must be between"),
    ],
)
def test_a_table_of_drops_that_is_wrong_leaves_nothing_behind(
    tmp_path: Path, record: Record, out: Path, text: str, words: str
) -> None:
    """The sentence names the table, and what is wrong in it."""
    drops = drops_table(tmp_path / "drops.csv", text)
    told = refused(table(tmp_path / "a.csv", record), out=out, drops=drops)
    assert words in told
    assert str(drops) in told


def test_a_zipped_text_is_read_as_the_text(tmp_path: Path, record: Record, out: Path) -> None:
    """A gzip gives the shots of what it holds, under the same names; a damaged one is refused."""
    file = table(tmp_path / "a.csv", record)
    zipped = tmp_path / "a.csv.gz"
    zipped.write_bytes(gzip.compress(file.read_bytes())[:-20])
    assert "damaged gzip" in refused(zipped, out=out)
    zipped.write_bytes(gzip.compress(file.read_bytes()))
    names = [one.name for one in make_campaign([str(zipped)], out).shots]
    assert names == [one.name for one in make_campaign([str(file)], tmp_path / "plain").shots]


@pytest.mark.parametrize("samples", [1_200, 32_000])
def test_it_is_said_where_a_record_is_cut(tmp_path: Path, out: Path, samples: int) -> None:
    """Shots of one series else have other lengths, and nobody knows why."""
    file = table(tmp_path / "a.csv", make_record((700,), samples=samples, contact=20))
    made = make_campaign([str(file)], out, Choices())
    said = [one for one in made.said if "10 contact times before it" in one]
    assert len(said) == (samples == 32_000)
