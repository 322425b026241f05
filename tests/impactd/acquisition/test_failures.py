"""Every error has a name outside, and says whether the rig itself is in doubt."""

from __future__ import annotations

import pytest

from drivers import errors as driver_errors
from drivers.errors import AbortedError, DeviceLostError, DisobeyedError, DriverError, ProtocolError
from impactd.acquisition.failures import Doubt, failure_of
from impactd.storage.errors import StorageFullError

KINDS = [
    kind
    for kind in vars(driver_errors).values()
    if isinstance(kind, type) and issubclass(kind, DriverError) and kind is not DriverError
]


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_every_driver_error_has_a_type_of_its_own(kind: type[DriverError]) -> None:
    """A new driver error without a line in the table would be called "device"."""
    problem = failure_of(kind("What.", why="Why.", remedy="Do.")).problem
    assert problem.type != "device"
    assert problem.detail == "What. Why."
    assert problem.remedy == "Do."
    assert 400 <= problem.status < 600


def test_the_rig_is_doubted_for_devices_not_for_aborts() -> None:
    """A lost device is tried again, a disobedient one waits for a person, an abort is nothing."""
    assert failure_of(DeviceLostError("gone")).doubt is Doubt.RETRY
    assert failure_of(DisobeyedError("no")).doubt is Doubt.PERSON
    assert failure_of(ProtocolError("stalled")).doubt is Doubt.RETRY
    assert failure_of(AbortedError("end")).doubt is Doubt.NONE
    assert failure_of(StorageFullError("d", free_bytes=1, needed_bytes=2)).problem.status == 507


def test_a_defect_is_called_one_and_stops_the_rig() -> None:
    """What nobody foresaw is internal, with what it said, and calls for a person."""
    failure = failure_of(ZeroDivisionError("division by zero"))
    assert failure.problem.type == "internal"
    assert "ZeroDivisionError" in failure.problem.detail
    assert failure.doubt is Doubt.PERSON
