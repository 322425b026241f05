"""Everything `impactd paper` shows, as one value that JSON can carry."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

from analysis.paper.valley import Valley, valley
from impactd import __version__
from impactd.aliases import Json
from impactd.paper.claim import Claim
from impactd.paper.claims import all_claims
from impactd.paper.printed_rows import PrintedRow, printed_rows
from impactd.paper.rigs import WAYS, Pair, RigFigures, calibrated_cell, known_of, run_rigs
from impactd.paper.source import (
    distance_from_literature,
    literature,
    over_literature,
    rows,
    spread_of_materials,
    tables,
)
from impactd.paper.table_claims import MEAN_R2, table_claims
from impactd.paper.trace_page import closed_model
from impactd.paper.turn import Turn, take_turns

VALLEY_PAIR = ("acetal", "polycarbonate")
STARTS_PA = (
    (3.15e9, 2.2e9),
    (1.0e9, 1.0e9),
    (10.0e9, 2.2e9),
    (1.2e9, 6.0e9),
    (12.0e9, 1.2e9),
    (20.0e9, 20.0e9),
)
"""(E_p, E_s); the first is the literature's."""


@dataclass(frozen=True)
class PaperResult:
    """The paper compared with ours.

    Attributes
    ----------
    claims : list of Claim
        Of text and figures.
    rigs : RigFigures
        For Tables 3-5.
    valley : Valley
        Of the highest drop of one pair on the first rig.
    seed : int
        Of the first rig.
    turns : list of Turn
        The loop from HSD, with nothing undeclared and with a coupler.
    printed : list of PrintedRow
        Tables 4 and 5.
    """

    claims: list[Claim]
    rigs: RigFigures
    valley: Valley
    seed: int
    turns: list[Turn]
    printed: list[PrintedRow]

    def table_claims(self) -> list[Claim]:
        """Return what the paper says of Tables 3-5 as wholes."""
        return table_claims(table_3(self.rigs), mean_r2(self.rigs))

    def to_json(self) -> Json:
        """Return everything, unrounded, as ``impactd-paper/1``."""
        v = self.valley
        return {
            "format": "impactd-paper/1",
            "software": f"impactd {__version__}",
            "source": "Maranzano & Hancock, Sensing and Bio-Sensing Research 7 (2016) 31-37",
            "claims": [claim.to_json() for claim in self.claims],
            "rigs": len(self.rigs.true_cells),
            "seed": self.seed,
            "table3": table_3(self.rigs),
            "tables_4_5": [pair_row(self.rigs, pair) for pair in self.rigs.pairs],
            "tables_4_5_as_printed": [row.to_json() for row in self.printed],
            "table_claims": [claim.to_json() for claim in self.table_claims()],
            "closed_model": closed_model(),
            "mean_r2": mean_r2(self.rigs),
            "turns_of_the_loop": [turn.to_json() for turn in self.turns],
            "hsd_over_kv_correlation": pattern_correlation(self.rigs),
            "paper_distance_from_literature": literature_distance(),
            "paper_spread_of_materials": {
                t: spread_of_materials(t) for t in ("table4_hsd", "table5_kv")
            },
            "valley": {
                "pair": "/".join(VALLEY_PAIR),
                "correlation_ln_moduli": v.correlation,
                "fisher_eigenvalue_ratio": v.eigenvalue_ratio,
                "u_ln_reduced_modulus": v.u_ln_reduced,
                "excess_chi2_sphere_doubled_along": v.along,
                "excess_chi2_sphere_doubled_across": v.across,
                "fits": [
                    dict(
                        zip(
                            (
                                "start_sphere_Pa",
                                "start_surface_Pa",
                                "sphere_Pa",
                                "surface_Pa",
                                "reduced_modulus_Pa",
                                "excess_chi2",
                            ),
                            end,
                            strict=True,
                        )
                    )
                    for end in v.ends
                ],
            },
        }


def compute(
    rigs: int,
    seed: int,
    tell: Callable[[str], None] | None = None,
    turn_pairs: Collection[Pair] | None = None,
) -> PaperResult:
    """Compute everything.

    Parameters
    ----------
    rigs : int
        Simulated rigs, > 1.
    seed : int
        Of the first.
    tell : callable, optional
        Told in words what is being done.
    turn_pairs : collection of tuple, optional
        (sphere, surface) of the loop's turns; all of Table 5 without it.
    """
    if tell is not None:
        tell("figures 2-6")
    claims = all_claims()
    found = run_rigs(rigs, seed, tell)
    turns = take_turns(seed + rigs, tell, turn_pairs)
    return PaperResult(claims, found, one_valley(found), seed, turns, printed_rows(found))


