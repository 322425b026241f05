"""A stored shot: what the API says of it, and its record, read as far as it is needed."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from pydantic import PrivateAttr

from impactd.aliases import Json
from impactd.client.connection import Connection
from impactd.client.range_file import RangeFile
from impactd.wire.answers import ShotAnswer

if TYPE_CHECKING:
    import h5py
    import xarray


class Shot(ShotAnswer):
    """A shot as the API describes it; its samples stay on the daemon until they are asked for."""

    _connection: Connection = PrivateAttr()

    @classmethod
    def of(cls, answer: Json, connection: Connection) -> Shot:
        """Return the shot of an answer."""
        made = cls.model_validate(answer)
        made._connection = connection
        return made

    @property
    def usable_modulus(self) -> Json | None:
        """Return the reduced modulus; None where there is none or the shot is not to be used."""
        return None if self.advice == "repeat" else self.reduced_modulus_Pa

    @contextmanager
    def open(self) -> Iterator[h5py.File]:
        """Open the shot's NeXus file on the daemon; only what is read of it is fetched."""
        import h5py  # noqa: PLC0415 - who only asks for moduli need not load it

        with (
            RangeFile(self._connection, f"/v1/shots/{self.number}.h5") as remote,
            h5py.File(remote, "r") as file,
        ):
            yield file

    def record(self, start_s: float | None = None, stop_s: float | None = None) -> xarray.Dataset:
        """Return the record, or a stretch of it, as a dataset with units.

        Parameters
        ----------
        start_s, stop_s : float, optional
            First and last moment, from the trigger. [s]

        Returns
        -------
        xarray.Dataset
            ``signal`` over ``time``.
        """
        from impactd.client.tables import record_dataset  # noqa: PLC0415 - as above

        with self.open() as file:
            return record_dataset(file, start_s, stop_s)

    def save(self, path: str | Path) -> None:
        """Write the shot's NeXus file."""
        self._connection.download(f"/v1/shots/{self.number}.h5", Path(path))
