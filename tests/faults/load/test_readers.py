"""The benchmark of readers, from an archive that is made to figures beside their references."""

from __future__ import annotations

import pytest

from impactd.bench.large_archive import FittedShot
from impactd.bench.readers import measure_readers

from ...impactd.bench.test_large_archive import RESULT, SHOT


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_readers_are_timed_beside_their_references() -> None:
    """Every time is laid beside one of the same run; what was asked for was answered."""
    figures = measure_readers([FittedShot(SHOT, {"kv2": RESULT})], shots=20, rounds=3)

    assert [figure.name.partition(":")[0].partition(" at ")[0] for figure in figures] == [
        "GET /v1/moduli",
        "GET /v1/moduli",
        "POST /v1/abort beside 4 such readers",
        "POST /v1/abort beside 4 such readers",
        "memory of the daemon for 20 shots, readers included",
    ]
    for figure in figures:
        assert figure.value
        assert figure.reference is not None
        assert figure.reference > 0