def one_valley(rigs: RigFigures) -> Valley:
    """Return the valley of E_p and E_s for the highest drop of `VALLEY_PAIR` on the first rig."""
    assert rigs.first is not None
    _, joint, calibration = rigs.first
    cell, compliance = calibrated_cell(calibration)
    shots = [s for s in joint.shots if (s.item.shot.sphere, s.item.shot.surface) == VALLEY_PAIR]
    shot = max(shots, key=lambda s: s.item.shot.drop_height_m or 0.0)
    known = known_of(shot, cell.stiffness_n_per_m * compliance, cell)
    return valley(
        shot.item,
        known,
        sphere=literature("sphere", VALLEY_PAIR[0]),
        surface=literature("surface", VALLEY_PAIR[1]),
        starts_pa=STARTS_PA,
        noise_v=shot.item.noise.rms,
    )


def _spread(values: Sequence[float]) -> list[float]:
    return [statistics.fmean(values), statistics.stdev(values)]


def table_3(rigs: RigFigures) -> Json:
    """Return Table 3: the paper's mean and std, the rigs' truth, and what calibrations found."""
    kv = tables()["load_cell"]["kv"]
    hsd = tables()["load_cell"]["hsd"]
    cell = {}
    for name in rigs.true_cells[0]:
        true = [t[name] for t in rigs.true_cells]
        found = [f[name] for f in rigs.found_cells]
        errors = [math.log(f / t) for f, t in zip(found, true, strict=True)]
        cell[name] = {
            "paper": kv.get(name),
            "true": _spread(true),
            "calibrated": _spread(found),
            "rms_relative_error": math.sqrt(statistics.fmean(e**2 for e in errors)),
        }
    return {
        "cell": cell,
        "hsd_gain_N_per_V": {
            "paper": hsd["calibration_N_per_V"],
            **{way: _spread(values) for way, values in rigs.hsd_gain.items()},
        },
        "r2": {
            "paper_hsd": hsd["r_squared"],
            "paper_kv": kv["r_squared"],
            **{way: _spread(values) for way, values in rigs.calibration_r2.items()},
        },
    }


def pair_row(rigs: RigFigures, pair: tuple[str, str]) -> Json:
    """Return one row of Tables 4-5: theirs over literature, ours over truth."""
    hsd, kv = over_literature("table4_hsd"), over_literature("table5_kv")
    figures = rigs.pairs[pair]
    return {
        "sphere": pair[0],
        "surface": pair[1],
        "contact_time_s": figures.contact_time_s,
        "paper_hsd_over_literature": hsd.get(pair),
        "paper_kv_over_literature": kv.get(pair),
        "paper_hsd_over_kv": hsd[pair] / kv[pair] if pair in hsd else None,
        "ratio": {way: _spread(figures.ratio[way]) for way in WAYS},
        "r2": {way: statistics.fmean(figures.r2[way]) for way in WAYS},
        "stated_relative_u": statistics.fmean(figures.u_relative),
    }


def mean_r2(rigs: RigFigures) -> Json:
    """Return the mean R2 over Table 4's pairs (and Table 5's for KV), by way of fitting."""
    four = rows("table4_hsd")
    return {
        way: statistics.fmean(
            statistics.fmean(f.r2[way])
            for pair, f in rigs.pairs.items()
            if pair in four or not way.startswith("hsd")
        )
        for way in WAYS
    } | {"paper_hsd": MEAN_R2["table4_hsd"], "paper_kv": MEAN_R2["table5_kv"]}


def pattern_correlation(rigs: RigFigures) -> float:
    """Return how the rigs' HSD/KV follows the paper's from pair to pair, in logarithms."""
    hsd, kv = over_literature("table4_hsd"), over_literature("table5_kv")
    theirs = [math.log(hsd[p] / kv[p]) for p in hsd]
    ours = []
    for pair in hsd:
        ratio = rigs.pairs[pair].ratio
        ours.append(
            math.log(statistics.fmean(ratio["hsd_aligned"]) / statistics.fmean(ratio["kv_joint"]))
        )
    return statistics.correlation(theirs, ours)


def literature_distance() -> Json:
    """Return the mean ``|ln(E/E_literature)|`` of Tables 4 and 5 over the pairs of both."""
    common = set(rows("table4_hsd"))
    return {t: distance_from_literature(t, common) for t in ("table4_hsd", "table5_kv")}
