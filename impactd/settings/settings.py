"""One TOML file, checked whole, before anything moves.

The keys are described in `impactd.settings.instrument` and
`impactd.settings.sections`; ``config/rig.toml`` documents every one and
``config/impactd.schema.json`` is generated from them (``python -m impactd.settings.settings``).
"""

from __future__ import annotations

import json
import os
import sys
import sysconfig
import tomllib
from pathlib import Path
from typing import Any

from pydantic import Field, ValidationError, model_validator

from impactd.settings.certificate import CertificateSection
from impactd.settings.errors import SettingsError, SettingsFinding, explain
from impactd.settings.instrument import (
    DigitizerSection,
    ReleaseSection,
    RigSection,
    SensorSection,
    TriggerSection,
    ValveSection,
)
from impactd.settings.keys import Section
from impactd.settings.sections import (
    CalibrationSection,
    EnvironmentSection,
    JobsSection,
    MaterialsSection,
    PreflightSection,
    ServerSection,
    SimulationSection,
    StorageSection,
    TimeoutsSection,
)

__all__ = [
    "Settings",
    "SettingsError",
    "SettingsFinding",
    "find_config",
    "json_schema",
    "load_settings",
    "read_toml",
]

ENVIRONMENT_KEY = "IMPACTD_CONFIG"
SYSTEM_FILE = Path("/etc/impactd/impactd.toml")


class Settings(Section):
    """Everything the daemon must be told."""

    rig: RigSection
    server: ServerSection = Field(default_factory=ServerSection)
    storage: StorageSection
    digitizer: DigitizerSection
    trigger: TriggerSection
    valve: ValveSection
    release: ReleaseSection
    sensor: SensorSection
    preflight: PreflightSection
    timeouts: TimeoutsSection = Field(default_factory=TimeoutsSection)
    jobs: JobsSection = Field(default_factory=JobsSection)
    calibration: CalibrationSection = Field(default_factory=CalibrationSection)
    materials: MaterialsSection = Field(default_factory=MaterialsSection)
    environment: EnvironmentSection | None = None
    certificate: CertificateSection | None = None
    simulation: SimulationSection | None = None

    @property
    def simulated(self) -> bool:
        """Whether the rig is the simulated one."""
        return self.simulation is not None

    def snapshot(self) -> dict[str, Any]:
        """Return what a shot file keeps of the settings: JSON-ready, without secrets.

        The simulation's section stays out: it holds what the analysis is to find. So does the
        certificate's: names and addresses do not belong in recordings.
        """
        kept = self.model_dump(mode="json", exclude={"simulation", "certificate"})
        kept["simulated"] = self.simulated
        if self.environment is not None and self.environment.command is not None:
            # The program alone: its arguments may hold a password of the sensor.
            kept["environment"]["command"] = [self.environment.command[0]]
        return kept

    @model_validator(mode="after")
    def _parts_fit_together(self) -> Settings:
        if abs(self.trigger.level_v) >= self.digitizer.range_v:
            raise ValueError(
                f"trigger.level_v = {self.trigger.level_v:g} V lies outside the range "
                f"+/-{self.digitizer.range_v:g} V of the digitizer: it would never be reached"
            )
        if self.digitizer.ring_seconds < self.trigger.record_s + 0.5:
            raise ValueError(
                f"digitizer.ring_seconds = {self.digitizer.ring_seconds:g} s must be at least "
                f"trigger.record_s + 0.5 s = {self.trigger.record_s + 0.5:g} s"
            )
        if self.simulation is None and not self.valve.port:
            raise ValueError(
                "valve.port is missing: name the serial port of the relay board, best its path "
                "under /dev/serial/by-id"
            )
        if self.simulation is not None and self.valve.port:
            raise ValueError("valve.port must be left out on the simulated rig: it brings its own")
        return self


def load_settings(path: Path | None = None, *, data: Path | None = None) -> Settings:
    """Return the settings of a file, checked whole.

    File names in it are absolute or as the working directory sees them.

    Parameters
    ----------
    path : Path or None
        The TOML file; ``None`` looks at ``$IMPACTD_CONFIG``, then ``/etc/impactd/impactd.toml``.
    data : Path, optional
        Folder of the archive, instead of the file's ``storage.directory``.

    Raises
    ------
    SettingsError
        If no file is found, it cannot be read, a key is unknown, missing or wrong, or the
        calibration plan names materials that do not exist or are no references.
    """
    file, content = read_toml(path)
    try:
        settings = Settings.model_validate(content)
    except ValidationError as error:
        findings = tuple(explain(detail, Settings) for detail in error.errors())
        raise SettingsError(file, findings[0].path_in_file, findings[0].reason, findings) from None
    settings = _with_absolute_files(settings, file.parent)
    if data is not None:
        storage = settings.storage.model_copy(update={"directory": data})
        settings = settings.model_copy(update={"storage": storage})
    _check_plan(settings, file)
    return settings


