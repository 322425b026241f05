"""Files made to hurt: bombs, links to elsewhere, half files, campaigns of anything."""

from __future__ import annotations

import io
import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from impactd.storage.archive import Archive, CampaignError, CorruptShotError
from impactd.storage.campaign_folder import read_campaign
from impactd.storage.shot_file import build_shot_file, read_shot_file
from impactd.storage.shot_metadata import Recording, ShotMetadata
from impactd.storage.shot_views import DATA_PATH
from impactd.storage.timestamp import utc_now

CIRCUMSTANCES = "entry/process/circumstances/data"
SECRET = b"the words of a file outside"


def _bomb(file: h5py.File, _outside: Path) -> None:
    """Ten gigabytes of nothing in some kilobytes."""
    file.create_dataset(DATA_PATH, (5_000_000_000,), "i2", chunks=(1_000_000,), compression="gzip")


def _never_written(file: h5py.File, _outside: Path) -> None:
    """Two terabytes in chunks that were never written."""
    file.create_dataset(DATA_PATH, (10**12,), "i2", chunks=(1_000_000,))


def _external(file: h5py.File, outside: Path) -> None:
    """The bytes of another file as samples."""
    size = outside.stat().st_size // 2
    file.create_dataset(DATA_PATH, (size,), "i2", external=[(str(outside), 0, 2 * size)])


def _external_link(file: h5py.File, outside: Path) -> None:
    """A dataset of another HDF5 file."""
    file.create_group("entry/instrument/digitizer")
    file[DATA_PATH] = h5py.ExternalLink(str(outside), "/data")


def _virtual(file: h5py.File, outside: Path) -> None:
    """A view of another HDF5 file."""
    layout = h5py.VirtualLayout((10,), "i2")
    layout[:] = h5py.VirtualSource(str(outside), "data", shape=(10,))
    file.create_virtual_dataset(DATA_PATH, layout)


def _long_string(file: h5py.File, _outside: Path) -> None:
    """Circumstances of a terabyte."""
    file[DATA_PATH] = np.arange(100, dtype="i2")
    space = h5py.h5s.create(h5py.h5s.SCALAR)
    kind = h5py.h5t.C_S1.copy()
    kind.set_size(2**31 - 1)
    file.create_group("entry/process/circumstances")
    h5py.h5d.create(file.id, CIRCUMSTANCES.encode(), kind, space)


def _loop(file: h5py.File, _outside: Path) -> None:
    """A soft link to itself."""
    file["entry"] = h5py.SoftLink("/entry")


def _words(file: h5py.File, _outside: Path) -> None:
    """Text where numbers are due, and JSON of the wrong kind."""
    file[DATA_PATH] = "no samples"
    file[CIRCUMSTANCES] = "[" * 10_000


HOSTILE = [_bomb, _never_written, _external, _external_link, _virtual, _long_string, _loop, _words]


def _content(make: Callable[[h5py.File, Path], None], outside: Path) -> bytes:
    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as file:
        make(file, outside)
    return buffer.getvalue()


@pytest.fixture
def outside(tmp_path: Path) -> Path:
    """A file that no shot has any business with."""
    path = tmp_path / "outside.h5"
    with h5py.File(path, "w") as file:
        file["data"] = np.arange(10, dtype="i2")
        file.attrs["secret"] = SECRET
    return path


@pytest.mark.parametrize("make", HOSTILE, ids=lambda make: make.__name__)
def test_a_hostile_shot_file_is_refused_before_it_is_read(make, outside: Path) -> None:
    """No memory is taken for it and no other file opened."""
    with pytest.raises(CorruptShotError):
        read_shot_file(_content(make, outside), "shot")


def _elsewhere_external(file: h5py.File, outside: Path) -> None:
    file["entry/release"].create_dataset("more", (10,), "i1", external=[(str(outside), 0, 10)])


def _elsewhere_link(file: h5py.File, outside: Path) -> None:
    file["entry/release/more"] = h5py.ExternalLink(str(outside), "/data")


