"""``impactd posterior``: draws from a fit's posterior, for ArviZ."""

# ruff: noqa: PLC0415 - imported when the command runs: `--help` must not wait for numpy

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from impactd.console.options import Json


class Sampler(StrEnum):
    """Where draws come from."""

    EMCEE = "emcee"
    LAPLACE = "laplace"


_MIXED_BELOW = 1.05
"""R-hat, the spread of all walkers over that of one. A share of 5 % in the spread is what an
uncertainty of two digits can bear."""


def add_to(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(posterior)


def posterior(  # noqa: PLR0917 - the framework fills them by name
    campaign: Annotated[Path, typer.Argument(help="A campaign folder or its campaign.json.")],
    out: Annotated[
        Path, typer.Option("--out", metavar="OUT.nc", help="Where ArviZ's InferenceData goes.")
    ],
    model: Annotated[str, typer.Option("--model", help="hsd, kv or kv2, and effects.")] = "kv2",
    sampler: Annotated[
        Sampler, typer.Option("--sampler", help="The posterior itself, or the fit's Gaussian.")
    ] = Sampler.EMCEE,
    steps: Annotated[
        int,
        typer.Option("--steps", min=20, help=("Steps of each walker, or draws of the Gaussian.")),
    ] = 150,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the random numbers.")] = 1,
    as_json: Json = False,
) -> None:
    """Draw from the posterior of a fit, and write it for ArviZ.

    Needs the extra `mcmc`. Prints each modulus with the interval that the draws give beside the
    stated one.
    """
    from analysis import fit_campaign, load_campaign
    from analysis.posterior.draws import interval95, laplace_draws, posterior_draws
    from analysis.posterior.inference_data import inference_data
    from impactd.console.failure import Failure
    from impactd.console.progress_bar import progress
    from impactd.console.tables import print_json, table
    from impactd.jobs.rebound import with_later_landings

    try:
        import arviz
    except ImportError:
        raise Failure("this needs ArviZ and emcee: pip install 'impactd[mcmc]'.") from None
    hits = with_later_landings(load_campaign(campaign), model)
    fit = fit_campaign(hits, model, progress=lambda text, share: progress(text, share=share))
    if sampler is Sampler.LAPLACE:
        draws = laplace_draws(fit, steps, seed=seed)
    else:
        draws = posterior_draws(
            fit, steps, seed=seed, progress=lambda text, share: progress(text, share=share)
        )
    progress("", last=True)
    found = inference_data(fit, draws, seed=seed + 1)
    found.to_netcdf(str(out), engine="h5netcdf")
    intervals = {}
    for material, stated in fit.moduli().items():
        quantity = stated["youngs_modulus_Pa"]
        if quantity is not None:
            drawn = interval95(
                found["posterior"]["youngs_modulus_Pa"].sel(material=material).values
            )
            intervals[material] = [*map(float, drawn), *quantity["interval95"]]
    worst = float(arviz.rhat(found, var_names=["parameter"])["parameter"].max())
    least = float(arviz.ess(found, var_names=["parameter"])["parameter"].min())
    if as_json:
        keys = ("drawn_from_Pa", "drawn_to_Pa", "stated_from_Pa", "stated_to_Pa")
        moduli = {name: dict(zip(keys, ends, strict=True)) for name, ends in intervals.items()}
        mixed = {"r_hat": worst, "effective_draws": least} if sampler is Sampler.EMCEE else {}
        print_json({"file": str(out), "moduli": moduli, **mixed})
        return
    rows = [(name, *(f"{end / 1e9:.4g}" for end in ends)) for name, ends in intervals.items()]
    print(table(("E/GPa (95 %)", "drawn from", "to", "stated from", "to"), rows))
    if sampler is Sampler.EMCEE:
        print(f"Least effective number of draws {least:.0f}, largest R-hat {worst:.2f}.")
        if worst > _MIXED_BELOW:
            print("The walkers have not mixed: use more --steps, or a nested sampler.")
