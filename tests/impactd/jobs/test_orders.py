"""What an order to a worker carries of the settings, as far as the fit that is made of it."""

from __future__ import annotations

from typing import Any

import pytest

from impactd.jobs.orders import order_without_shots, shot_places
from impactd.jobs.tasks import fit_shot


@pytest.mark.parametrize("u_m", [0.0, 3e-4])
def test_a_stated_height_offset_reaches_the_fit(bench: Any, u_m: float) -> None:
    """The settings' u of a common height offset is an input of a stored shot's fit; 0 is exact."""
    number = bench.store()
    release = bench.settings.release.model_copy(update={"height_offset_u_m": u_m})
    settings = bench.settings.model_copy(update={"release": release})
    order = order_without_shots(bench.archive, settings, bench.materials, ["hsd"])
    (found,) = fit_shot({**order, "shots": shot_places(bench.archive, [number])})["fits"]
    (pair,) = found["pairs"].values()
    (exact,) = [s for s in found["assumptions"] if s.startswith("Taken as exact")]
    assert ("input.height_offset" in pair["inputs"]) is (u_m > 0)
    assert ("release.height_offset_u_m" in exact) is (u_m == 0)
    if u_m > 0:
        assert pair["inputs"]["input.height_offset"]["u"] == pytest.approx(0.3)  # [mm]
        # the balls' radius and mass are known by their grade
        assert {"input.radius.acetal", "input.mass.acetal"} <= set(pair["inputs"])
