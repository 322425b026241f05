"""The paper as one turn of the loop: from HSD, does a diagnosis find the crystal by itself?

Twice on a simulated rig with the paper's pairs: with nothing undeclared, and with a coupler that
forgets. The diagnosis is the one of ``impactd diagnose --base hsd`` and is told neither.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from analysis import Campaign, fit_campaign
from drivers.simulated.campaign import CampaignSettings, simulate_campaign, write_campaign_folder
from drivers.simulated.effects import Effect, make_effect
from drivers.simulated.specimens import SPHERES, SURFACES
from impactd.aliases import Json
from impactd.diagnosis.run import diagnose
from impactd.paper.rigs import RANGE_V, Pair, table_3_cell
from impactd.paper.source import rows
from impactd.storage.campaign_folder import read_campaign

TO_BE_FOUND = ("pvc", "ptfe")
"""Materials whose moduli nobody states; spheres and coupons of PTFE, and PVC."""
UNDECLARED = "coupler_highpass"
TIME_CONSTANT_S = 5e-3


@dataclass(frozen=True)
class Rung:
    """One model on the ladder.

    Attributes
    ----------
    model : str
        Its name.
    r2, rms_v, heldout_rms_v : float
        Pooled over the fit windows; held out by height. [1, V, V]
    moduli : dict
        As a diagnosis states them, by material.
    """

    model: str
    r2: float
    rms_v: float
    heldout_rms_v: float
    moduli: Json


@dataclass(frozen=True)
class Turn:
    """The diagnosis of one rig.

    Attributes
    ----------
    undeclared : str or None
        What the rig did beyond the paper's Eqs 1-11.
    rungs : list of Rung
        HSD, KV, and what was found on top.
    found : list of str
        Effects in the order in which they were named.
    noise_rms_v : float
        Before the trigger. [V]
    true_moduli_pa : dict
        E and E/(1 - nu^2) by the names of the moduli. [Pa]
    """

    undeclared: str | None
    rungs: list[Rung]
    found: list[str]
    verdict: str
    sentence: str
    noise_rms_v: float
    true_moduli_pa: dict[str, tuple[float, float]]
    shots: int

    def to_json(self) -> Json:
        """Return it for ``impactd-paper/1``."""
        return {
            "undeclared": self.undeclared,
            "shots": self.shots,
            "verdict": self.verdict,
            "sentence": self.sentence,
            "found": list(self.found),
            "noise_rms_V": self.noise_rms_v,
            "rungs": [
                {
                    "model": rung.model,
                    "r2": rung.r2,
                    "rms_V": rung.rms_v,
                    "heldout_rms_V": rung.heldout_rms_v,
                    "moduli": rung.moduli,
                }
                for rung in self.rungs
            ],
            "true_youngs_modulus_Pa": {n: e for n, (e, _) in self.true_moduli_pa.items()},
            "true_plane_strain_modulus_Pa": {n: e for n, (_, e) in self.true_moduli_pa.items()},
        }


def take_turns(
    seed: int, tell: Callable[[str], None] | None = None, pairs: Collection[Pair] | None = None
) -> list[Turn]:
    """Diagnose from HSD a rig that hides nothing, and one with a leaky coupler.

    Parameters
    ----------
    seed : int
        Of both rigs, which differ in the coupler alone.
    tell : callable, optional
        Told in words what is being done.
    pairs : collection of tuple, optional
        (sphere, surface); all of Table 5 without it.
    """
    leaky = make_effect(UNDECLARED, {"time_constant_s": TIME_CONSTANT_S})
    chosen = list(rows("table5_kv") if pairs is None else pairs)
    return [_turn(seed, chosen, (), tell), _turn(seed, chosen, (leaky,), tell)]


def simulated(
    seed: int, pairs: Sequence[Pair], effects: Sequence[Effect]
) -> tuple[Campaign, dict[str, tuple[float, float]]]:
    """Return a campaign of the paper's pairs, and the true moduli.

    Parameters
    ----------
    seed : int
        Of everything drawn.
    effects : sequence of Effect
        What the rig does and nobody says.

    Returns
    -------
    campaign : Campaign
        Moduli of `TO_BE_FOUND` are not stated.
    true_moduli_pa : dict
        E and E/(1 - nu^2) by ``sphere:name`` or ``surface:name``. [Pa]
    """
    settings = CampaignSettings(
        spheres={name: SPHERES[name] for name in dict.fromkeys(p[0] for p in pairs)},
        surfaces={name: SURFACES[name] for name in dict.fromkeys(p[1] for p in pairs)},
        cell=table_3_cell(),
        fill=None,
        range_v=RANGE_V,
        repeats=1,
        rig="paper",
        effects=tuple(effects),
    )
    made = simulate_campaign(settings, seed)
    with tempfile.TemporaryDirectory() as folder:
        campaign = read_campaign(write_campaign_folder(Path(folder), made))
    campaign = replace(
        campaign,
        shots=tuple(s for s in campaign.shots if (s.sphere, s.surface) in pairs),
        spheres={
            n: replace(m, youngs_modulus_pa=None) if n in TO_BE_FOUND else m
            for n, m in campaign.spheres.items()
        },
        surfaces={
            n: replace(m, youngs_modulus_pa=None) if n in TO_BE_FOUND else m
            for n, m in campaign.surfaces.items()
        },
    )
    truth = {
        f"{side}:{name}": (float(one["youngs_modulus_Pa"]), float(one["plane_strain_modulus_Pa"]))
        for side, key in (("sphere", "spheres"), ("surface", "surfaces"))
        for name, one in made["truth"][key].items()
    }
    return campaign, truth


def _turn(
    seed: int, pairs: Sequence[Pair], effects: Sequence[Effect], tell: Callable[[str], None] | None
) -> Turn:
    undeclared = UNDECLARED if effects else None
    if tell is not None:
        tell(f"one turn of the loop from HSD, undeclared: {undeclared or 'nothing'}")
    campaign, truth = simulated(seed, pairs, effects)
    document = diagnose(campaign, "hsd")
    rungs = [_rung(document["before"])]
    if document["after"]["model"] not in ("hsd", "kv"):
        rungs.append(_middle_rung(campaign))
    if document["after"]["model"] != "hsd":
        rungs.append(_rung(document["after"]))
    names = rungs[0].moduli
    return Turn(
        undeclared=undeclared,
        rungs=rungs,
        found=[effect["id"] for effect in document["effects"]],
        verdict=document["verdict"],
        sentence=document["sentence"],
        noise_rms_v=document["noise_rms_V"],
        true_moduli_pa={
            name: truth[f"{entry['side']}:{name.rpartition(':')[2]}"]
            for name, entry in names.items()
        },
        shots=document["campaign"]["shots"],
    )


def _rung(block: Json) -> Rung:
    return Rung(
        block["model"], block["r2"], block["rms_V"], block["heldout_rms_V"], block["moduli"]
    )


def _middle_rung(campaign: Campaign) -> Rung:
    """Return KV alone: what the paper would have reported of such a rig."""
    shots = tuple(replace(s, restitution=None) for s in campaign.shots)  # as a diagnosis does
    fit = fit_campaign(replace(campaign, shots=shots), "kv")
    held = fit.heldout_rms
    assert held is not None  # three heights
    return Rung("kv", fit.r2, fit.rms, held, fit.moduli())
