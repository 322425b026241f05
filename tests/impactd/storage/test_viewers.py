"""A shot file opens by itself in viewers of NeXus files."""

from __future__ import annotations

import warnings

import h5py
import numpy as np
import pytest


def test_nexpy_plots_a_shot_by_itself(archive, stored):
    """NexPy draws what `nexusformat` calls the plottable data: volts over seconds."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the package warns of things of its own
        api = pytest.importorskip("nexusformat.nexus")
        root = api.nxload(archive.shot_path(number := stored()))
        shown = root.plottable_data
        signal, (time,) = shown.nxsignal, shown.nxaxes
        assert shown.nxtitle.startswith(f"Shot {number}:")
        assert signal.attrs["units"] == "V"
        assert time.attrs["units"] == "s"
    recording = archive.read_shot(number).recording
    at = recording.trigger_index + round(float(time.nxvalue[0]) * recording.sample_rate_hz)
    kept = recording.signal[at : at + signal.shape[0]]
    np.testing.assert_allclose(signal.nxvalue, kept, rtol=0, atol=1e-12)


def test_the_default_leads_from_the_root_to_a_curve(archive, stored):
    """silx view and H5Web follow `default` from group to group, then `signal` and `axes`."""
    with h5py.File(archive.shot_path(stored())) as file:
        group = file
        while "default" in group.attrs:
            group = group[group.attrs["default"]]
        assert group.attrs["NX_class"] == "NXdata"
        signal = group[group.attrs["signal"]]
        (axis,) = group.attrs["axes"]
        assert signal.ndim == 1
        assert group[axis].shape == signal.shape
        assert group[axis].attrs["units"] == "s"
        assert signal.attrs["long_name"] == "signal (V)"


def test_silx_reads_the_default_plot(archive, stored):
    """silx's own reader finds the same curve, where silx is installed."""
    nxdata = pytest.importorskip("silx.io.nxdata")
    with h5py.File(archive.shot_path(number := stored())) as file:
        found = nxdata.get_default(file)
        assert found is not None
        assert found.issues == []
        assert found.is_curve
        assert found.title.startswith(f"Shot {number}:")
        assert found.signal_name == "signal (V)"
        assert found.axes_names == ["time after the trigger (s)"]
