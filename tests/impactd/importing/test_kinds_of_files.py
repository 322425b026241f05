"""Each kind of file, written by its library or by hand, becomes a campaign in one command."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io
import scipy.io.wavfile
from typer.testing import CliRunner

from analysis import load_campaign
from impactd.cli import app
from tests.impactd.importing.conftest import RATE_HZ, Record


def new(*words: object) -> str:
    """Run `impactd new` and return what it printed."""
    made = CliRunner().invoke(app, ["new", *map(str, words)], catch_exceptions=False)
    assert made.exit_code == 0, made.output
    return made.output


def csv_plain(path: Path, record: Record) -> None:
    """Comma, point, a header with units."""
    table = np.column_stack((record.times_s, record.signal))
    np.savetxt(path, table, delimiter=",", header="time_s,force_N", comments="", fmt="%.9g")


def csv_german(path: Path, record: Record) -> None:
    """Semicolon, decimal comma, milliseconds, Latin-1, lines before the header."""
    rows = [f"{t * 1e3:.4f};{x:.6f}".replace(".", ",") for t, x in zip(*_pair(record), strict=True)]
    text = "Gerät;Größe\n2024-03-01;Prüfung 5\n\nZeit [ms];Kraft [N]\n" + "\n".join(rows)
    path.write_bytes(text.encode("latin-1"))


def csv_scope(path: Path, record: Record) -> None:
    """A name line, a unit line and an empty one; microseconds and millivolts for newtons."""
    rows = [f"{t * 1e6:.1f},{x * 1e3:.3f}" for t, x in zip(*_pair(record), strict=True)]
    path.write_text("Time,Channel A\n(us),(mV)\n\n" + "\r\n".join(rows) + "\r\n")


def csv_bare(path: Path, record: Record) -> None:
    """One column, nothing else."""
    np.savetxt(path, record.signal, fmt="%.6f")


def csv_stated_rate(path: Path, record: Record) -> None:
    """A header that states the rate, two channels, no time; quoted decimal commas."""
    rows = [f'"{x:.6f}","{-x / 2:.6f}"'.replace(".", ",") for x in record.signal]
    rows = [row.replace('","', '";"') for row in rows]
    head = "Sample rate;50000\nHammer (N);Plate (g)\n"
    path.write_text(head + "\n".join(rows), encoding="utf-16")


def csv_increment(path: Path, record: Record) -> None:
    """Sample numbers instead of times; the interval stands below its name, as a scope writes it."""
    rows = [f"{i},{x:.6e}," for i, x in enumerate(record.signal)]
    head = f"X,CH1,Start,Increment,\nSequence,Volt,-1.500000e-03,{1 / RATE_HZ:.6e}\n"
    path.write_text(head + "\n".join(rows))


def blanks(path: Path, record: Record) -> None:
    """Columns parted by blanks, comments in front, a note below."""
    rows = [f"  {t:.6e}   {x: .6e}" for t, x in zip(*_pair(record), strict=True)]
    path.write_text("# oscilloscope 7\n# time force\n" + "\n".join(rows) + "\nend of record\n")


def npy_long(path: Path, record: Record) -> None:
    """One long record."""
    np.save(path, record.signal)


def npy_hits(path: Path, record: Record) -> None:
    """A row for each hit, cut by somebody's script."""
    np.save(path, np.array([record.signal[b - 200 : b + 1500] for b in record.begins]))


def npz(path: Path, record: Record) -> None:
    """Signal, times and rate by name."""
    np.savez(path, force_N=record.signal, t=record.times_s)


def mat(path: Path, record: Record) -> None:
    """A struct, as MATLAB users keep them."""
    scipy.io.savemat(path, {"data": {"force_N": record.signal, "fs": RATE_HZ}})


def mat_73(path: Path, record: Record) -> None:
    """MATLAB 7.3 is HDF5 with columns for rows."""
    with h5py.File(path, "w", userblock_size=512) as file:
        file["force_N"] = record.signal[None, :]
        file["Fs"] = np.array([[RATE_HZ]])


def wav(path: Path, record: Record) -> None:
    """16-bit PCM; full scale is 128 N."""
    codes = np.round(record.signal / 128 * 32768).astype(np.int16)
    scipy.io.wavfile.write(path, int(RATE_HZ), codes)


def uff(path: Path, record: Record) -> None:
    """Data set 58."""
    pyuff = pytest.importorskip("pyuff")
    one = pyuff.prepare_58(
        binary=0, func_type=1, ver_num=0, load_case_id=0, rsp_ent_name="NONE", rsp_node=1,
        rsp_dir=3, ref_ent_name="NONE", ref_node=1, ref_dir=3, data=record.signal, x=record.times_s,
        id1="hammer", abscissa_spacing=1, abscissa_inc=1 / RATE_HZ, abscissa_min=0.0,
        abscissa_spec_data_type=17, ordinate_spec_data_type=13, orddenom_spec_data_type=0,
        ordinate_axis_units_lab="N", abscissa_axis_units_lab="s",
    )  # fmt: skip
    pyuff.UFF(str(path)).write_sets([one], "overwrite")