def _elsewhere_soft_link(file: h5py.File, _outside: Path) -> None:
    file["entry/release/more"] = h5py.SoftLink("/entry/title")


def _elsewhere_virtual(file: h5py.File, outside: Path) -> None:
    layout = h5py.VirtualLayout((10,), "i2")
    layout[:] = h5py.VirtualSource(str(outside), "data", shape=(10,))
    file["entry"].create_group("new").create_virtual_dataset("more", layout)


def _elsewhere_gzip(file: h5py.File, _outside: Path) -> None:
    file["entry/impact"].create_dataset("more", data=np.zeros(100_000), compression="gzip")


def _elsewhere_lzf(file: h5py.File, _outside: Path) -> None:
    file["entry"].create_dataset("more", data=np.zeros(100_000), compression="lzf")


def _elsewhere_chunk(file: h5py.File, _outside: Path) -> None:
    file["entry"].create_dataset("more", (10**9,), "f8", chunks=(10**8,))


def _longer_times(file: h5py.File, _outside: Path) -> None:
    del file["entry/record/time"]
    file["entry/record"].create_dataset("time", (10**9,), "f8", compression="gzip", chunks=(65536,))


def _hard_loop(file: h5py.File, _outside: Path) -> None:
    file["entry/release/more"] = file["entry"]


ELSEWHERE = [
    _elsewhere_external, _elsewhere_link, _elsewhere_soft_link, _elsewhere_virtual,
    _elsewhere_gzip, _elsewhere_lzf, _elsewhere_chunk, _longer_times, _hard_loop,
]  # fmt: skip


@pytest.mark.parametrize("change", ELSEWHERE, ids=lambda make: make.__name__)
def test_foreign_data_beside_a_good_record_is_refused(
    change: Callable[[h5py.File, Path], None], outside: Path, tmp_path: Path
) -> None:
    """In whatever group it stands; a reindex names the file and takes the others in."""
    samples = (1000 * np.hanning(400)).astype(np.int16)
    recording = Recording(samples, 3e-4, 0.0, "voltage", 1e6, 0.0, 100)
    metadata = ShotMetadata(utc_now(), 0, 9.81)
    content = build_shot_file(1, recording, metadata, None)
    assert read_shot_file(content, "shot")[0] == 1
    data = tmp_path / "data"
    Archive.open(data, reserve_bytes=0).close()
    path = data / "shots" / "000001.h5"
    path.write_bytes(content)
    with h5py.File(path, "a") as file:
        change(file, outside)
    (data / "shots" / "000002.h5").write_bytes(build_shot_file(2, recording, metadata, None))
    report = Archive.reindex(data)
    assert report.shots == 1
    assert len(report.damaged) == 1
    assert "000001.h5" in report.damaged[0]


@pytest.mark.parametrize(
    ("key", "value"), [("sample_rate_hz", 1e308), ("per_code", 5e-324), ("trigger_index", 400)]
)
def test_a_shot_file_of_impossible_numbers_is_refused(key: str, value: float) -> None:
    """A shot file is held to the same ranges as a campaign."""
    samples = (1000 * np.hanning(400)).astype(np.int16)
    recording = Recording(samples, 3e-4, 0.0, "voltage", 1e6, 0.0, 100)
    bad = replace(recording, **{key: value})
    with pytest.raises(CorruptShotError, match=key):
        read_shot_file(build_shot_file(1, bad, ShotMetadata(utc_now(), 0, 9.81), None), "shot")


@settings(max_examples=300, deadline=None, database=None, derandomize=True)
@given(content=st.binary(max_size=200).map(lambda tail: b"\x89HDF\r\n\x1a\n" + tail))
def test_any_bytes_behind_the_signature_are_refused(content: bytes) -> None:
    """In words, not by a crash."""
    with pytest.raises(CorruptShotError):
        read_shot_file(content, "shot")


