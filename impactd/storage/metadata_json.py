"""All that a shot file says beside its samples, as one JSON value, both ways."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from numpy.typing import NDArray

from analysis.campaign import Environment, Quantity
from drivers.digitizer import DigitizerIdentity, TriggerSettings
from impactd.storage import ranges
from impactd.storage.drops import Drop, DropRequest
from impactd.storage.errors import CorruptShotError
from impactd.storage.json_fields import Fields
from impactd.storage.materials_json import (
    ENVIRONMENT_KEYS,
    environment_from_json,
    environment_to_json,
    quantity_to_json,
    sensor_from_json,
    sensor_to_json,
    sphere_from_json,
    sphere_to_json,
    surface_from_json,
    surface_to_json,
)
from impactd.storage.shot_metadata import Recording, ShotMetadata

FORMAT = "impactd-shot/1"


def metadata_to_json(
    number: int, recording: Recording, metadata: ShotMetadata, drop: Drop | None
) -> dict[str, Any]:
    """Return everything a shot file says beside its samples, JSON-ready."""
    named = {key: getattr(metadata, key) for key in ShotMetadata.__dataclass_fields__}
    if metadata.sphere is not None:
        named["sphere"] = {"name": metadata.sphere.name, **sphere_to_json(metadata.sphere)}
    if metadata.surface is not None:
        named["surface"] = {"name": metadata.surface.name, **surface_to_json(metadata.surface)}
    if metadata.sensor is not None:
        named["sensor"] = sensor_to_json(metadata.sensor)
    if metadata.digitizer is not None:
        named["digitizer"] = asdict(metadata.digitizer)
    if metadata.trigger is not None:
        named["trigger"] = asdict(metadata.trigger)
    named["restitution"] = quantity_to_json(metadata.restitution)
    named["environment"] = environment_to_json(metadata.environment)
    kept = {
        key: getattr(recording, key) for key in Recording.__dataclass_fields__ if key != "samples"
    }
    return {
        "format": FORMAT,
        "number": number,
        "recording": kept,
        "about": named,
        "drop": None if drop is None else _of_drop(drop),
    }


def _of_drop(drop: Drop) -> dict[str, Any]:
    found = {**asdict(drop), "problem": None}
    found["request"]["environment"] = environment_to_json(drop.request.environment)
    return found


def metadata_from_json(
    facts: dict[str, Any], samples: NDArray[Any], path: str
) -> tuple[Recording, ShotMetadata, Drop | None]:
    """Return what `metadata_to_json` encoded, with the samples put back.

    Raises CorruptShotError if it is another format.
    """
    if facts["format"] != FORMAT:
        raise CorruptShotError(path, f"its format is {facts['format']!r}, not {FORMAT!r}")
    recording = facts["recording"]
    _refuse_impossible(recording, facts["about"], samples, path)
    recording["status_words"] = tuple(recording["status_words"])
    drop = facts["drop"]
    if drop is not None:
        request = drop["request"]
        request["environment"] = _environment_of(request, path, "$.drop.request")
        drop["request"] = DropRequest(**request)
        drop = Drop(**drop)
    return Recording(samples=samples, **recording), _metadata_of(facts["about"], path), drop


def _refuse_impossible(
    recording: dict[str, Any], metadata: dict[str, Any], samples: NDArray[Any], path: str
) -> None:
    """Hold the numbers of a file to the ranges of a campaign; a reindex reads any file."""
    record = Fields(recording, file=path, path="$.recording")
    for key, within in (
        ("sample_rate_hz", ranges.SAMPLE_RATE_HZ),
        ("sample_rate_u_hz", ranges.SAMPLE_RATE_U_HZ),
        ("per_code", ranges.PER_CODE),
        ("offset", ranges.SIGNAL),
    ):
        if record.number(key, within) is None:
            record.refuse(key, "is missing.")
    trigger = record.whole("trigger_index")
    if trigger is None or not trigger < samples.size:
        record.refuse("trigger_index", f"is {trigger}; there are {samples.size} samples.")
    around = Fields(metadata, file=path, path="$.about")
    around.number("gravity_m_per_s2", ranges.GRAVITY_M_PER_S2)
    around.number("drop_height_m", ranges.DROP_HEIGHT_M)
    around.number("speed_repeatability", ranges.REPEATABILITY)
    around.quantity("restitution", ranges.RESTITUTION)


def _environment_of(within: dict[str, Any], path: str, at: str) -> Environment | None:
    """Return an environment; files of earlier versions have none."""
    around = Fields(within, file=path, path=at).child("environment", known=ENVIRONMENT_KEYS)
    return environment_from_json(around)


def _metadata_of(metadata: dict[str, Any], path: str) -> ShotMetadata:
    def fields(key: str) -> Fields:
        return Fields(metadata[key], file=path, path=f"$.about.{key}")

    if metadata["sphere"] is not None:
        metadata["sphere"] = sphere_from_json(metadata["sphere"]["name"], fields("sphere"))
    if metadata["surface"] is not None:
        metadata["surface"] = surface_from_json(metadata["surface"]["name"], fields("surface"))
    if metadata["sensor"] is not None:
        metadata["sensor"] = sensor_from_json(fields("sensor"))
    if metadata["digitizer"] is not None:
        metadata["digitizer"] = DigitizerIdentity(**metadata["digitizer"])
    if metadata["trigger"] is not None:
        metadata["trigger"] = TriggerSettings(**metadata["trigger"])
    if metadata["restitution"] is not None:
        metadata["restitution"] = Quantity(**metadata["restitution"])
    metadata["environment"] = _environment_of(metadata, path, "$.about")
    metadata["notes"] = tuple(metadata["notes"])
    return ShotMetadata(**metadata)
