"""What ``impactd certificate`` does."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

from impactd.certificates.calibration_certificate import RecordedDrop, certificate_of, signatory
from impactd.certificates.cell_certificate import CellCertificate, read_cell_certificate
from impactd.console.failure import Failure
from impactd.console.options import open_archive, settings_of
from impactd.console.tables import print_json
from impactd.storage.archive import Archive, Calibration, NotFoundError
from impactd.storage.campaign_folder import read_campaign
from impactd.storage.json_fields import read_json
from impactd.storage.publish import publish
from impactd.storage.timestamp import utc_now

_CAMPAIGN_KEYS = {
    "compliance_m_per_v": "compliance_m_per_V",
    "crystal_mass_kg": "crystal_mass_kg",
    "crystal_stiffness_n_per_m": "crystal_stiffness_N_per_m",
    "crystal_damping_n_s_per_m": "crystal_damping_N_s_per_m",
    "hsd_n_per_v": "hsd_N_per_V",
}
"""Keys of the settings to those of a campaign's ``sensor``."""


def write(
    number: int | None,
    out: Path,
    *,
    identifier: str,
    responsible: str | None,
    role: str | None,
    config: Path | None,
    data: Path | None,
    as_json: bool,
) -> None:
    """Write the certificate of a calibration.

    Parameters
    ----------
    number : int or None
        The current calibration without it.
    out : Path
        Must not exist: certificates are never changed.

    Raises
    ------
    Failure
        If there is no calibration, or the file is there.
    """
    if out.exists():
        raise Failure(f"{out} exists already, and a certificate is never changed; name another.")
    settings = settings_of(config, data)
    signed_by = signatory(
        settings,
        identifier=identifier,
        issued=utc_now()[:10],
        responsible=responsible,
        role=role,
    )
    with open_archive(config, data, existing=True) as archive:
        calibration = (
            archive.calibrations.current() if number is None else archive.calibrations.get(number)
        )
        if calibration is None:
            raise Failure("there is no calibration yet; run `impactd calibrate --wait`.")
        content = certificate_of(
            calibration, signed_by, settings, list(_drops(archive, calibration))
        )
    publish(out, content)
    if as_json:
        print_json({"file": str(out), "calibration": calibration.number, "identifier": identifier})
    else:
        print(f"{out}: certificate {identifier} of calibration {calibration.number}.")


def _drops(archive: Archive, calibration: Calibration) -> Iterator[RecordedDrop]:
    for number in calibration.drops:
        try:
            metadata = archive.read_shot(number).metadata
        except NotFoundError:  # a drop that failed and was repeated has no shot
            continue
        cell = metadata.configuration.get("sensor") or {}
        yield RecordedDrop(metadata.environment, cell.get("serial_number"))


def read(
    path: Path, *, quantity: str | None, campaign: Path | None, replace: bool, as_json: bool
) -> None:
    """Print what a certificate says of a load cell, and write it into a campaign.

    Parameters
    ----------
    quantity : str or None
        Name of the sensitivity, if the certificate has several.
    campaign : Path or None
        A campaign folder or its ``campaign.json``.
    replace : bool
        Whether another value may be replaced there.
    """
    found = read_cell_certificate(path, named=quantity)
    if campaign is not None:
        _into_campaign(found, campaign, replace=replace)
    if as_json:
        print_json(asdict(found))
        return
    print(f"# certificate {found.identifier} of {found.laboratory}, {found.calibrated}")
    for serial in found.serial_numbers:
        print(f"# of the item {serial}")
    print(f"certificate = {json.dumps(found.identifier)}")
    for key, value in found.values.items():
        print(f"{key} = {{ value = {value.value:.10g}, u = {value.u:.6g} }}")


def _into_campaign(found: CellCertificate, campaign: Path, *, replace: bool) -> None:
    file = campaign / "campaign.json" if campaign.is_dir() else campaign
    read_campaign(file)  # refuses what is no campaign, with the reason
    document: dict[str, Any] = read_json(file)
    sensor = document["sensor"] = document.get("sensor") or {}
    if "log_covariance" in sensor and found.values.keys() - {"hsd_n_per_v"}:
        raise Failure(
            f"{file}: the cell there is that of a calibration, with covariances; a certificate's "
            "single values cannot replace it. Use the certificate in a campaign without one."
        )
    for key, value in found.values.items():
        name = _CAMPAIGN_KEYS[key]
        stated = {"value": value.value, "u": value.u}
        if not replace and sensor.get(name) not in (None, stated):
            raise Failure(
                f"{file}: $.sensor.{name} is {json.dumps(sensor[name])} already, and the "
                f"certificate says {value.value:.6g}; decide, and use --replace for the latter."
            )
        sensor[name] = stated
    publish(file, json.dumps(document, indent=2).encode("utf-8"), replace=True)