def find_config(name: str) -> Path:
    """Return a file of ``config`` that came with the program, e.g. ``simulated.toml``.

    In a checkout it is beside the packages, else where the wheel put it. Raises SettingsError if it
    is in neither place.
    """
    places = (
        Path(__file__).resolve().parent.parent.parent / "config",
        Path(sys.prefix) / "share" / "impactd" / "config",
        Path(sysconfig.get_path("data")) / "share" / "impactd" / "config",
    )
    for place in places:
        if (place / name).is_file():
            return place / name
    looked = ", ".join(str(place) for place in dict.fromkeys(places))
    raise SettingsError(None, "", f"{name} is in none of {looked}: reinstall impactd")


def json_schema() -> dict[str, Any]:
    """Return the JSON schema of the settings file, for editors and for people."""
    schema = Settings.model_json_schema()
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    schema["title"] = "impactd settings"
    return schema


def _locate(path: Path | None) -> Path:
    if path is None:
        named = os.environ.get(ENVIRONMENT_KEY)
        path = Path(named) if named else SYSTEM_FILE
        if not named and not path.is_file():
            raise SettingsError(
                None,
                "",
                f"no settings file: give --config FILE or ${ENVIRONMENT_KEY}, or write "
                f"{SYSTEM_FILE}; a complete rig without hardware is described by "
                f"{find_config('simulated.toml')}",
            )
    return path.expanduser()


def read_toml(path: Path | None) -> tuple[Path, dict[str, Any]]:
    """Return where the settings are, and their content, unchecked.

    ``path`` is as in `load_settings`. Raises SettingsError if there is no such file, or it is not
    TOML.
    """
    file = _locate(path)
    try:
        return file, tomllib.loads(file.read_text(encoding="utf-8"))
    except tomllib.TOMLDecodeError as error:
        raise SettingsError(file, "", f"this is not valid TOML: {error}") from None
    except UnicodeDecodeError as error:
        raise SettingsError(file, "", f"this is not UTF-8 text: {error.reason}") from None
    except OSError as error:
        raise SettingsError(file, "", f"cannot be read: {error.strerror}") from None


def _with_absolute_files(settings: Settings, folder: Path) -> Settings:
    """Resolve the files that are named relative to the settings file."""
    folder = folder.resolve()
    digitizer = settings.digitizer.model_copy(
        update={
            name: folder / value
            for name in ("firmware_file", "fpga_file")
            if (value := getattr(settings.digitizer, name, None)) is not None
        }
    )
    materials = settings.materials.model_copy(update={"file": folder / settings.materials.file})
    found: dict[str, Section] = {"digitizer": digitizer, "materials": materials}
    around = settings.environment
    if around is not None and around.file is not None:
        found["environment"] = around.model_copy(update={"file": folder / around.file})
    return settings.model_copy(update=found)


def _check_plan(settings: Settings, file: Path) -> None:
    # Loaded only here: whoever makes the valve safe reads settings and must not wait for numpy.
    from impactd.settings.materials import load_materials  # noqa: PLC0415

    materials = load_materials(settings.materials.file)
    findings = []
    for index, drops in enumerate(settings.calibration.plan):
        for role, name in (("sphere", drops.sphere), ("surface", drops.surface)):
            reason = materials.why_no_reference(role, name)
            if reason:
                findings.append(SettingsFinding(f"calibration.plan.{index}.{role}", reason))
        if (
            not settings.rig.min_drop_height_m
            <= drops.drop_height_m
            <= (settings.rig.max_drop_height_m)
        ):
            findings.append(
                SettingsFinding(
                    f"calibration.plan.{index}.drop_height_m",
                    f"{drops.drop_height_m:g} m lies outside the rig's "
                    f"{settings.rig.min_drop_height_m:g} to {settings.rig.max_drop_height_m:g} m",
                )
            )
    if findings:
        raise SettingsError(file, findings[0].path_in_file, findings[0].reason, tuple(findings))


if __name__ == "__main__":
    print(json.dumps(json_schema(), indent=1))
