"""Campaign folders (``impactd-campaign/1``): ``campaign.json`` and one file per shot beside it.

What is wrong with the folder as a whole (format, materials, sensor) raises `CampaignError`; what is
wrong with one shot puts that shot into ``campaign.rejected`` and the rest goes on. Both name file,
JSON path and reason.
"""

from __future__ import annotations

import json
import os
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from analysis.campaign import Campaign, Rejected, Sensor, Sphere, Surface, Uncertainty
from analysis.written_numbers import counted
from impactd.storage import ranges
from impactd.storage.campaign_shot import SHOT_KEYS, CampaignShot, read_campaign_shot, shot_to_json
from impactd.storage.errors import ArchiveError, CampaignError
from impactd.storage.json_fields import Fields, read_json
from impactd.storage.materials_json import (
    ENVIRONMENT_KEYS,
    SENSOR_KEYS,
    SPHERE_KEYS,
    SURFACE_KEYS,
    environment_from_json,
    environment_to_json,
    measured_to_json,
    sensor_from_json,
    sensor_to_json,
    sphere_from_json,
    sphere_to_json,
    surface_from_json,
    surface_to_json,
)
from impactd.storage.publish import publish
from impactd.storage.recording_files import RECORDING_ENDINGS, find_recordings
from impactd.storage.sample_file import write_samples
from impactd.storage.shot_metadata import Recording

FORMAT = "impactd-campaign/1"
JSON_NAME = "campaign.json"
STANDARD_GRAVITY_M_PER_S2 = 9.80665
RELEASE_KEYS = (
    "speed_repeatability",
    "height_offset_u_m",
    "distribution",
    "degrees_of_freedom",
    "traceable_to",
)
CAMPAIGN_KEYS = (
    "format",
    "gravity_m_per_s2",
    "release",
    "sample_rate_u_relative",
    "environment",
    "sensor",
    "calibration",
    "spheres",
    "surfaces",
    "assumptions",
    "shots",
)
CALIBRATION_KEYS = ("number", "model", "finished_utc", "valid_until_utc", "sensor")


@dataclass(frozen=True)
class CampaignFolder:
    """A folder as read: the campaign, and its raw samples."""

    campaign: Campaign
    """As the analysis sees it: with the calibrated cell where the folder carries one."""
    shots: tuple[CampaignShot, ...]
    """The shots of ``campaign``, in the same order."""
    certificate: Sensor
    """What was known of the load cell before any calibration."""


def read_campaign(path: Path, *, calibrated: bool = True) -> Campaign:
    """Return a campaign folder as the analysis sees it, refused shots under ``rejected``.

    Parameters
    ----------
    path : Path
        The folder or its ``campaign.json``.
    calibrated : bool
        Whether the load cell is the one of the folder's ``calibration``, as a fit wants it. A
        diagnosis starts from the certificate: a calibration made under the model in question
        would vouch for it.

    Raises
    ------
    CampaignError
        If the folder cannot be used as a whole, or none of its shots can.
    """
    folder = read_campaign_folder(path)
    return folder.campaign if calibrated else replace(folder.campaign, sensor=folder.certificate)


def load_campaign(path: str | os.PathLike[str]) -> Campaign:
    """Return a campaign folder; what `analysis.load_campaign` calls. See `read_campaign`."""
    return read_campaign(Path(path))


