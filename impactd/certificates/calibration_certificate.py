"""A calibration of the load cell as a digital calibration certificate (DCC 3.3.0, D-SI 2.2).

Source: the DCC's schema and its documentation, https://ptb.de/dcc/v3.3.0/. A certificate says no
day until which the calibration holds: ISO/IEC 17025, 7.8.4.3, leaves that to the customer.
"""

from __future__ import annotations

import base64
import json
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from impactd.aliases import Json
from impactd.certificates.elements import (
    COVERAGE_FACTOR,
    DCC,
    LANGUAGE,
    SCHEMA_VERSION,
    child,
    contact,
    quantity,
    worded,
)
from impactd.certificates.errors import CertificateError
from impactd.settings.certificate import CertificateSection, Contact
from impactd.settings.instrument import SensorSection
from impactd.settings.settings import Settings
from impactd.storage.calibrations import STATIC_WEIGHTS, Calibration
from impactd.storage.version import software

if TYPE_CHECKING:
    from analysis.campaign import Environment, Quantity

_SCHEMA_INSTANCE = "http://www.w3.org/2001/XMLSchema-instance"
_MEASURED = "basic_measuredValue"

IDENTIFIED = {
    "gain_N_per_V": ("Gain S, force per volt", r"\newton\volt\tothe{-1}"),
    "natural_frequency_Hz": ("Natural frequency", r"\hertz"),
    "damping_ratio": ("Damping ratio", r"\one"),
}
CRYSTAL = {
    "compliance_m_per_v": ("Crystal compression per volt", r"\metre\volt\tothe{-1}"),
    "crystal_mass_kg": ("Moving mass", r"\kilogram"),
    "crystal_stiffness_n_per_m": ("Stiffness of the crystal", r"\newton\metre\tothe{-1}"),
    "crystal_damping_n_s_per_m": (
        "Damping of the crystal",
        r"\newton\second\metre\tothe{-1}",
    ),
}
RIGID = {"hsd_n_per_v": ("Gain S of a rigid cell, force per volt", r"\newton\volt\tothe{-1}")}
"""Key in a calibration's result or in the settings, to name and unit."""


@dataclass(frozen=True)
class Signatory:
    """What the writer of a certificate must be told.

    Attributes
    ----------
    identifier : str
        The certificate's number, unique in the world.
    issued : str
        Day of issue. [ISO 8601]
    responsible, role : str
        Who answers for it, and as what.
    laboratory, customer : Contact
    performance_location : str
        In the words of the DCC.
    cell_manufacturer, cell_model : str
        Of the calibrated cell.
    """

    identifier: str
    issued: str
    responsible: str
    role: str
    laboratory: Contact
    customer: Contact
    performance_location: str
    cell_manufacturer: str
    cell_model: str


@dataclass(frozen=True)
class RecordedDrop:
    """What the shot file of a drop says of its conditions.

    Attributes
    ----------
    environment : Environment or None
    cell_serial_number : str or None
        Of the cell that the settings named then.
    """

    environment: Environment | None
    cell_serial_number: str | None


def signatory(
    settings: Settings, *, identifier: str, issued: str, responsible: str | None, role: str | None
) -> Signatory:
    """Return who signs, from options and settings.

    Parameters
    ----------
    responsible, role : str or None
        In place of the settings'.

    Raises
    ------
    CertificateError
        With every key that is missing.
    """
    if not identifier or identifier.split() != [identifier]:
        raise CertificateError(
            f"The identifier {identifier!r} is no certificate number.",
            "Give the number under which your laboratory files this certificate, without blanks.",
        )
    section = settings.certificate or CertificateSection()
    found: dict[str, Any] = {name: getattr(section, name) for name in _FROM_SETTINGS}
    found.update(responsible=responsible or section.responsible, role=role or section.role)
    missing = [f"certificate.{name}" for name, value in found.items() if value is None]
    if missing:
        raise CertificateError(
            f"The settings lack {', '.join(missing)}, which a certificate must state.",
            "Fill in the section [certificate]; config/rig.toml shows every key.",
        )
    return Signatory(identifier=identifier, issued=issued, **found)


_FROM_SETTINGS = (
    "laboratory",
    "customer",
    "performance_location",
    "cell_manufacturer",
    "cell_model",
)


