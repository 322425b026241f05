"""What is no file of a sensible size: FIFOs, devices, links, holes; and numbers beyond physics."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from impactd.storage.archive import Archive
from impactd.storage.campaign_folder import read_campaign
from impactd.storage.errors import CampaignError, CorruptShotError
from impactd.storage.shot_store import ShotStore

GIGABYTE = 10**9
MEMORY_BYTES = 2 * GIGABYTE
"""Enough for Python with numpy and h5py, less than any of the sparse files."""


def _sparse(path: Path, size_bytes: int = 6 * GIGABYTE) -> None:
    with path.open("wb") as file:
        file.write(b"time_s,volts\n")
        file.truncate(size_bytes)


def _header(path: Path) -> None:
    """A header of 4 GB, as version 2.0 of the format allows, in a hole."""
    with path.open("wb") as file:
        file.write(b"\x93NUMPY\x02\x00" + (4 * GIGABYTE).to_bytes(4, "little"))
        file.truncate(700_000_000)


def _claim(path: Path) -> None:
    """Ten billion samples in a hundred bytes."""
    with path.open("wb") as file:
        header = {"descr": "<i2", "fortran_order": False, "shape": (10**10,)}
        np.lib.format.write_array_header_1_0(file, header)


def _line(path: Path) -> None:
    """One line of a gigabyte."""
    with path.open("wb") as file:
        file.write(b"time_s,volts\n0,")
        file.truncate(GIGABYTE)


def _socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as made:
        here = os.open(path.parent, os.O_DIRECTORY)
        made.bind(f"/proc/self/fd/{here}/{path.name}")  # the path itself may be too long
        os.close(here)


IRREGULAR: list[tuple[str, Callable[[Path], Any], str]] = [
    ("x.csv", os.mkfifo, "FIFO"),
    ("x.npy", os.mkfifo, "FIFO"),
    ("x.npy", lambda path: path.symlink_to("/dev/zero"), "outside"),
    ("x.npy", _socket, "socket"),
    ("x.csv", _sparse, "bytes; at most|line of"),
    ("x.npy", _sparse, "bytes; at most"),
    ("x.npy", _header, "no .npy file"),
    ("x.npy", _claim, "claims 10000000000 samples"),
    ("x.csv", _line, "line of"),
]


def _run_with_little_memory(code: str) -> str:
    """Run Python with a limit on its memory; whatever hangs is ended after a minute."""
    limit = f"import resource; resource.setrlimit(resource.RLIMIT_AS, ({MEMORY_BYTES},) * 2)\n"
    done = subprocess.run(
        [sys.executable, "-c", limit + code],
        capture_output=True, text=True, check=False, timeout=60,
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize(
    ("name", "make", "reason"), IRREGULAR, ids=[f"{row[0]}-{row[2]}" for row in IRREGULAR]
)
def test_a_sample_file_that_is_none_is_refused(
    tmp_path: Path, name: str, make: Callable[[Path], Any], reason: str
) -> None:
    """In words, within little memory, and without waiting for what never comes."""
    make(tmp_path / name)
    shot = {"file": name, "sample_rate_Hz": 1e6, "volts_per_code": 3e-4, "trigger_index": 10}
    (tmp_path / "campaign.json").write_text(
        json.dumps({"format": "impactd-campaign/1", "shots": [shot]})
    )
    said = _run_with_little_memory(
        "from pathlib import Path\n"
        "from impactd.storage.campaign_folder import CampaignError, read_campaign\n"
        f"try: read_campaign(Path({str(tmp_path)!r}))\n"
        "except CampaignError as error: print(error)\n"
    )
    assert any(part in said for part in reason.split("|")), said


@pytest.mark.parametrize("make", [os.mkfifo, lambda path: path.symlink_to("/dev/zero"), _sparse])
def test_a_campaign_json_that_is_no_file_is_refused(
    tmp_path: Path, make: Callable[[Path], Any]
) -> None:
    """A FIFO, a link to a device, six gigabytes of nothing."""
    make(tmp_path / "campaign.json")
    code = (
        "from pathlib import Path\n"
        "from impactd.storage.campaign_folder import CampaignError, read_campaign\n"
        f"try: read_campaign(Path({str(tmp_path / 'campaign.json')!r}))\n"
        "except CampaignError as error: print(error)\n"
    )
    assert "cannot be read" in _run_with_little_memory(code)


def test_the_archive_passes_over_what_is_no_file(tmp_path: Path) -> None:
    """Reindex and verify name a FIFO, a link to a device and a hole in ``shots``, and go on."""
    data = tmp_path / "data"
    Archive.open(data, reserve_bytes=0).close()
    shots = data / "shots"
    os.mkfifo(shots / "000001.h5")
    (shots / "000002.h5").symlink_to("/dev/zero")
    _sparse(shots / "000003.h5")
    (shots / "000004.h5").mkdir()
    os.mkfifo(data / "calibrations" / "000001.json")
    (data / "diagnoses" / "000001.json").symlink_to("/dev/zero")
    code = (
        "from pathlib import Path\n"
        "from impactd.storage.archive import Archive\n"
        f"data = Path({str(data)!r})\n"
        "print(*Archive.reindex(data).damaged, sep='\\n')\n"
        "with Archive.open(data, reserve_bytes=0) as archive:\n"
        "    print(*(found for found in archive.verify() if found.problem), sep='\\n')\n"
    )
    said = _run_with_little_memory(code)
    for name in ("shots/000001.h5", "shots/000002.h5", "shots/000003.h5", "shots/000004.h5"):
        assert said.count(name) >= 2, said
    for reason in ("is a FIFO", "is a link", "6000000000 bytes", "is a directory"):
        assert said.count(reason) >= 2, said


def _set(*path: str | int, to: object) -> Callable[[dict[str, Any]], None]:
    def change(root: dict[str, Any]) -> None:
        place: Any = root
        for key in path[:-1]:
            place = place[key]
        place[path[-1]] = to

    return change


EXTREME = [
    _set("shots", 0, "sample_rate_Hz", to=1e308),
    _set("shots", 0, "sample_rate_u_Hz", to=1e308),
    _set("shots", 0, "volts_per_code", to=5e-324),
    _set("shots", 0, "volts_offset", to=-1e308),
    _set("shots", 0, "drop_height_m", to=5e-324),
    _set("shots", 0, "restitution", to={"value": 5e-324, "u": 0.1}),
    _set("shots", 0, "restitution", to={"value": 0.5, "u": 5e-324}),
    _set("gravity_m_per_s2", to=1e308),
    _set("spheres", "ball", "radius_m", to=1e200),
    _set("spheres", "ball", "mass_kg", to=5e-324),
    _set("spheres", "ball", "youngs_modulus_Pa", to={"value": 1e308, "u": 1}),
    _set("surfaces", "plate", "poissons_ratio", to={"value": 0.3, "u": 5e-324}),
    _set("surfaces", "plate", "coupon_thickness_m", to=1e308),
    _set("sensor", "crystal_mass_kg", to={"value": 5e-324, "u": 0}),
    _set("sensor", "compliance_m_per_V", to={"value": 1e308, "u": 1}),
    _set("sensor", "log_covariance", to=[[1e300] * 4] * 4),
    _set("sensor", "log_covariance", to=[[10**400] * 4] * 4),
]


@pytest.mark.parametrize("change", EXTREME)
def test_a_number_that_arithmetic_cannot_carry_is_refused(
    tmp_path: Path, change: Callable[[dict[str, Any]], None]
) -> None:
    """With JSON path, value and the range it must lie in."""
    np.save(tmp_path / "x.npy", (1000 * np.hanning(400)).astype(np.int16))
    shot: dict[str, Any] = {
        "file": "x.npy", "sample_rate_Hz": 1e6, "volts_per_code": 3e-4, "trigger_index": 10
    }  # fmt: skip
    root: dict[str, Any] = {
        "format": "impactd-campaign/1",
        "shots": [shot],
        "spheres": {"ball": {}},
        "surfaces": {"plate": {}},
        "sensor": {},
    }
    change(root)
    (tmp_path / "campaign.json").write_text(json.dumps(root))
    with pytest.raises(CampaignError, match=r"\$\.\w+.*(between|at least|numbers only)"):
        read_campaign(tmp_path)


@pytest.mark.parametrize("factor", [1e300, 1e-300])
def test_samples_that_arithmetic_cannot_carry_are_refused(tmp_path: Path, factor: float) -> None:
    """Floats far beyond any signal, or all but equal, in an otherwise good folder."""
    np.save(tmp_path / "x.npy", factor * np.hanning(400))
    shot = {"file": "x.npy", "sample_rate_Hz": 1e6, "trigger_index": 10}
    (tmp_path / "campaign.json").write_text(
        json.dumps({"format": "impactd-campaign/1", "shots": [shot]})
    )
    with pytest.raises(CampaignError, match=r"between|flat"):
        read_campaign(tmp_path)


@pytest.mark.parametrize("name", ["ab\u202ecd", "ab\x1b[31m", "ab\u2066", "\u200bab", "a\x85b"])
def test_a_material_named_to_deceive_is_refused(tmp_path: Path, name: str) -> None:
    """The message names the character and holds nothing a terminal would obey."""
    np.save(tmp_path / "x.npy", (1000 * np.hanning(400)).astype(np.int16))
    shot = {"file": "x.npy", "sample_rate_Hz": 1e6, "volts_per_code": 3e-4, "trigger_index": 10}
    root = {"format": "impactd-campaign/1", "shots": [shot], "spheres": {name: {}}}
    (tmp_path / "campaign.json").write_text(json.dumps(root))
    with pytest.raises(CampaignError, match=r"U\+[0-9A-F]{4} ") as caught:
        read_campaign(tmp_path)
    assert str(caught.value).isprintable()


def test_no_link_is_followed_to_a_shot(tmp_path: Path) -> None:
    """Not even to a file: what is stored is what stands in the folder."""
    (tmp_path / "shots").mkdir()
    (tmp_path / "elsewhere").write_bytes(b"anything")
    (tmp_path / "shots" / "000001.h5").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(CorruptShotError, match="is a link"):
        ShotStore(tmp_path).find(tmp_path / "shots" / "000001.h5")
