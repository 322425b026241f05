"""The shot file for people and programs that never heard of impactd."""

from __future__ import annotations

import io
import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from drivers.digitizer import Record
from impactd.storage.archive import Archive, CorruptShotError, ShotMetadata
from impactd.storage.shot_file import build_shot_file, read_shot_file, recording_of
from impactd.storage.shot_metadata import Recording


@pytest.fixture
def content(record: Callable[..., Record], metadata: ShotMetadata) -> bytes:
    """Return the bytes of a shot file."""
    return build_shot_file(17, recording_of(record()), metadata, None)


def test_nxcheck_finds_nothing_to_complain_about(
    archive: Archive, stored: Callable[..., int]
) -> None:
    """The NeXus validator reports no error and no warning."""
    nxcheck = Path(sys.executable).with_name("nxcheck")
    if not nxcheck.exists():
        pytest.skip("nxcheck (package nexusformat) is not installed")

    done = subprocess.run(
        [nxcheck, archive.shot_path(stored())], check=True, capture_output=True, text=True
    )

    assert "Total number of warnings: 0" in done.stdout
    assert "Total number of errors: 0" in done.stdout


def test_viewers_find_the_impact_in_volts_over_seconds(content: bytes) -> None:
    """Following ``default``, ``signal`` and ``axes`` leads to the pulse, with units, at time 0."""
    with h5py.File(io.BytesIO(content)) as file:
        entry = file[file.attrs["default"]]
        data = entry[entry.attrs["default"]]
        signal, time = data[data.attrs["signal"]], data[data.attrs["axes"][0]]

        assert data.attrs["NX_class"] == "NXdata"
        assert signal.shape == time.shape
        assert (signal.attrs["units"], time.attrs["units"]) == ("V", "s")
        assert signal[()].max() == pytest.approx(8000 * 3.0517578125e-4 + 0.002, rel=0.01)
        assert time[()][np.argmax(signal[()])] == pytest.approx(50e-6, abs=10e-6)


def test_the_whole_record_is_the_raw_codes_themselves(
    content: bytes, record: Callable[..., Record]
) -> None:
    """The plot of the whole record links to the codes instead of copying them."""
    with h5py.File(io.BytesIO(content)) as file:
        link = file["entry/record"].get("data", getlink=True)
        codes = file["entry/record/data"]
        time = file["entry/record/time"]

        assert isinstance(link, h5py.SoftLink)
        assert codes.dtype == np.int16
        assert np.array_equal(codes[()], record().codes)
        assert np.allclose(np.diff(time[()]), 1 / 990786.0, rtol=1e-6)
        assert time[1000] == 0.0


def test_codes_carry_checksums(content: bytes) -> None:
    """Codes are stored in chunks with fletcher32."""
    with h5py.File(io.BytesIO(content)) as file:
        assert file["entry/instrument/digitizer/data"].fletcher32


def test_flipped_bits_in_the_codes_never_read_as_data(
    content: bytes, record: Callable[..., Record]
) -> None:
    """Even without the index's SHA-256, a damaged chunk is an error, not another number."""
    with h5py.File(io.BytesIO(content)) as file:
        codes = file["entry/instrument/digitizer/data"]
        chunk = codes.id.get_chunk_info(0)
    generator = np.random.default_rng(5)
    for offset in generator.integers(0, chunk.size, 30):
        damaged = bytearray(content)
        damaged[chunk.byte_offset + int(offset)] ^= 0x10
        with pytest.raises(CorruptShotError):
            read_shot_file(bytes(damaged), "x.h5")


def test_fields_for_people_agree_with_the_facts_for_programs(content: bytes) -> None:
    """What stands in the NeXus tree is what the circumstances say."""
    with h5py.File(io.BytesIO(content)) as file:
        entry = file["entry"]
        facts = json.loads(entry["process/circumstances/data"][()])
        metadata, recording = facts["about"], facts["recording"]
        settings = entry["instrument/acquisition"]

        def read(path: str) -> Any:
            value = entry[path][()]
            return value.decode() if isinstance(value, bytes) else value

        assert read("title") == "Shot 17: acetal on polycarbonate from 47.0 mm"
        assert read("start_time") == metadata["started_utc"]
        assert read("user/name") == metadata["operator"]
        assert read("sample/name") == metadata["surface"]["name"]
        assert read("sample/mass") == metadata["surface"]["coupon_mass_kg"]
        assert read("sphere/radius") == metadata["sphere"]["radius_m"]
        assert read("release/drop_height") == metadata["drop_height_m"]
        assert read("release/gravity") == metadata["gravity_m_per_s2"]
        assert read("release/free_fall_speed") == pytest.approx((2 * 9.81 * 0.047) ** 0.5)
        assert read("release/valve_host_clock") == metadata["valve_monotonic_ns"]
        assert settings["sample_rate"][()] == recording["sample_rate_hz"]
        assert settings["signal_per_code"][()] == recording["per_code"]
        assert settings["input_range"].attrs["units"] == "V"
        assert list(settings["status_words"][()]) == recording["status_words"]
        assert settings["pre_trigger_samples"][()] == metadata["trigger"]["pre_trigger_samples"]
        assert json.loads(entry["process/configuration/data"][()]) == metadata["configuration"]
        assert (read("process/program"), read("process/version")) == ("impactd", "1.2.3")


def test_what_is_unknown_is_left_out(record: Callable[..., Record]) -> None:
    """A file without sphere, height or valve invents none."""
    bare = ShotMetadata("2026-01-01T00:00:00.000000Z", 0, 9.81)

    content = build_shot_file(1, recording_of(record()), bare, None)

    with h5py.File(io.BytesIO(content)) as file:
        assert "sphere" not in file["entry"]
        assert "drop_height" not in file["entry/release"]
    assert read_shot_file(content, "x")[2] == bare


def test_recordings_of_other_instruments_keep_their_floats() -> None:
    """Accelerations are stored as they came, with their unit."""
    values = np.random.default_rng(0).normal(size=300)
    recording = Recording(values, 1.0, 0.0, "acceleration_m_per_s2", 49993.0, 0.0, 30)
    metadata = ShotMetadata(
        "2026-01-01T00:00:00.000000Z", 0, 9.81, source="import", origin="x/a.npy"
    )

    content = build_shot_file(3, recording, metadata, None)
    number, read, _, drop = read_shot_file(content, "x")

    assert (number, drop) == (3, None)
    assert np.array_equal(read.signal, values)
    assert read.quantum is None
    with h5py.File(io.BytesIO(content)) as file:
        assert file["entry/impact/signal"].attrs["units"] == "m/s^2"


def test_a_record_at_the_converters_limit_is_flagged(
    record: Callable[..., Record], metadata: ShotMetadata
) -> None:
    """A record with a flat top at full scale is kept and called clipped."""
    codes = record().codes.copy()
    codes[1040:1050] = 32767

    assert recording_of(replace(record(), codes=codes)).clipped
    assert not recording_of(record()).clipped


@pytest.mark.parametrize("content", [b"", b"no hdf5", b"\x89HDF\r\n\x1a\n" + bytes(100)])
def test_what_is_no_shot_file_says_so(content: bytes) -> None:
    """Garbage is refused with the file's name."""
    with pytest.raises(CorruptShotError, match=r"some\.h5"):
        read_shot_file(content, "some.h5")