def tdms(path: Path, record: Record) -> None:
    """A waveform channel."""
    nptdms = pytest.importorskip("nptdms")
    about = {"wf_increment": 1 / RATE_HZ, "wf_samples": record.signal.size, "unit_string": "N"}
    with nptdms.TdmsWriter(str(path)) as writer:
        writer.write_segment([nptdms.ChannelObject("rig", "force", record.signal, about)])


def lvm(path: Path, record: Record) -> None:
    """LabVIEW's own text with its header, decimal commas."""
    pytest.importorskip("lvm_read")
    head = [
        "LabVIEW Measurement\t", "Writer_Version\t2", "Reader_Version\t2", "Separator\tTab",
        "Decimal_Separator\t,", "Multi_Headings\tNo", "X_Columns\tOne", "Time_Pref\tRelative",
        "***End_of_Header***\t", "", "Channels\t1", f"Samples\t{record.signal.size}",
        "Date\t2024/03/01", "Time\t10:00:00", "Y_Unit_Label\tNewtons", "X_Dimension\tTime",
        "X0\t0,0000000000000000E+0", f"Delta_X\t{1 / RATE_HZ:.6f}".replace(".", ","),
        "***End_of_Header***\t", "X_Value\tForce\tComment",
    ]  # fmt: skip
    rows = [f"{t:.6f}\t{x:.6f}".replace(".", ",") for t, x in zip(*_pair(record), strict=True)]
    path.write_text("\n".join(head + rows) + "\n")


def hdf5(path: Path, record: Record) -> None:
    """A dataset with attributes beside something else."""
    with h5py.File(path, "w") as file:
        file["run/other"] = np.arange(100.0)
        made = file.create_dataset("run/force", data=record.signal)
        made.attrs["units"] = "N"
        made.attrs["sample_rate"] = RATE_HZ


def _pair(record: Record) -> tuple[list[float], list[float]]:
    return record.times_s.tolist(), record.signal.tolist()


KINDS: list[tuple[str, Callable[[Path, Record], None], list[str]]] = [
    ("plain.csv", csv_plain, []),
    ("german.csv", csv_german, []),
    ("scope.csv", csv_scope, ["--unit", "N", "--scale", "0.001"]),
    ("bare.txt", csv_bare, ["--rate", "50000", "--unit", "N"]),
    ("rate.csv", csv_stated_rate, ["--column", "hammer"]),
    ("increment.csv", csv_increment, ["--unit", "N"]),
    ("blanks.dat", blanks, ["--unit", "N"]),
    ("long.npy", npy_long, ["--rate", "50000", "--unit", "N"]),
    ("hits.npy", npy_hits, ["--rate", "50000", "--unit", "N"]),
    ("arrays.npz", npz, []),
    ("old.mat", mat, []),
    ("new.mat", mat_73, []),
    ("sound.wav", wav, ["--unit", "N", "--scale", "128"]),
    ("set58.uff", uff, []),
    ("waveform.tdms", tdms, []),
    ("labview.lvm", lvm, []),
    ("nested.h5:/run/force", hdf5, []),
]


@pytest.mark.parametrize(("name", "write", "options"), KINDS, ids=[kind[0] for kind in KINDS])
def test_a_file_becomes_a_campaign_in_one_command(
    tmp_path: Path,
    record: Record,
    name: str,
    write: Callable[[Path, Record], None],
    options: list[str],
) -> None:
    """Three hits with rate, unit, place and values come out as they went in."""
    write(tmp_path / name.partition(":")[0], record)
    said = new(tmp_path / name, "--out", tmp_path / "out", *options)
    campaign = load_campaign(tmp_path / "out")
    assert not campaign.rejected
    assert len(campaign.shots) == 3
    assert [shot.quantity for shot in campaign.shots] == ["force_N"] * 3
    for shot, begin in zip(campaign.shots, record.begins, strict=True):
        assert shot.sample_rate_hz == pytest.approx(RATE_HZ, rel=1e-6)
        begins_at = shot.trigger_index
        assert begins_at >= 64
        part = shot.signal[begins_at - 20 : begins_at + 200]
        at = begin + _foot(record, begin) - 1
        wanted = record.signal[at - 20 : at + 200]
        assert np.max(np.abs(part - wanted)) < 0.01
    assert (tmp_path / "out" / "recordings.png").stat().st_size > 10_000
    assert "Read and assumed" in said
    document = json.loads((tmp_path / "out" / "campaign.json").read_text())
    assert document["assumptions"]
    assert not document["spheres"]
    assert not document["surfaces"]


def _foot(record: Record, begin: int) -> int:
    """Return where a hit reaches a twentieth of its peak."""
    pulse = np.abs(record.signal[begin : begin + record.contact])
    return int(np.argmax(pulse > 0.05 * pulse.max()))
