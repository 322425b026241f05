"""From files to a campaign folder: read, find the hits, write, draw."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from analysis.campaign import Campaign, Shot, Uncertainty
from impactd.importing.choices import Ask, Choices, propose
from impactd.importing.cutting import FEW_SAMPLES, Cut, cut_hits, names_of
from impactd.importing.errors import RecordingError
from impactd.importing.hits import AFTER_CONTACTS, BEFORE_CONTACTS
from impactd.importing.picture import save_picture
from impactd.importing.readers import read_recording
from impactd.importing.stated_values import read_drops, read_values, state
from impactd.storage.campaign_folder import (
    JSON_NAME,
    STANDARD_GRAVITY_M_PER_S2,
    write_campaign,
)

PICTURE_NAME = "recordings.png"
_NAMED = 4
"""Files in a sentence."""
_MOST_VOLTS = 100.0
"""A choice: digitizers end at some tens of volts. [V]"""
UNKNOWN = (
    "These values are unknown and left out: the body that fell or hit (radius, mass, modulus), "
    "the surface (modulus, thickness), the drop height, and the sensor. Give what you have "
    "measured with --values, or write it into campaign.json; `impactd schema campaign` lists the "
    f"keys. gravity_m_per_s2 has its standard value, {STANDARD_GRAVITY_M_PER_S2}."
)


@dataclass(frozen=True)
class Made:
    """A campaign folder that was made from recordings."""

    path: Path
    """The ``campaign.json``."""
    picture: Path
    """The shots that were cut out, to look at."""
    shots: tuple[Cut, ...]
    said: tuple[str, ...]
    """What was assumed, a sentence each."""

    def shots_to_json(self) -> list[dict[str, object]]:
        """Return what is to be known of each shot."""
        return [
            {
                "name": one.name,
                "file": one.file,
                "quantity": one.unit.quantity,
                "sample_rate_Hz": one.rate_hz,
                "trigger_index": one.trigger_index,
                "starts_s": one.begins_s,
                "peak": one.hit.peak,
                "contact_s": one.contact_s,
                "blows": one.hit.impacts,
                "remark": remark(one),
            }
            for one in self.shots
        ]


def remark(one: Cut) -> str:
    """Return what a person should look at in a shot, empty where there is nothing."""
    if one.hit.impacts > 1:
        return f"{one.hit.impacts} hits kept in one shot"
    if one.unit.quantity == "voltage" and one.hit.peak > _MOST_VOLTS:
        return "volts, or mV? (--unit mV)"
    return "few samples in the contact" if one.hit.contact < FEW_SAMPLES else ""


def make_campaign(
    files: Sequence[str], out: Path, choices: Choices | None = None, ask: Ask = propose
) -> Made:
    """Write the hits of recordings as a campaign folder.

    Parameters
    ----------
    files : sequence of str
        In order of time; ``FILE.h5:/path`` names a dataset.
    out : Path
        A folder that holds no campaign; made when absent.
    ask : Ask, optional
        Asks a person; without it the proposals are taken.

    Raises
    ------
    RecordingError
        If a file cannot be read, or none holds a hit.
    ArchiveError
        If the folder cannot be written.
    """
    choices = choices or Choices()
    refuse_taken(out)
    values = read_values(choices.values) if choices.values else {}
    drops = read_drops(choices.drops) if choices.drops else {}
    said: list[str] = []
    cuts: list[Cut] = []
    for name, stem in zip(files, names_of(files), strict=True):
        cuts += cut_hits(read_recording(name), stem, choices, ask, said)
    if not cuts:
        raise RecordingError(
            f"{files[0]}:" if len(files) == 1 else f"{len(files)} files:",
            f"no hit was found. {' '.join(dict.fromkeys(said[-3:]))}",
            "Choose another --column, or give a lower --threshold.",
        )
    refuse_taken(out, len(cuts))
    said.append(_rule(cuts, choices.threshold))
    if choices.values is None:
        said.append(UNKNOWN)
    told = _together(said)
    campaign = Campaign(shots=tuple(_shot(one) for one in cuts))
    path = write_campaign(
        out, campaign, assumptions=told, sources=tuple(_source(one) for one in cuts)
    )
    stated_in = [str(file) for file in (choices.values, choices.drops) if file is not None]
    if stated_in:
        try:
            state(path, values, drops, " and ".join(stated_in))
        except RecordingError:
            for one in written_names(len(cuts)):
                (out / one).unlink(missing_ok=True)
            raise
    picture = out / PICTURE_NAME
    save_picture(cuts, picture)
    return Made(path, picture, tuple(cuts), told)


def _together(said: Sequence[str]) -> tuple[str, ...]:
    """Return each sentence once, with all the files that it is true of."""
    files: dict[str, list[str]] = {}
    for one in said:
        file, colon, rest = one.partition(": ")
        known = files.setdefault(rest if colon else one, [])
        if colon and file not in known:
            known.append(file)
    return tuple(
        f"{few(names)}: {sentence}" if names else sentence for sentence, names in files.items()
    )


def few(names: Sequence[str]) -> str:
    """Return the first names of a list, and how many more there are."""
    shown = ", ".join(names[:_NAMED])
    return shown if len(names) <= _NAMED else f"{shown} and {len(names) - _NAMED} more"


def refuse_taken(out: Path, count: int = 0) -> None:
    """Raise RecordingError where a file of a folder with so many shots exists already."""
    taken = [name for name in written_names(count) if (out / name).exists()]
    if taken:
        raise RecordingError(
            str(out),
            f"holds {taken[0]} already, and nothing is overwritten.",
            "Give another --out.",
        )


def written_names(count: int) -> list[str]:
    """Return the files of a folder with so many shots."""
    return [JSON_NAME, PICTURE_NAME, *(f"shot{at:03d}.npy" for at in range(count))]


def _rule(cuts: Sequence[Cut], threshold: float | None) -> str:
    double = sum(one.hit.impacts > 1 for one in cuts)
    together = f" Of them {double} with more than one hit." if double else ""
    cut = ""
    if any(one.hit.first > 0 for one in cuts):
        cut = (
            f" Where a record is much longer than a hit, {BEFORE_CONTACTS} contact times before it "
            f"and {AFTER_CONTACTS} after it are kept."
        )
    by = "a twentieth of the largest excursion of its recording, and by more than noise does"
    if threshold is not None:
        by = f"{threshold:g}, as --threshold says"
    return (
        f"Shots: {len(cuts)}, where the signal leaves its baseline by more than {by}; hits "
        f"without a pause between them stay in one shot.{together}{cut} trigger_index is where "
        "a contact reaches a twentieth of its peak."
    )


def _source(one: Cut) -> dict[str, object]:
    """Return where a shot comes from, as keys of its object."""
    return {"source_file": one.file, "source_first_sample": one.hit.first}


def _shot(one: Cut) -> Shot:
    return Shot(
        name=one.name,
        signal=one.samples,
        sample_rate_hz=one.rate_hz,
        trigger_index=one.trigger_index,
        quantity=one.unit.quantity,
        quantum=one.step,
        u_sample_rate_hz=Uncertainty(one.u_rate_hz) if one.u_rate_hz else None,
    )
