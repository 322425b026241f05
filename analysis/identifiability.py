r"""The identifiability report: which numbers the shots determine, and which the priors.

With the priors' precision P and the posterior covariance C of the globals, the Fisher information
of the shots is :math:`F = C^{-1} - P`. For any quantity with gradient g

.. math:: u^2 = g C g, \quad u_{prior}^2 = g P^{-1} g,
   \quad u_{shots}^{-2} = u^{-2} - u_{prior}^{-2}

u over u_prior near 1 means that the shots said nothing about it. With gain, frequency and damping
known, each stated value of M, k, mu, c tells the one direction that is left; for these u_prior is
what the four statements together say about it, or the certificates would count as the shots' work.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.aliases import Array, Json
from analysis.fit.joint import Fitted
from analysis.fit.priors import SEEN, UNKNOWN_LOG_U
from analysis.fit.problem import JointProblem
from analysis.fit.profile import Profile, profile
from analysis.fit.shot_fit import ShotFit
from analysis.fit.statements import WITHHOLD_ABOVE
from analysis.identifiability_words import (
    NEVER,
    Asked,
    Split,
    alone_sentence,
    network_sentence,
    nu_sentence,
    quantity_sentence,
    short_sentence,
    split_sentence,
)
from analysis.parameters import CRYSTAL, FREQUENCY
from analysis.quantities_of_fit import asked_of

__all__ = ["Finding", "Identifiability", "identifiability", "short_contacts"]


PRIOR_ABOVE = 0.7
"""Posterior over prior u, above which the shots said little."""
SHOTS_BELOW = 0.3
"""Posterior over prior u, below which the shots decide."""
NO_PRIOR_U = 1.0
"""A logarithm known no better than this, a factor of e either way, counts as not known before."""
SPLIT_OPEN_ABOVE = 0.5
"""u of ln(E'_sphere / E'_surface), their own priors taken away, above which nothing splits them."""
STRONG_CORRELATION = 0.95
SHORT_CONTACT_PERIODS = 0.5
"""A contact shorter than this share of the crystal's period hardly shows the contact law."""


@dataclass(frozen=True)
class Finding:
    """What a fit determines of one quantity, and from which source."""

    asked: Asked
    u: float
    """Standard uncertainty of its logarithm (of an effect: of its coordinate). [1]"""
    u_prior: float | None
    """Before the fit; None where nothing was known."""
    u_shots: float | None
    """What the shots alone would give; None where they say nothing."""
    status: str
    """``shots``, ``both``, ``prior`` or ``not_identifiable``."""

    def to_json(self) -> Json:
        """Return the finding as part of ``impactd-fit/1``."""
        return {
            "name": self.asked.name,
            "status": self.status,
            "u": self.u,
            "u_prior": self.u_prior,
            "u_shots": self.u_shots,
            "posterior_over_prior": None if self.u_prior is None else self.u / self.u_prior,
            "sentence": quantity_sentence(self.asked, self.u, self.u_prior, self.status),
        }