def certificate_of(
    calibration: Calibration,
    signed_by: Signatory,
    settings: Settings,
    drops: Sequence[RecordedDrop] = (),
) -> bytes:
    """Return the XML of a certificate.

    Parameters
    ----------
    settings : Settings
        Name the load cell: the item that was calibrated.
    drops : sequence of RecordedDrop
        Those of the calibration; a temperature is stated if every drop has one.

    Returns
    -------
    bytes
        UTF-8.

    Raises
    ------
    CertificateError
        If the calibration gave no result that could be stated, or is of another cell.
    """
    result = _usable(calibration)
    _check_cell(calibration, settings.sensor, drops)
    ET.register_namespace("xsi", _SCHEMA_INSTANCE)
    root = ET.Element(f"{{{DCC}}}digitalCalibrationCertificate", schemaVersion=SCHEMA_VERSION)
    root.set(f"{{{_SCHEMA_INSTANCE}}}schemaLocation", f"{DCC} {DCC}/v{SCHEMA_VERSION}/dcc.xsd")
    _administrative(root, calibration, signed_by, settings)
    measured = child(child(root, "dcc:measurementResults"), "dcc:measurementResult")
    worded(measured, "dcc:name", "Calibration of a load cell for impacts")
    _method(measured, calibration)
    _software(child(measured, "dcc:usedSoftware"))
    _references(measured, calibration)
    _conditions(measured, [one.environment for one in drops])
    _results(measured, calibration, result)
    ET.indent(root)
    text: bytes = ET.tostring(root, encoding="UTF-8", xml_declaration=True)
    return text


def _check_cell(
    calibration: Calibration, cell: SensorSection, drops: Sequence[RecordedDrop]
) -> None:
    """Refuse a calibration of a cell that has been exchanged since; weights name no cell."""
    then = {one.cell_serial_number for one in drops} - {None, cell.serial_number}
    if then:
        raise CertificateError(
            f"Calibration {calibration.number} is of the cell {', '.join(sorted(map(str, then)))}, "
            f"and the settings name the cell {cell.serial_number}.",
            "Name a calibration of this cell, or use the settings of that time (--config).",
        )


def _usable(calibration: Calibration) -> Json:
    if calibration.result is None or calibration.finished_utc is None:
        raise CertificateError(
            f"Calibration {calibration.number} is {calibration.state}: it has no result.",
            "Name a calibration that is done; `impactd calibrate --history` lists them.",
        )
    if not any(_groups(calibration.result).values()):
        raise CertificateError(
            f"Calibration {calibration.number} gave no gain: "
            f"{calibration.result['outcome']['message']}",
            "Calibrate anew.",
        )
    return calibration.result


def _administrative(
    root: ET.Element, calibration: Calibration, signed_by: Signatory, settings: Settings
) -> None:
    made = child(root, "dcc:administrativeData")
    _software(child(made, "dcc:dccSoftware"))
    core = child(made, "dcc:coreData")
    child(core, "dcc:countryCodeISO3166_1", signed_by.laboratory.country_code)
    child(core, "dcc:usedLangCodeISO639_1", LANGUAGE)
    child(core, "dcc:mandatoryLangCodeISO639_1", LANGUAGE)
    child(core, "dcc:uniqueIdentifier", signed_by.identifier)
    child(core, "dcc:beginPerformanceDate", calibration.requested_utc[:10])
    child(core, "dcc:endPerformanceDate", str(calibration.finished_utc)[:10])
    child(core, "dcc:performanceLocation", signed_by.performance_location)
    child(core, "dcc:issueDate", signed_by.issued)
    item = child(child(made, "dcc:items"), "dcc:item")
    worded(item, "dcc:name", "Load cell")
    worded(child(item, "dcc:manufacturer"), "dcc:name", signed_by.cell_manufacturer)
    child(item, "dcc:model", signed_by.cell_model)
    serial = child(child(item, "dcc:identifications"), "dcc:identification")
    serial.set("refType", "basic_serialNumber")
    child(serial, "dcc:issuer", "manufacturer")
    child(serial, "dcc:value", settings.sensor.serial_number)
    worded(serial, "dcc:name", "Serial number")
    contact(child(made, "dcc:calibrationLaboratory"), "dcc:contact", signed_by.laboratory)
    person = child(child(made, "dcc:respPersons"), "dcc:respPerson")
    worded(child(person, "dcc:person"), "dcc:name", signed_by.responsible)
    child(person, "dcc:role", signed_by.role)
    child(person, "dcc:mainSigner", "true")
    contact(made, "dcc:customer", signed_by.customer)
    statements = child(made, "dcc:statements")
    _uncertainty(statements)
    if settings.simulated:
        simulated = child(statements, "dcc:statement")
        worded(simulated, "dcc:name", "Simulated")
        words = "The rig is simulated: this is an example, and the certificate of no cell."
        worded(simulated, "dcc:declaration", words)


def _uncertainty(statements: ET.Element) -> None:
    statement = child(statements, "dcc:statement")
    worded(statement, "dcc:name", "Measurement uncertainty")
    child(statement, "dcc:norm", "JCGM 100:2008")
    worded(
        statement,
        "dcc:declaration",
        "The expanded uncertainty is the standard uncertainty multiplied by the coverage factor "
        f"k = {COVERAGE_FACTOR:g}. For a normal distribution that is a coverage probability of "
        "approximately 95 %.",
    )