def read_campaign_folder(path: Path) -> CampaignFolder:
    """Return a campaign folder with its raw samples; see `read_campaign`."""
    file = path / JSON_NAME if path.is_dir() else path
    _refuse_recordings(path, file)
    root = Fields(read_json(file), file=str(file), known=CAMPAIGN_KEYS)
    if root.text("format") != FORMAT:
        root.refuse("format", f"is {root.value('format')!r}; this program reads {FORMAT!r}.")
    gravity, u_gravity = root.measured("gravity_m_per_s2", ranges.GRAVITY_M_PER_S2)
    release = root.child("release", known=RELEASE_KEYS)
    certificate = sensor_from_json(root.child("sensor", known=SENSOR_KEYS))
    header = Campaign(
        shots=(),
        spheres=_spheres(root),
        surfaces=_surfaces(root),
        sensor=_calibrated(root) or certificate,
        gravity_m_per_s2=STANDARD_GRAVITY_M_PER_S2 if gravity is None else gravity,
        speed_repeatability=release.number("speed_repeatability", ranges.REPEATABILITY),
        u_gravity_m_per_s2=u_gravity,
        u_height_offset_m=release.uncertainty("height_offset_u_m", ranges.HEIGHT_OFFSET_U_M),
        u_sample_rate_relative=root.uncertainty("sample_rate_u_relative", ranges.RELATIVE_U),
        environment=environment_from_json(root.child("environment", known=ENVIRONMENT_KEYS)),
    )
    return _with_shots(root, header, certificate, file)


def _calibrated(root: Fields) -> Sensor | None:
    """Return the cell that the folder's calibration found, ``None`` where it has none."""
    if not root.has("calibration"):
        return None
    calibration = root.child("calibration", known=CALIBRATION_KEYS)
    if not calibration.has("sensor"):
        calibration.refuse("sensor", "is missing: the load cell as the calibration found it.")
    return sensor_from_json(calibration.child("sensor", known=SENSOR_KEYS))


def _refuse_recordings(path: Path, file: Path) -> None:
    """Raise, with the command that helps, where somebody names recordings for a campaign."""
    if path.is_dir() and not file.exists():
        found = find_recordings(path)
        if found:
            endings = sorted({one.suffix for one in found})
            files = " ".join(f"{shlex.quote(str(path))}/*{ending}" for ending in endings)
            raise CampaignError(
                str(path),
                "$",
                f"has no {JSON_NAME}, and {counted(len(found), 'recording')}. Make a campaign of "
                "them first: "
                f"impactd new {files} --out {shlex.quote(path.resolve().name)}-campaign",
            )
        raise CampaignError(
            str(path),
            "$",
            f"has no {JSON_NAME}. Make a campaign of your recordings first: impactd new FILES...",
        )
    if path.suffix.lower() in RECORDING_ENDINGS:
        raise CampaignError(
            str(path),
            "$",
            "is a recording, not a campaign. Make one of it first: "
            f"impactd new {shlex.quote(str(path))}",
        )


def _with_shots(root: Fields, header: Campaign, certificate: Sensor, file: Path) -> CampaignFolder:
    good: list[CampaignShot] = []
    rejected: list[Rejected] = []
    for position, value in enumerate(root.array("shots")):
        at = f"$.shots[{position}]"
        try:
            fields = Fields(value, file=str(file), path=at, known=SHOT_KEYS)
            one = read_campaign_shot(fields, header, file.parent)
            _refuse_again(fields, one, good)
        except CampaignError as error:
            rejected.append(Rejected(_called(value) or at, error.json_path, error.reason))
        else:
            good.append(one)
    if not good and not rejected:
        root.refuse("shots", "is empty; list at least one shot with its file.")
    if not good:
        first = f"The first: {rejected[0].path}: {rejected[0].reason}"
        root.refuse("shots", f"none of {counted(len(rejected), 'shot')} can be used. {first}")
    campaign = replace(
        header,
        shots=tuple(one.shot for one in good),
        rejected=tuple(rejected),
        assumptions=_assumed(root, good),
    )
    return CampaignFolder(campaign, tuple(good), certificate)


def _assumed(root: Fields, good: Sequence[CampaignShot]) -> tuple[str, ...]:
    """Return the assumptions; without a drop height nothing depends on gravity."""
    if root.has("gravity_m_per_s2") or all(one.shot.drop_height_m is None for one in good):
        return ()
    return (
        f"No gravity_m_per_s2 given: the standard {STANDARD_GRAVITY_M_PER_S2} m/s^2 taken, from "
        "which most places differ by up to 0.3 %.",
    )


def _called(value: object) -> str:
    """Return the name for a shot that cannot be read: its own, else its file's."""
    if not isinstance(value, dict):
        return ""
    told = (value.get("name"), value.get("file"))
    return next((one for one in told if isinstance(one, str) and one), "")