@dataclass(frozen=True)
class Identifiability:
    """The report."""

    findings: tuple[Finding, ...]
    """Identifiable combinations first."""
    splits: tuple[Split, ...]
    poisson: tuple[tuple[str, float], ...]
    """Material and what its stated ratio adds to u(ln E)."""
    short: dict[str, float]
    """Contact time in crystal periods, of the pairs whose contact is too short."""
    names: tuple[str, ...]
    """Globals, in the order of the matrices."""
    information: Array
    """Fisher information of the shots, their own parameters eliminated. Shape (g, g)."""
    correlation: Array
    """Of the posterior. Shape (g, g)."""
    profiles: tuple[Profile, ...] = ()

    def finding(self, name: str) -> Finding:
        """Return what is known of one quantity; KeyError where it was not asked."""
        for one in self.findings:
            if one.asked.name == name:
                return one
        raise KeyError(name)

    def sentences(self) -> list[str]:
        """Return the report as a technician reads it."""
        found, of_cell = [], False
        for f in self.findings:
            if set(f.asked.pairs) & set(self.short) and f.status == "not_identifiable":
                continue  # the pair's own sentence says why
            if f.asked.kind == "alone":
                if not of_cell:
                    found.append(alone_sentence(f.u, f.u_prior, f.status))
                of_cell = True
                continue
            found.append(quantity_sentence(f.asked, f.u, f.u_prior, f.status))
        found.extend(short_sentence(pair, share) for pair, share in self.short.items())
        found.extend(split_sentence(s) for s in self.splits if s.determined_by != "network")
        told = [s.pair for s in self.splits if s.determined_by == "network"]
        if told:
            found.append(network_sentence(told))
        if self.poisson:
            found.append(nu_sentence(self.poisson))
        return found

    def correlated(self) -> list[tuple[str, str, float]]:
        """Return the pairs of globals that the data hardly distinguish."""
        size = len(self.names)
        return [
            (self.names[i], self.names[j], float(self.correlation[i, j]))
            for i in range(size)
            for j in range(i + 1, size)
            if abs(self.correlation[i, j]) > STRONG_CORRELATION
        ]

    def to_json(self) -> Json:
        """Return the report as ``identifiability`` of ``impactd-fit/1``."""
        return {
            "quantities": [f.to_json() for f in self.findings],
            "splits": [
                {
                    "pair": s.pair,
                    "u_without_their_priors": s.u_open,
                    "determined_by": s.determined_by,
                    "sentence": split_sentence(s),
                }
                for s in self.splits
            ],
            "poissons_ratio": {
                "status": NEVER,
                "u_ln_modulus": dict(self.poisson),
                "sentence": nu_sentence(self.poisson) if self.poisson else None,
            },
            "short_contacts": [
                {"pair": p, "contact_in_crystal_periods": x, "sentence": short_sentence(p, x)}
                for p, x in self.short.items()
            ],
            "fisher_information": {
                "of": "natural logarithms of",
                "names": list(self.names),
                "matrix": self.information.tolist(),
            },
            "correlation": self.correlation.tolist(),
            "strongly_correlated": [list(x) for x in self.correlated()],
            "profiles": [_profile_json(p) for p in self.profiles],
            "sentences": self.sentences(),
        }


def _profile_json(found: Profile) -> Json:
    return {
        "name": found.name,
        "at": found.at.tolist(),
        "rise": found.rise.tolist(),
        "interval95": [found.low, found.high],
    }


def short_contacts(shots: Sequence[ShotFit], frequency_hz: float | None) -> dict[str, float]:
    """Return by pair the median contact time in crystal periods, where it is short."""
    by_pair: dict[str, list[float]] = {}
    for s in shots:
        by_pair.setdefault(s.item.pair, []).append(s.contact_time_s)
    if frequency_hz is None:
        return {}
    typical = {pair: float(np.median(times)) * frequency_hz for pair, times in by_pair.items()}
    return {pair: share for pair, share in typical.items() if share < SHORT_CONTACT_PERIODS}


def crystal_frequency_hz(problem: JointProblem, fitted: Fitted) -> float | None:
    """Return the crystal's frequency as fitted, else as stated; None if neither exists. [Hz]"""
    j = problem.index(FREQUENCY)
    if j is not None:
        return math.exp(problem.value_of(FREQUENCY, fitted.theta)) / (2 * math.pi)
    sensor = problem.campaign.sensor
    k, mass = sensor.crystal_stiffness_n_per_m, sensor.crystal_mass_kg
    return math.sqrt(k.value / mass.value) / (2 * math.pi) if k and mass else None


