"""One trial: drawn, simulated, diagnosed, and both sides written down."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass, field, fields

from analysis.diagnosis.base_choice import LOSS_LAW
from analysis.diagnosis.progress import MethodStep
from drivers.simulated.campaign import simulate_campaign
from drivers.simulated.impact import IntegrationError
from drivers.simulated.mistakes import make_mistake
from drivers.simulated.rig_model import DEFAULT_RIG, PAPER, rig_model
from drivers.simulated.specimens import SPECIMEN
from impactd.aliases import Json
from impactd.bench.blind.plan import Plan, colour_of, draw_plan
from impactd.bench.blind.visibility import visibility
from impactd.bench.simulated_campaign import through_a_folder
from impactd.diagnosis.run import diagnose

RECORD_SLOT = "record"
"""Slot of what people did wrong: neither physics nor electronics, but what is written down."""
NAMED = ("identified", "family")
NOT_SIMULATED = "not_simulated"
"""Instead of a verdict, where the simulator cannot integrate what was drawn: nothing to judge."""


@dataclass(frozen=True)
class Trial:
    """One campaign, the truth and the verdict.

    Attributes
    ----------
    kind, seed, base : str, int, str
        What was asked for, and the model that the diagnosis started from.
    effects : list of dict
        What acted: id, slot, parameters, scope.
    colour : str
        ``white``, ``ar1`` or ``pink``.
    ar1, noise_true_V : float
        Correlation and size of the noise as drawn. [1, V]
    verdict : str
        Of the diagnosis; ``failed`` where it raised, ``not_simulated`` where there was no
        recording, with ``error`` saying what.
    acts_on : list of dict
        Where each named effect acts, as the truth says it: side to name or names; empty where it
        acts on everything. Of a mistake that was named its scope, and ``first_shot`` where the
        diagnosis says from which place in the order of the shots on.
    seen_on : list of dict
        The materials whose shots show each named effect, by kind; none of a kind of which all do
        that it acts on.
    numbers : list of dict
        Of each named effect its own numbers as the diagnosis states them, by name and group:
        value, u, interval95 and the like.
    slot : str or None
        Where it put the discrepancy.
    also_slots : list of str
        The other slots that it could not exclude.
    p_value : float or None
        Of structure in the base model's residual.
    visible : float or None
        Whitened squares that the effects add to the base model's best, by the simulator. [1]
    visible_each : list of float
        The same for each effect alone. [1]
    visible_seen : float or None
        Whitened squares beyond chance that the diagnosis' strongest closure takes up. [1]
    excess_seen : float or None
        Whitened squares of the base residual beyond their expectation, which scatter by hundreds.
        [1]
    noise_V, heldout_before_V, heldout_after_V : float or None
        As the diagnosis states them. [V]
    modulus_true, plane_true : float
        Young's and plane-strain modulus of the specimen. [Pa]
    modulus, plane : dict
        What the diagnosis states of them, ``before`` and ``after``: value, u, interval95, or None
        where withheld. [Pa]
    seconds, cpu_seconds : float
        Until the verdict stood: wall and process. [s]
    statement_seconds : float
        To write it down, held-out errors of all candidates included. [s]
    rig : str
        Which physics the rig obeys.
    mistake : dict or None
        What people did wrong: id, scope, numbers, label.
    set_aside : list of int
        Places of the shots that the diagnosis set aside.
    ended_early : bool
        Whether the budget was spent before the end.
    """

    kind: str
    seed: int
    base: str
    effects: list[Json]
    materials: list[str]
    colour: str
    ar1: float
    noise_true_V: float  # noqa: N815 - the contract writes units so in JSON
    verdict: str = "failed"
    named: list[str] = field(default_factory=list)
    confusable: list[list[str]] = field(default_factory=list)  # for each of ``named``
    acts_on: list[Json] | None = None  # of lines that were written before it was asked
    seen_on: list[Json] | None = None  # the same
    numbers: list[Json] = field(default_factory=list)
    slot: str | None = None
    also_slots: list[str] = field(default_factory=list)
    p_value: float | None = None
    visible: float | None = None
    visible_each: list[float] = field(default_factory=list)
    visible_seen: float | None = None
    excess_seen: float | None = None
    noise_V: float | None = None  # noqa: N815 - as above
    heldout_before_V: float | None = None  # noqa: N815 - as above
    heldout_after_V: float | None = None  # noqa: N815 - as above
    modulus_true: float | None = None
    plane_true: float | None = None
    modulus: Json = field(default_factory=dict)
    plane: Json = field(default_factory=dict)
    seconds: float | None = None
    cpu_seconds: float | None = None
    statement_seconds: float | None = None
    error: str | None = None
    rig: str = "paper"  # of lines that were written before there was another
    mistake: Json | None = None
    set_aside: list[int] = field(default_factory=list)
    ended_early: bool = False

    @property
    def truth(self) -> list[str]:
        """Return the ids that acted; for the base ``hsd`` the crystal is what is missing."""
        if self.mistake is not None:
            return [str(self.mistake["id"])]
        if self.base == "hsd":
            return ["crystal_dynamics"]
        return [str(e["id"]) for e in self.effects]

    @property
    def was_simulated(self) -> bool:
        """Whether there was a recording to judge."""
        return self.verdict != NOT_SIMULATED

    @property
    def slots(self) -> list[str]:
        """Return the slots of what acted."""
        return [str(e["slot"]) for e in self.effects]

    @classmethod
    def from_json(cls, row: Json) -> Trial:
        """Return a trial from its line; keys of later versions are left aside."""
        known = {f.name for f in fields(cls)}
        return cls(**{key: value for key, value in row.items() if key in known})

    def to_json(self) -> Json:
        """Return the trial ready for JSON."""
        return asdict(self)


class _Clock:
    """Notes when the verdict stood: from then on the diagnosis is only written down."""

    def __init__(self) -> None:
        self.started = time.perf_counter(), time.process_time()
        self.judged = self.started

    def __call__(self, stage: str, share: float) -> None:
        if stage.startswith(MethodStep.HELD_OUT.heading):
            self.judged = time.perf_counter(), time.process_time()


def run_trial(
    kind: str, seed: int, rig: str = DEFAULT_RIG, *, budget_s: float | None = None
) -> Trial:
    """Draw, simulate, diagnose and lay both sides down.

    Parameters
    ----------
    kind : str
        One of ``plan.KINDS``.
    seed : int
        Of everything drawn.
    budget_s : float, optional
        How long the diagnosis may search. [s]

    Returns
    -------
    Trial
        Also where the diagnosis raised: its verdict is then ``failed``; and where the simulator
        cannot integrate what was drawn: ``not_simulated``.
    """
    plan = draw_plan(kind, seed, rig)
    noise = plan.settings.noise
    known: Json = {
        "kind": kind,
        "seed": seed,
        "base": plan.base,
        "rig": plan.rig,
        "effects": [effect.to_json() for effect in plan.effects],
        "materials": [*plan.settings.spheres, *plan.settings.surfaces],
        "colour": colour_of(noise),
        "ar1": noise.ar1,
        "noise_true_V": noise.rms_v,
    }
    try:
        simulated = _simulated(plan)
    except IntegrationError as error:
        return Trial(**known, verdict=NOT_SIMULATED, error=str(error))
    solid = simulated["truth"]["surfaces"][SPECIMEN]
    known |= {
        "mistake": simulated["truth"].get("mistake"),
        "modulus_true": solid["youngs_modulus_Pa"],
        "plane_true": solid["plane_strain_modulus_Pa"],
    }
    try:
        known |= _diagnosed(plan, simulated, budget_s)
    except Exception as error:  # a trial that fails is a result, and must not stop a night's run
        known["error"] = f"{type(error).__name__}: {error}"
    return Trial(**known)


def _simulated(plan: Plan) -> Json:
    if plan.mistake is None:
        return simulate_campaign(plan.settings, plan.campaign_seed)
    return make_mistake(plan.settings, plan.campaign_seed, plan.mistake)


def _diagnosed(plan: Plan, simulated: Json, budget_s: float | None) -> Json:
    campaign = through_a_folder(simulated)
    seen = visibility(plan, campaign)
    clock = _Clock()
    base = None if plan.base == plan.whole else plan.base  # as somebody who does not know the rig
    stated = diagnose(campaign, base, budget_s=budget_s, progress=clock)
    ended = time.perf_counter()
    before, after = stated["before"], stated["after"]
    effects = [e for e in stated["effects"] if not _is_the_rigs_own_law(e, plan)]
    bare = bool(stated["effects"]) and not effects
    evidence: list[Json] = next(
        (step["evidence"] for step in stated["trail"] if step.get("evidence")), []
    )
    return {
        "verdict": "adequate" if bare and stated["verdict"] in NAMED else stated["verdict"],
        "named": [e["id"] for e in effects],
        "confusable": [e.get("confusable_with", []) for e in effects],
        "acts_on": [where(e) for e in effects],
        "seen_on": [
            {k: v for some in e.get("seen_on", []) for k, v in _materials(some).items()}
            for e in effects
        ],
        "numbers": [e.get("parameters", {}) for e in effects],
        "set_aside": sorted(int(e["shot"]) for e in stated.get("set_aside", [])),
        "slot": stated["slot"],
        "also_slots": stated["also_possible_slots"],
        "p_value": stated["p_value"],
        "visible": seen.together if seen else None,
        "visible_each": seen.each if seen else [],
        "visible_seen": max((e["gain"] - e["numbers"] for e in evidence), default=None),
        "excess_seen": (before["chi2_per_dof"] - 1.0) * before["degrees_of_freedom"],
        "noise_V": stated["noise_rms_V"],
        "heldout_before_V": before["heldout_rms_V"],
        "heldout_after_V": after["heldout_rms_V"],
        "modulus": {
            "before": _of_specimen(before, "youngs_modulus_Pa"),
            "after": _of_specimen(after, "youngs_modulus_Pa"),
        },
        "plane": {
            "before": _of_specimen(before, "plane_strain_modulus_Pa"),
            "after": _of_specimen(after, "plane_strain_modulus_Pa"),
        },
        "seconds": clock.judged[0] - clock.started[0],
        "cpu_seconds": clock.judged[1] - clock.started[1],
        "statement_seconds": ended - clock.judged[0],
        "ended_early": stated.get("ended_early") is not None,
    }


def _is_the_rigs_own_law(effect: Json, plan: Plan) -> bool:
    """Tell whether a named effect is how a drawn rig's contact loses energy, which is no effect.

    Or may be: a family says so of each of its names.
    """
    if rig_model(plan.rig, plan.campaign_seed).loss == PAPER.loss:
        return False
    said = {effect["id"], *effect.get("confusable_with", [])}
    return LOSS_LAW in said and effect["id"] not in {e.id for e in plan.effects}


def where(effect: Json) -> Json:
    """Return where a named effect or mistake acts, in the truth's words.

    Parameters
    ----------
    effect : dict
        One of a diagnosis' ``effects``.

    Returns
    -------
    dict
        As in ``Trial.acts_on``.
    """
    if effect["slot"] == RECORD_SLOT:
        first = effect.get("parameters", {}).get("first_shot")
        return dict(effect["scope"]) | ({} if first is None else {"first_shot": first["value"]})
    return _materials(effect["acts_on"])


def _materials(said: Json | None) -> Json:
    """Return materials of a document in the truth's words; nothing of all."""
    if said is None:
        return {}
    names = said["names"]
    return {said["kind"]: names[0] if len(names) == 1 else names}


def _of_specimen(block: Json, quantity: str) -> Json | None:
    """Return a block's modulus of the specimen, None where it is withheld."""
    entry = block["moduli"].get(SPECIMEN, {})
    found: Json | None = entry.get(quantity)
    return found
