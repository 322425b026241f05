"""A detector that is triggered by dropping a sphere; its record is the shot's NeXus file.

Events hold what a shot says in numbers. The samples stay in the file, which the documents name
(StreamResource): Tiled reads them from there.
"""

from __future__ import annotations

import time
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import anyio
from event_model import StreamRange, compose_stream_resource
from ophyd_async.core import AsyncStatus, Device

from impactd.client.async_rig import AsyncRig
from impactd.client.errors import RigError
from impactd.client.shot import Shot

CODES = "/entry/instrument/digitizer/data"
_ACQUISITION = "entry/instrument/acquisition"
_NAN = float("nan")


class ImpactDetector(Device):
    """A rig as a triggerable detector.

    Parameters
    ----------
    rig : AsyncRig
        With a token that may operate.
    folder : Path
        Where shots' files go; the data server must be able to read it.
    name : str, optional
        What the data keys begin with.
    """

    def __init__(self, rig: AsyncRig, folder: Path, name: str = "impact") -> None:
        super().__init__(name=name)
        self._rig = rig
        self._folder = folder.resolve()
        self._asked: tuple[str, str, float] | None = None
        self._shot: Shot | None = None
        self._values: dict[str, Any] = {}
        self._count = 0
        self._untold: list[tuple[str, Any]] = []

    def drop_next(self, sphere: str, surface: str, height_m: float) -> None:
        """Say what the next triggers drop."""
        self._asked = (sphere, surface, height_m)

    @AsyncStatus.wrap
    async def stage(self) -> None:
        """Begin a run: wait until the rig is READY, count its shots from 0."""
        self._count, self._untold = 0, []
        await self._rig.wait_until_ready()

    @AsyncStatus.wrap
    async def unstage(self) -> None:
        """End a run."""

    @AsyncStatus.wrap
    async def trigger(self) -> None:
        """Drop a sphere and wait for its modulus; when the plan is stopped the drop is aborted.

        Raises
        ------
        RigError
            If nothing was said of what to drop.
        """
        if self._asked is None:
            raise RigError("no sphere is named for the next drop: call drop_next first.")
        await self._rig.wait_until_ready()
        self._shot = shot = await self._rig.drop(*self._asked)
        path = self._folder / f"shot-{shot.number:06d}.h5"
        self._folder.mkdir(parents=True, exist_ok=True)
        await anyio.to_thread.run_sync(shot.save, path)
        self._values = await anyio.to_thread.run_sync(_numbers, self.name, shot, path)
        self._untold += self._documents(shot, path)
        self._count += 1

    async def describe(self) -> dict[str, Any]:
        """Return the data keys of the last shot."""
        assert self._shot is not None, "a detector is triggered before it is described"
        source = f"{self._rig.connection.url}/v1/shots"
        kinds = {float: ("number", "<f8"), int: ("integer", "<i8"), str: ("string", "<U64")}
        keys: dict[str, Any] = {}
        for name, (value, unit) in self._values.items():
            dtype, numpy_dtype = kinds[type(value)]
            keys[name] = {
                "source": source, "shape": [], "dtype": dtype, "dtype_numpy": numpy_dtype,
                "units": unit,
            }  # fmt: skip
        keys[self._codes] = {
            "source": source, "shape": [self._shot.samples], "dtype": "array",
            "dtype_numpy": "<i2", "external": "STREAM:", "units": "counts",
        }  # fmt: skip
        return keys

    async def read(self) -> dict[str, Any]:
        """Return the numbers of the last shot; its samples are in its file."""
        now = time.time()
        return {
            name: {"value": value, "timestamp": now} for name, (value, _) in self._values.items()
        }

    async def collect_asset_docs(self, index: int | None = None) -> AsyncIterator[Any]:
        """Yield the documents that name the files of shots not yet told of.

        Parameters
        ----------
        index : int, optional
            Not used: each trigger is one shot.

        Yields
        ------
        tuple
            Kind and document.
        """
        del index
        told, self._untold = self._untold, []
        for one in told:
            yield one

    @property
    def _codes(self) -> str:
        return f"{self.name}-codes"

    def _documents(self, shot: Shot, path: Path) -> list[tuple[str, Any]]:
        bundle = compose_stream_resource(
            mimetype="application/x-hdf5",
            uri=f"file://localhost{path.as_posix()}",
            data_key=self._codes,
            parameters={"dataset": CODES, "chunk_shape": (shot.samples,), "swmr": False},
        )
        at = StreamRange(start=self._count, stop=self._count + 1)
        return [
            ("stream_resource", bundle.stream_resource_doc),
            ("stream_datum", bundle.compose_stream_datum(indices=at)),
        ]


def _numbers(name: str, shot: Shot, path: Path) -> dict[str, tuple[Any, str]]:
    """Return a shot's numbers with their units; a modulus that must not be used is not-a-number."""
    import h5py  # noqa: PLC0415 - it is slow to load, and plans are made without it

    with h5py.File(path) as file:
        acquisition = file[_ACQUISITION]
        found = {
            one: float(acquisition[one][()])
            for one in ("signal_per_code", "signal_offset", "sample_rate", "trigger_index")
        }
        unit = str(acquisition["signal_per_code"].attrs["units"])
    modulus = shot.usable_modulus
    return {
        f"{name}-shot": (shot.number, ""),
        f"{name}-drop_height": (float(shot.drop_height_m or _NAN), "m"),
        f"{name}-peak": (float(shot.peak), unit),
        f"{name}-advice": (shot.advice or "", ""),
        f"{name}-reduced_modulus": (float(modulus["value"]) if modulus else _NAN, "Pa"),
        f"{name}-reduced_modulus_U": (float(modulus["expanded"]["U"]) if modulus else _NAN, "Pa"),
        f"{name}-signal_per_code": (found["signal_per_code"], unit),
        f"{name}-signal_offset": (found["signal_offset"], unit),
        f"{name}-sample_rate": (found["sample_rate"], "Hz"),
        f"{name}-trigger_index": (int(found["trigger_index"]), ""),
    }