def identifiability(
    problem: JointProblem,
    fitted: Fitted,
    shots: Sequence[ShotFit],
    *,
    profiled: Sequence[str] = (),
) -> Identifiability:
    """Return which quantities the shots fix and which rest on what was stated.

    ``profiled`` are globals whose profile likelihood is wanted; each costs some five further fits.
    Source: Fisher information of a Gaussian likelihood, in the logarithms the fit works in; where
    the profile is no parabola it is more reliable. Validation: brute-force profiles and rigs of one
    pair in ``tests/analysis/test_identifiability.py``.
    """
    prior = np.linalg.inv(problem.prior_precision + 1e-6 * np.eye(len(problem.names)))
    short = short_contacts(shots, crystal_frequency_hz(problem, fitted))
    findings = []
    for asked in asked_of(problem, fitted):
        u = math.sqrt(max(float(asked.gradient @ fitted.covariance @ asked.gradient), 0.0))
        before = math.sqrt(float(asked.gradient @ prior @ asked.gradient))
        if asked.kind == "alone":
            mass = problem.names.index(CRYSTAL)
            before = float(problem.prior_precision[mass, mass]) ** -0.5
        unseen = bool(asked.pairs) and all(pair in short for pair in asked.pairs)
        findings.append(_finding(asked, u, before, short=unseen))
    width = np.sqrt(np.diag(fitted.covariance))
    return Identifiability(
        findings=tuple(findings),
        splits=tuple(_splits(problem, fitted)),
        poisson=tuple(_poisson(problem)),
        short=short,
        names=tuple(problem.names),
        information=np.linalg.inv(fitted.covariance) - problem.prior_precision,
        correlation=fitted.covariance / np.outer(width, width),
        profiles=tuple(profile(problem, fitted, name) for name in profiled),
    )


def _finding(asked: Asked, u: float, before: float, *, short: bool) -> Finding:
    gained = max(u**-2 - before**-2, 0.0)
    # a gain below rounding of the two is none
    u_shots = gained**-0.5 if gained > 1e-6 * before**-2 else None
    ratio = u / before
    known = before < NO_PRIOR_U or asked.name == SEEN
    if short or (not known and (ratio > PRIOR_ABOVE or (asked.log and u > WITHHOLD_ABOVE))):
        status = "not_identifiable"
    elif known and ratio > PRIOR_ABOVE:
        status = "prior"
    else:
        status = "shots" if ratio < SHOTS_BELOW else "both"
    return Finding(asked, u, before if known else None, u_shots, status)


def _splits(problem: JointProblem, fitted: Fitted) -> list[Split]:
    """Return, for every pair, whether anything but their own statements tells its moduli apart."""
    information = np.linalg.inv(fitted.covariance)
    found: dict[str, Split] = {}
    for item in problem.shots:
        keys = problem.material_keys(item)
        if keys is None or item.pair in found:
            continue
        i, j = (problem.names.index(key) for key in keys)
        free = information.copy()
        stated = []
        for at, key in ((i, keys[0]), (j, keys[1])):
            own = problem.prior_precision[at, at]
            free[at, at] += UNKNOWN_LOG_U**-2 - own
            if own > NO_PRIOR_U**-2:
                stated.append(key.owner)
        covariance = np.linalg.inv(free)
        u = math.sqrt(max(covariance[i, i] + covariance[j, j] - 2 * covariance[i, j], 0.0))
        by = "network" if u < SPLIT_OPEN_ABOVE else "stated" if stated else "nothing"
        found[item.pair] = Split(keys[0].owner, keys[1].owner, u, by, tuple(stated))
    return list(found.values())


def _poisson(problem: JointProblem) -> list[tuple[str, float]]:
    found = []
    campaign = problem.campaign
    for name in problem.names:
        if not name.is_modulus:
            continue
        material = (campaign.spheres if name.kind == "sphere" else campaign.surfaces)[name.owner]
        nu = material.poissons_ratio
        if nu is not None:
            found.append((name.owner, 2 * nu.value * nu.u / (1 - nu.value**2)))
    return sorted(dict(found).items())
