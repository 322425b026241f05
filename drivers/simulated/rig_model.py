"""The physics of a simulated rig: the paper's, the closed one, or a draw.

``paper`` is Maranzano & Hancock 2016 as printed. ``closed`` keeps Newton's third law between sphere
and crystal, lets the coupon ride on the crystal, ends a contact when its force does, and lets the
sphere fall through air. ``drawn`` draws each of these choices, and forms of the laws that no
analysis needs to know.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from drivers.simulated import impact_kernel as kernel

DEFAULT_RIG = "closed"
"""What a rig is that says nothing of it; the one line to change."""

LIFT_OFF = {"indentation": kernel.AT_INDENTATION, "force": kernel.AT_FORCE}
LOSS = {
    "tsuji": kernel.TSUJI,
    "kuwabara_kono": kernel.KUWABARA_KONO_LOSS,
    "hunt_crossley": kernel.HUNT_CROSSLEY_LOSS,
}


@dataclass(frozen=True)
class RigModel:
    """The physics of a rig, apart from its numbers and its effects."""

    third_law: bool
    """The dashpot's reaction loads the crystal."""
    coupon_rides: bool
    """The coupon's mass moves with the crystal."""
    lift_off: str
    """``"indentation"``: contact ends with the indentation (Eq. 6 of the paper); ``"force"``: with
    the force (Schwager & Poeschel, Phys. Rev. E 78 (2008) 051304; Ting, J. Appl. Mech. 33 (1966)
    845, for a relaxing body)."""
    loss: str
    """``"tsuji"``: alpha sqrt(m K) delta^(1/4) delta' (Tsuji, Tanaka & Ishida 1992; Eq. 3 of the
    paper); ``"kuwabara_kono"``: (3/2) A K delta^(1/2) delta' (1987); ``"hunt_crossley"``: chi K
    delta^(3/2) delta' (1975)."""
    drag: str
    """``"none"``: no air; else a form of the drag coefficient in `fall`."""
    added_mass: float = 0.0
    """Part of the displaced air's mass that moves with the sphere."""

    def to_json(self) -> dict[str, object]:
        """Return the choices as the sealed truth states them."""
        return asdict(self)


PAPER = RigModel(False, False, "indentation", "tsuji", "none")
CLOSED = RigModel(True, True, "force", "tsuji", "schiller_naumann")
RIGS = ("paper", "closed", "drawn")
"""Names that `rig_model` knows."""

PAPERS_SHARE = 0.25
"""How often a drawn rig leaves a law of mechanics out as the paper does: often enough to be seen in
a table of some hundred rigs, seldom enough that most rigs are physical."""


def rig_model(name: str, seed: int) -> RigModel:
    """Return the physics of a rig, one of `RIGS`, else raise ValueError.

    The rig's seed matters for ``drawn`` only.
    """
    if name == "paper":
        return PAPER
    if name == "closed":
        return CLOSED
    if name != "drawn":
        raise ValueError(f"A rig is {', '.join(RIGS)}, not {name!r}.")
    rng = np.random.default_rng([seed, 5])
    return RigModel(
        third_law=bool(rng.random() >= PAPERS_SHARE),
        coupon_rides=bool(rng.random() >= PAPERS_SHARE),
        lift_off=str(rng.choice(["force", "indentation"], p=[1.0 - PAPERS_SHARE, PAPERS_SHARE])),
        loss=str(rng.choice(list(LOSS))),
        drag=str(rng.choice(["schiller_naumann", "brown_lawler"])),
        added_mass=float(rng.choice([0.0, 0.5])),
    )
