"""Results as tables and datasets, and records that are read only as far as they are needed."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

from impactd.client import Rig, RigError, mm
from impactd.client.range_file import RangeFile
from impactd.client.shot import Shot

pytest.importorskip("pandas")
pytest.importorskip("xarray")


@pytest.fixture(scope="module")
def shot(rig: Rig) -> Shot:
    """A shot on the specimen."""
    return rig.drop("acetal", "specimen", 45 * mm)


def test_a_record_has_units_and_is_that_of_the_file(shot: Shot, tmp_path: Path) -> None:
    """The dataset is signal over time in volts and seconds, sample by sample as stored."""
    record = shot.record()
    shot.save(tmp_path / "shot.h5")
    with h5py.File(tmp_path / "shot.h5") as file:
        impact = file["entry/impact"]
        times, volts = impact["time"][()], impact["signal"][()]
    assert record.sizes["time"] == shot.samples
    assert (record.signal.attrs["units"], record.time.attrs["units"]) == ("V", "s")
    assert record.attrs["sphere"] == "acetal"
    same = record.signal.sel(time=times, method="nearest")
    np.testing.assert_allclose(same, volts, atol=1e-9)
    assert float(abs(record.signal).max()) == pytest.approx(abs(shot.peak), abs=0.01)


def test_a_stretch_of_a_record_fetches_a_part_of_the_file(rig: Rig, shot: Shot) -> None:
    """Two milliseconds around the impact take a fraction of the file over the line."""
    stretch = shot.record(-0.5e-3, 1.5e-3)
    assert stretch.sizes["time"] == 2001
    np.testing.assert_allclose(stretch.signal, shot.record().signal.sel(time=stretch.time))
    remote = RangeFile(rig.connection, f"/v1/shots/{shot.number}.h5")
    with h5py.File(remote, "r") as file:
        codes = file["entry/instrument/digitizer/data"]
        codes[20_000:22_000]
        fetched = remote.fetched_bytes
        codes[()]
    assert remote.size_bytes == shot.size_bytes
    assert fetched < 0.3 * shot.size_bytes
    assert remote.fetched_bytes <= shot.size_bytes


def test_a_stretch_beside_the_record_is_refused(shot: Shot) -> None:
    """Moments that were not recorded are named, with those that were."""
    with pytest.raises(RigError, match=r"it lasts from -0\.02 s"):
        shot.record(5, 6)


def test_moduli_are_a_table_with_units(rig: Rig, shot: Shot) -> None:
    """One material a row: value, standard uncertainty, interval and status."""
    frame = rig.moduli_frame()
    assert frame.attrs["units"]["youngs_modulus_Pa"] == "Pa"
    assert frame.attrs["model"] == "kv2"
    row = frame.loc["specimen"]
    assert row["status"] == "fitted"
    low, high = row["low95_youngs_modulus_Pa"], row["high95_youngs_modulus_Pa"]
    assert low < row["youngs_modulus_Pa"] < high
    answer = rig.moduli()["moduli"]["specimen"]["youngs_modulus_Pa"]
    assert row["u_youngs_modulus_Pa"] == answer["u"]


def test_shots_are_a_table_with_units(rig: Rig, shot: Shot) -> None:
    """One shot a row, by number, with the modulus that speaks for it and when it was."""
    frame = rig.shots_frame(surface="specimen")
    assert shot.number in frame.index
    assert frame.attrs["units"]["drop_height_m"] == "m"
    assert str(frame["started_utc"].dt.tz) == "UTC"
    assert 1e9 < frame.loc[shot.number, "reduced_modulus_Pa"] < 5e9