def test_a_reindex_survives_hostile_files_and_names_each(tmp_path: Path, outside: Path) -> None:
    """The one command that looks into unknown files does so in a process of its own."""
    data = tmp_path / "data"
    Archive.open(data, reserve_bytes=0).close()
    with Archive.open(data, reserve_bytes=0) as archive:
        folder = archive.directory / "shots"
        path = archive._store.path(1)
    path.parent.mkdir(parents=True, exist_ok=True)
    for number, make in enumerate(HOSTILE, start=1):
        name = path.name.replace("1", str(number))
        (path.parent / name).write_bytes(_content(make, outside))
    assert folder.is_dir()
    run = [sys.executable, "-m", "impactd", "reindex", "--data", str(data), "--config"]
    from impactd.settings.settings import find_config  # noqa: PLC0415

    done = subprocess.run(
        [*run, str(find_config("simulated.toml"))], capture_output=True, text=True, check=False
    )
    assert done.returncode in (0, 1)
    assert "Traceback" not in done.stderr + done.stdout
    with Archive.open(data, reserve_bytes=0) as archive:
        assert archive.shots() == []


anything = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=12)
    | st.sampled_from(["../outside.npy", "/etc/passwd", "shot.npy", "impactd-campaign/1"]),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.text(max_size=6) | st.sampled_from(["file", "sphere", "value", "u", "radius_m"]),
            inner,
            max_size=4,
        )
    ),
    max_leaves=12,
)
KEYS = ["format", "gravity_m_per_s2", "release", "sensor", "spheres", "surfaces", "shots"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A campaign folder with one good file, and one beside it."""
    made = tmp_path_factory.mktemp("campaign")
    samples = (1000 * np.hanning(400)).astype(np.int16)
    np.save(made / "shot.npy", samples)
    np.save(made.parent / "outside.npy", samples)
    return made


@settings(
    max_examples=300,
    deadline=None,
    database=None,
    derandomize=True,
    suppress_health_check=list(HealthCheck),
)
@given(what=st.dictionaries(st.sampled_from(KEYS), anything) | anything)
def test_a_campaign_of_anything_is_refused_in_words(folder: Path, what: object) -> None:
    """Whatever stands in campaign.json: a reason, never a crash."""
    if isinstance(what, dict):
        what = {"format": "impactd-campaign/1"} | what
    (folder / "campaign.json").write_text(json.dumps(what))
    with pytest.raises(CampaignError):
        read_campaign(folder)


@pytest.mark.parametrize("name", ["../outside.npy", "/etc/passwd", "link.npy", "a\0b", ".", ""])
def test_a_campaign_reads_no_file_outside_its_folder(folder: Path, name: str) -> None:
    """Not by a relative path, an absolute one, or a link."""
    link = folder / "link.npy"
    link.unlink(missing_ok=True)
    link.symlink_to(folder.parent / "outside.npy")
    shot = {"file": name, "sample_rate_Hz": 1e6, "volts_per_code": 3e-4, "trigger_index": 10}
    (folder / "campaign.json").write_text(
        json.dumps({"format": "impactd-campaign/1", "shots": [shot]})
    )
    with pytest.raises(CampaignError):
        read_campaign(folder)


@settings(max_examples=200, deadline=None, database=None, derandomize=True)
@given(
    content=st.binary(max_size=120)
    | st.text(max_size=120).map(lambda text: ("time_s,volts\n" + text).encode("utf-8", "replace"))
    | st.binary(max_size=60).map(lambda tail: b"\x93NUMPY\x01\x00" + tail)
)
@pytest.mark.parametrize("name", ["x.csv", "x.npy"])
def test_a_sample_file_of_anything_is_refused_in_words(
    tmp_path_factory: pytest.TempPathFactory, name: str, content: bytes
) -> None:
    """Broken tables, broken headers, no numbers."""
    made = tmp_path_factory.mktemp("samples")
    (made / name).write_bytes(content)
    shot = {"file": name, "sample_rate_Hz": 1e6, "volts_per_code": 3e-4, "trigger_index": 10}
    (made / "campaign.json").write_text(
        json.dumps({"format": "impactd-campaign/1", "shots": [shot]})
    )
    with pytest.raises(CampaignError):
        read_campaign(made)