def _software(parent: ET.Element) -> None:
    name, _, version = software().partition(" ")
    made = child(parent, "dcc:software")
    worded(made, "dcc:name", name)
    child(made, "dcc:release", f"v{version}")
    child(made, "dcc:type", "application")


def _method(measured: ET.Element, calibration: Calibration) -> None:
    weights = calibration.kind == STATIC_WEIGHTS
    method = child(child(measured, "dcc:usedMethods"), "dcc:usedMethod")
    method.set("refType", "basic_calibrationMethod")
    worded(method, "dcc:name", "Known weights" if weights else "Drops of known spheres")
    worded(
        method,
        "dcc:description",
        "The line through the readings of the cell under known weights."
        if weights
        else "Spheres of known modulus, mass and radius fall from known heights on surfaces of "
        "known modulus. The parameters of the cell follow from a joint fit of all records with the "
        f"model {calibration.result['model'] if calibration.result else ''!r}.",
    )
    child(
        method,
        "dcc:reference",
        "J. J. Maranzano and B. C. Hancock (2016), section 3",
    )


def _references(measured: ET.Element, calibration: Calibration) -> None:
    """Name the spheres and surfaces that were the references."""
    used = {
        (f"Reference {role}", str(drops[role])): None
        for role in ("sphere", "surface")
        for drops in calibration.plan
        if role in drops
    }
    if not used:
        return
    equipment = child(measured, "dcc:measuringEquipments")
    for role, name in used:
        one = child(equipment, "dcc:measuringEquipment")
        worded(one, "dcc:name", f"{role} {name}")


def _conditions(measured: ET.Element, environments: list[Environment | None]) -> None:
    """State least and most of what was read at every drop, or that nobody read it."""
    conditions = child(measured, "dcc:influenceConditions")
    _condition(
        conditions,
        "Temperature of spheres and coupons",
        r"\degreecelsius",
        "basic_temperature",
        [None if one is None else one.temperature_c for one in environments],
    )
    _condition(
        conditions,
        "Relative humidity of the air",
        r"\one",
        "basic_humidityRelative",
        [None if one is None else one.relative_humidity for one in environments],
    )


def _condition(
    conditions: ET.Element, name: str, unit: str, ref_type: str, read: list[Quantity | None]
) -> None:
    condition = child(conditions, "dcc:influenceCondition", refType=ref_type)
    worded(condition, "dcc:name", name)
    data = child(condition, "dcc:data")
    known = sorted((one for one in read if one is not None), key=lambda one: one.value)
    if not known or len(known) < len(read):
        worded(data, "dcc:text", f"It was recorded at {len(known)} of {len(read)} drops.")
        return
    for word, one, end in (("least", known[0], "Min"), ("most", known[-1], "Max")):
        stated = {"value": one.value, "u": one.u}
        title = f"{name}, {word} of all drops"
        quantity(data, title, stated, unit, f"basic_measuredValue{end}")


def _groups(result: Json) -> dict[str, dict[str, tuple[Mapping[str, Any], str, str]]]:
    """Return what a result states: title to key to measurand, name and unit."""
    rigid = (result.get("hsd") or {}).get("gain_N_per_V")
    sources: list[tuple[str, dict[str, tuple[str, str]], Mapping[str, Any]]] = [
        ("What the drops determine", IDENTIFIED, result.get("identifiable") or {}),
        ("The cell's crystal", CRYSTAL, result.get("parameters") or {}),
        ("The cell as a rigid body", RIGID, {"hsd_n_per_v": rigid}),
    ]
    return {
        title: {
            key: (values[key], *words)
            for key, words in names.items()
            if values.get(key) is not None
        }
        for title, names, values in sources
    }


def _results(measured: ET.Element, calibration: Calibration, result: Json) -> None:
    results = child(measured, "dcc:results")
    for title, found in _groups(result).items():
        if not found:
            continue
        one = child(results, "dcc:result")
        worded(one, "dcc:name", title)
        data = child(one, "dcc:data")
        for key, (value, name, unit) in found.items():
            quantity(data, name, value, unit, f"{_MEASURED} {REF_TYPE}{key}")
    whole = child(results, "dcc:result")
    worded(whole, "dcc:name", "The calibration as impactd keeps it, with all covariances")
    warnings = " ".join(f"{text[0].upper()}{text[1:]}." for text in result.get("warnings") or [])
    if warnings:
        worded(whole, "dcc:description", warnings)
    file = child(child(whole, "dcc:data"), "dcc:byteData")
    child(file, "dcc:fileName", f"calibration-{calibration.number}.json")
    child(file, "dcc:mimeType", "application/json")
    kept = json.dumps(asdict(calibration), indent=1, allow_nan=False).encode("utf-8")
    child(file, "dcc:dataBase64", base64.b64encode(kept).decode("ascii"))


REF_TYPE = "impactd_"
"""What our own refTypes begin with; `cell_certificate` finds a cell's quantities by them."""
