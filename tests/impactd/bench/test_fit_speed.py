"""The reference of the fit's benchmark is the same fit, and the refit benchmark counts rightly."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from analysis import fit_campaign
from drivers.simulated.campaign import CampaignSettings
from drivers.simulated.specimens import SPHERES, SURFACES
from impactd.bench import fit_speed, refit
from impactd.bench.simulated_campaign import simulated_campaign


def test_lmfit_around_solve_ivp_finds_the_same_stiffness() -> None:
    """Same shot, parameters, whitening and priors: ln K agrees to 1e-4."""
    pytest.importorskip("lmfit")
    campaign = simulated_campaign(
        CampaignSettings(
            spheres={"acetal": SPHERES["acetal"]},
            surfaces={"polycarbonate": SURFACES["polycarbonate"]},
            drop_heights_m=(0.03,),
            repeats=1,
            rig="paper",
        ),
        fit_speed.SEED,
    )
    ours = fit_campaign(campaign, "kv", by_pair=True, heldout=False)
    log_k, seconds = fit_speed.lmfit_fit(dataclasses.replace(campaign))
    at = next(i for i, n in enumerate(ours.problem.names) if n.startswith("pair."))
    assert abs(float(ours.fitted.theta[at]) - log_k) < fit_speed.SAME_OPTIMUM
    assert seconds > 0


@pytest.mark.slow
def test_the_refit_benchmark_times_every_way_and_survives_its_own_kill(tmp_path: Path) -> None:
    """Rates for processes and Dask; the killed run ends with every shot once."""
    figures = refit.measure_refit(tmp_path, 200, rounds=1)
    assert [f.unit for f in figures] == ["shots/s"] * 4 + ["1", "B"]
    assert figures[4].value == 0
    assert figures[4].met
