"""From one recording to shots: channel, unit, rate, and the windows around its hits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from impactd.importing.choices import ALL, Ask, Choices
from impactd.importing.errors import RecordingError
from impactd.importing.hits import Found, Hit, find_hits
from impactd.importing.recording import Channel, Recording
from impactd.importing.units import (
    STANDARD_GRAVITY_M_PER_S2,
    TIME_FACTORS,
    Unit,
    find_time_unit,
    find_unit,
)
from impactd.storage import ranges
from impactd.storage.campaign_shot import MIN_SAMPLES

LEAST_SAG_M = 1e-3
"""A body that a spring stops within a contact of duration T = pi sqrt(m/k) rests on that spring
g T^2 / pi^2 deep. Nothing that rests a millimetre deep in its own contact is a hit on a solid;
where the times say so, they are rather milliseconds taken for seconds. [m]"""
LONGEST_CONTACT_S = math.pi * math.sqrt(LEAST_SAG_M / STANDARD_GRAVITY_M_PER_S2)
"""31.7 ms. [s]"""
FEW_SAMPLES = 8
"""Of a contact: of a half-sine sampled more coarsely the peak is missed by up to 2 %."""
_UNITS = ("V", "N", "g", "m/s2", "strain")


@dataclass(frozen=True)
class Cut:
    """One shot, cut out of a recording. Values without a unit are in that of ``unit.quantity``."""

    name: str
    """As results call it."""
    file: str
    """Where it comes from."""
    samples: NDArray[np.float64]
    """Shape (n,)."""
    rate_hz: float
    u_rate_hz: float
    unit: Unit
    hit: Hit
    """Its place, in samples of the recording."""
    record: NDArray[np.float64]
    """The whole of the trace, shape (m,)."""
    threshold: float
    noise: float
    step: float | None
    """Of the converter."""

    @property
    def trigger_index(self) -> int:
        """Sample of the shot at which the contact begins."""
        return self.hit.touch - self.hit.first

    @property
    def begins_s(self) -> float:
        """When the contact begins, from the start of the recording. [s]"""
        return self.hit.touch / self.rate_hz

    @property
    def contact_s(self) -> float:
        """Duration of the first impact. [s]"""
        return self.hit.contact / self.rate_hz


def cut_hits(
    recording: Recording, stem: str, choices: Choices, ask: Ask, said: list[str]
) -> list[Cut]:
    """Return the shots of a recording in order of time, none where nothing rises above the noise.

    Parameters
    ----------
    stem : str
        What the shots' names begin with.
    ask : Ask
        Asks, or takes the proposal.
    said : list of str
        Gets a sentence for each assumption.

    Raises
    ------
    RecordingError
        If rate, unit or column cannot be known.
    """
    said.extend(recording.assumed)
    channels = _channels(recording, choices, ask, said)
    made: list[Cut] = []
    traces = 0
    for channel in channels:
        unit = _unit(recording, channel, choices, ask, said)
        rate_hz, u_rate_hz = _rate(recording, choices, said)
        found = [
            _find(recording, place, channel, trace, unit=unit, choices=choices, said=said)
            for place, trace in enumerate(channel.traces)
        ]
        factor = unit.factor * choices.scale
        named = stem if len(channels) == 1 else f"{stem} {channel.name}"
        for place, (trace, one) in enumerate(zip(channel.traces, found, strict=True)):
            traces += 1
            label = named if len(channel.traces) == 1 else f"{named} row {place + 1}"
            record = trace * factor
            for number, hit in enumerate(one.hits, start=1):
                name = label if len(one.hits) == 1 else f"{label} hit {number}"
                made.append(
                    Cut(
                        name,
                        recording.file,
                        record[hit.first : hit.stop],
                        rate_hz,
                        u_rate_hz,
                        unit,
                        hit,
                        record,
                        one.threshold,
                        one.noise,
                        None if channel.step is None else channel.step * abs(factor),
                    )
                )
    if not made:
        return made
    made = _checked_times(recording, made, choices, ask, said)
    _refuse_rate(recording, made[0].rate_hz)
    return made


def _channels(recording: Recording, choices: Choices, ask: Ask, said: list[str]) -> list[Channel]:
    """Return the channels that are wanted."""
    there = recording.channels
    listed = ", ".join(f"{one.number} {one.name!r}" for one in there)
    if not choices.columns:
        if len(there) == 1:
            return [there[0]]
        picked = ask(
            f"Which column of {recording.file} is the signal?",
            [str(one.number) for one in there],
            str(there[0].number),
        )
        chosen = _named(recording, picked, listed)
        said.append(
            f"{recording.file}: {chosen.name!r} is taken for the signal; there: {listed} "
            "(--column says another, --column all takes each)."
        )
        return [chosen]
    if choices.columns == (ALL,):
        return list(there)
    return [_named(recording, wanted, listed) for wanted in choices.columns]


def _named(recording: Recording, wanted: str, listed: str) -> Channel:
    """Return the channel of a name or number; a name counts before a number."""
    plain = wanted.strip().lower()
    for one in recording.channels:
        if plain in (one.name.lower(), one.name.lower().rpartition("/")[2]):
            return one
    for one in recording.channels:
        if plain.isdigit() and one.number == int(plain):
            return one
    raise RecordingError(recording.file, f"has no signal column {wanted!r}.", f"There: {listed}.")


def _unit(
    recording: Recording, channel: Channel, choices: Choices, ask: Ask, said: list[str]
) -> Unit:
    """Return the unit as stated by the options, the file, or an answer."""
    stated = choices.unit or channel.unit
    unit = find_unit(stated)
    if choices.unit is not None and unit is None:
        raise RecordingError(
            "--unit", f"{choices.unit!r} is unknown.", f"Give one of {', '.join(_UNITS)}."
        )
    if unit is None:
        told = f"in {stated!r}, which is no unit we know" if stated else "without a unit"
        answer = ask(f"{recording.file} is {told}. Its numbers are of", _UNITS, "V")
        unit = find_unit(answer) or Unit("voltage", 1.0)
        said.append(
            f"{recording.file}: {channel.name!r} is {told}; taken for {answer} "
            "(--unit says another)."
        )
    elif choices.unit is None:
        said.append(f"{recording.file}: {channel.name!r} is in {stated}, as the file states.")
    if unit.said is not None:
        said.append(unit.said)
    if unit.quantity == "acceleration_m_per_s2" and unit.factor != 1.0:
        said.append(f"1 g is {STANDARD_GRAVITY_M_PER_S2} m/s^2.")
    return unit


def _rate(recording: Recording, choices: Choices, said: list[str]) -> tuple[float, float]:
    """Return the sampling rate and its standard uncertainty. [Hz]"""
    rate, u_rate = recording.rate_hz, recording.u_rate_hz
    if recording.has_times and rate is not None and choices.time_unit is not None:
        factor = TIME_FACTORS[recording.time_unit or "s"] / TIME_FACTORS[choices.time_unit]
        rate, u_rate = rate * factor, u_rate * factor
    if choices.rate_hz is not None:
        _refuse_rate(recording, choices.rate_hz)  # before anything is divided by it
        if rate is not None and not math.isclose(rate, choices.rate_hz, rel_tol=0.01):
            said.append(
                f"{recording.file}: the file says {rate:g} Hz; --rate says {choices.rate_hz:g} Hz, "
                "which is used."
            )
        rate, u_rate = choices.rate_hz, 0.0
    if rate is None:
        raise RecordingError(
            recording.file,
            "does not say how fast it was sampled: it has no times and no rate.",
            "Give --rate HZ, the samples a second; it stands in the settings of the instrument.",
        )
    return rate, u_rate


def _refuse_rate(recording: Recording, rate_hz: float) -> None:
    limits = ranges.SAMPLE_RATE_HZ
    if not limits.low <= rate_hz <= limits.high:
        raise RecordingError(
            recording.file,
            f"would be sampled at {rate_hz:g} Hz; it must be {limits}.",
            "Give the unit of its times with --time s, ms, us or ns, or --rate HZ.",
        )


def _find(
    recording: Recording,
    place: int,
    channel: Channel,
    trace: NDArray[np.float64],
    *,
    unit: Unit,
    choices: Choices,
    said: list[str],
) -> Found:
    """Return the hits of one trace, in the unit that is stored."""
    factor = unit.factor * choices.scale
    where = recording.file
    if len(channel.traces) > 1:
        where += f", row {place + 1}"
    bad = np.flatnonzero(~np.isfinite(trace))
    if bad.size:
        raise RecordingError(
            where,
            f"holds NaN or infinity, first at sample {bad[0]}.",
            "Cut the file there, or fill the gap: a fit needs every sample.",
        )
    if trace.size < MIN_SAMPLES:
        raise RecordingError(
            where, f"has {trace.size} samples; {MIN_SAMPLES} are needed.", "Record for longer."
        )
    if trace.min() == trace.max():
        said.append(f"{where}: every sample is {trace[0]:g}; it is left out.")
        return Found((), 0.0, 0.0, 0, 0.0)
    threshold = None if choices.threshold is None else choices.threshold * unit.factor
    step = None if channel.step is None else channel.step * abs(factor)
    found = find_hits(trace * factor, step=step, threshold=threshold)
    if found.begun:
        said.append(f"{where}: the recording begins within a hit, which is left out.")
    elif not found.hits:
        said.append(
            f"{where}: no sample exceeds {found.threshold:.3g} (the largest excursion is "
            f"{found.largest:.3g}, the noise {found.noise:.3g}); it is left out."
        )
    return found


def _checked_times(
    recording: Recording, made: list[Cut], choices: Choices, ask: Ask, said: list[str]
) -> list[Cut]:
    """Return the shots, with times in another unit where seconds make no sense."""
    contact_s = float(np.median([one.contact_s for one in made]))
    known = choices.time_unit is not None or choices.rate_hz is not None or not recording.has_times
    if known or contact_s <= LONGEST_CONTACT_S:
        return made
    likely = "ms" if contact_s * 1e-3 >= 1e-6 and contact_s < 1e3 * LONGEST_CONTACT_S else "us"
    stated = recording.time_unit or "s"
    if find_time_unit(likely) == stated:
        return made
    long = f"{contact_s:.3g} s"
    short = f"{contact_s * TIME_FACTORS[likely]:.3g} s"
    answer = ask(
        f"With times in {stated} a contact in {recording.file} lasts {long}; in {likely} it lasts "
        f"{short}. The times are in",
        tuple(TIME_FACTORS),
        "",
    )
    if not answer:
        raise RecordingError(
            recording.file,
            f"has contacts of {long} with its times in {stated}; a hit on a solid ends within "
            f"{LONGEST_CONTACT_S * 1e3:.0f} ms. Its times are probably in {likely} "
            f"(contacts of {short}).",
            f"Say --time {likely}, or --time {stated} if it is as it stands.",
        )
    said.append(f"{recording.file}: times are in {answer}, as was answered.")
    factor = TIME_FACTORS[stated] / TIME_FACTORS[answer]
    return [
        Cut(**{**vars(one), "rate_hz": one.rate_hz * factor, "u_rate_hz": one.u_rate_hz * factor})
        for one in made
    ]


def names_of(files: Sequence[str]) -> list[str]:
    """Return a name for the shots of each file: its stem, or all of it where stems repeat."""
    stems = [
        name.removesuffix(".gz").rpartition("/")[2].rpartition(".")[0] or name for name in files
    ]
    return [
        stem if stems.count(stem) == 1 else name for stem, name in zip(stems, files, strict=True)
    ]