def _refuse_again(fields: Fields, one: CampaignShot, good: Sequence[CampaignShot]) -> None:
    """Refuse a hit that is in the list already: two copies would count as two hits."""
    hit = (one.file, one.recording.trigger_index)
    for other in good:
        if (other.file, other.recording.trigger_index) == hit:
            fields.refuse(
                "file",
                f"{one.file!r} with the same trigger_index is {other.shot.path} already; "
                "one hit counts once.",
            )


def release_to_json(repeatability: float | None, offset: Uncertainty | None) -> dict[str, object]:
    """Return what is known of the release, in the keys of the campaign format."""
    found: dict[str, object] = {"speed_repeatability": repeatability}
    if offset is not None:
        about = measured_to_json(0.0, offset)
        assert isinstance(about, dict)
        found["height_offset_u_m"] = offset.u
        found |= {key: about[key] for key in about if key not in ("value", "u")}
    return found


def _spheres(root: Fields) -> dict[str, Sphere]:
    group = root.child("spheres")
    found = {}
    for name in group.names():
        fields = group.child(name, known=SPHERE_KEYS)
        found[name] = sphere_from_json(name, fields)
        impossible = ranges.impossible_density(found[name].radius_m, found[name].mass_kg)
        if impossible is not None:
            fields.refuse("mass_kg", impossible)
    return found


def _surfaces(root: Fields) -> dict[str, Surface]:
    group = root.child("surfaces")
    return {
        name: surface_from_json(name, group.child(name, known=SURFACE_KEYS))
        for name in group.names()
    }


def write_campaign(
    folder: Path,
    campaign: Campaign,
    recordings: tuple[Recording, ...] = (),
    *,
    assumptions: Sequence[str] = (),
    sources: Sequence[Mapping[str, object]] = (),
    calibration: Mapping[str, object] | None = None,
) -> Path:
    """Write a campaign as a folder that `read_campaign` reads back; return its ``campaign.json``.

    Parameters
    ----------
    folder : Path
        Created when absent; it must not hold a ``campaign.json`` yet.
    campaign : Campaign
        Its rejected shots are not written.
    recordings : tuple of Recording, optional
        The raw samples of its shots, in their order; without them the signals are written as
        floats in their unit.
    sources : sequence of mapping, optional
        For each shot more keys that say where it comes from.
    calibration : mapping, optional
        Keys of ``calibration``; the campaign's own sensor is the certificate then.

    Raises
    ------
    ArchiveError
        If the folder holds a campaign already or cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ArchiveError(f"{folder} cannot be made: {error.strerror}.") from error
    if (folder / JSON_NAME).exists():
        raise ArchiveError(f"{folder} holds a campaign already; choose another folder.")
    shots = []
    for position, shot in enumerate(campaign.shots):
        recording = recordings[position] if recordings else None
        name = f"shot{position:03d}.npy"
        write_samples(folder / name, shot.signal if recording is None else recording.samples)
        source = sources[position] if sources else {}
        shots.append({**shot_to_json(shot, name, recording), **source})
    time_base = campaign.u_sample_rate_relative
    root = {
        "format": FORMAT,
        "gravity_m_per_s2": measured_to_json(
            campaign.gravity_m_per_s2, campaign.u_gravity_m_per_s2
        ),
        "release": release_to_json(campaign.speed_repeatability, campaign.u_height_offset_m),
        "sample_rate_u_relative": None if time_base is None else time_base.u,
        "environment": environment_to_json(campaign.environment),
        "sensor": sensor_to_json(campaign.sensor),
        **({"calibration": dict(calibration)} if calibration else {}),
        "spheres": {name: sphere_to_json(one) for name, one in campaign.spheres.items()},
        "surfaces": {name: surface_to_json(one) for name, one in campaign.surfaces.items()},
        **({"assumptions": list(assumptions)} if assumptions else {}),
        "shots": shots,
    }
    path = folder / JSON_NAME
    publish(path, (json.dumps(root, allow_nan=False, indent=1) + "\n").encode())
    return path
