"""What a load cell's certificate (DCC 3.x) says: its sensitivity with its uncertainty.

A quantity is found by its unit: volts per newton is a sensitivity, newtons per volt its inverse,
the gain S of Eq. 7. A certificate of this program names its quantities, so there those of the
crystal are found too.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from impactd.certificates.calibration_certificate import CRYSTAL, IDENTIFIED, REF_TYPE, RIGID
from impactd.certificates.dsi_units import Unit, parse_unit
from impactd.certificates.elements import DCC, NAMESPACES
from impactd.certificates.errors import CertificateError
from impactd.storage.regular_file import read_regular_file

_LIMIT_BYTES = 16 * 1024 * 1024
_GAIN = parse_unit(r"\newton\volt\tothe{-1}")
_SENSITIVITY = _GAIN.inverse()
_GAIN_KEY = "hsd_n_per_v"
_OTHER_FORM = (
    "Ask the laboratory for a certificate in the DCC's form, or copy the values into [sensor] of "
    "the settings by hand."
)


@dataclass(frozen=True)
class CellValue:
    """A value of the cell, in SI units.

    Attributes
    ----------
    value, u : float
        With its standard uncertainty, in the unit of the settings' key.
    """

    value: float
    u: float


@dataclass(frozen=True)
class CellCertificate:
    """What a certificate says of a cell.

    Attributes
    ----------
    identifier, laboratory : str
        Its number and who wrote it.
    calibrated : str
        Last day of the calibration. [ISO 8601]
    serial_numbers : tuple of str
        Everything that identifies the item.
    values : dict
        Keys of the settings' [sensor] to values.
    """

    identifier: str
    laboratory: str
    calibrated: str
    serial_numbers: tuple[str, ...]
    values: dict[str, CellValue]


def read_cell_certificate(path: Path, *, named: str | None = None) -> CellCertificate:
    """Return what a load cell's certificate says.

    Parameters
    ----------
    named : str, optional
        Name of the quantity that is the sensitivity, where the certificate has several.

    Raises
    ------
    CertificateError
        If this is no such certificate, or it does not say exactly one sensitivity.
    """
    root = _root(path)
    found = [(_name(one), one) for one in root.iterfind(_QUANTITIES, NAMESPACES)]
    if named is not None:
        known = ", ".join(repr(name) for name, _ in found)
        found = [(name, one) for name, one in found if name == named]
        if not found:
            raise CertificateError(f"{path} has no quantity {named!r}.", f"It has {known}.")
    ours = dict(_ours(found))
    gains = [] if _GAIN_KEY in ours else [pair for pair in found if _is_gain(pair[1])]
    if len(gains) > 1:
        raise CertificateError(
            f"{path} states {len(gains)} sensitivities: {', '.join(repr(n) for n, _ in gains)}.",
            "Choose the one of your range and conditioner with --quantity NAME.",
        )
    if not gains and not ours:
        raise CertificateError(
            f"{path} states no quantity in volts per newton or newtons per volt.",
            "A charge (pC/N) or bridge (mV/V) sensitivity needs the conditioner's own calibration: "
            "let cell and conditioner be calibrated together, or multiply by hand.",
        )
    if gains:
        ours[_GAIN_KEY] = _gain(*gains[0])
    return CellCertificate(
        identifier=_text(root, f"{_CORE}/dcc:uniqueIdentifier"),
        laboratory=_text(
            root,
            "dcc:administrativeData/dcc:calibrationLaboratory/dcc:contact/dcc:name/dcc:content",
        ),
        calibrated=_text(root, f"{_CORE}/dcc:endPerformanceDate"),
        serial_numbers=tuple(
            (one.text or "").strip() for one in root.iterfind(_IDENTIFICATIONS, NAMESPACES)
        ),
        values=ours,
    )


_CORE = "dcc:administrativeData/dcc:coreData"
_QUANTITIES = "dcc:measurementResults/dcc:measurementResult/dcc:results//dcc:quantity"
_IDENTIFICATIONS = (
    "dcc:administrativeData/dcc:items/dcc:item/dcc:identifications/dcc:identification/dcc:value"
)


def _root(path: Path) -> ET.Element:
    try:
        content = read_regular_file(path, _LIMIT_BYTES)
    except OSError as error:
        raise CertificateError(f"{path} cannot be read: {error.strerror}.", "") from error
    if b"<!DOCTYPE" in content:  # entities could fill the memory, and no DCC needs them
        raise CertificateError(f"{path} has a document type, which no DCC has.", _OTHER_FORM)
    try:
        root = ET.fromstring(content)  # noqa: S314 - without a document type there are no entities
    except ET.ParseError as error:
        raise CertificateError(f"{path} is no XML: {error}.", _OTHER_FORM) from error
    if root.tag != f"{{{DCC}}}digitalCalibrationCertificate":
        raise CertificateError(f"{path} is no DCC: its first element is {root.tag!r}.", _OTHER_FORM)
    version = root.get("schemaVersion", "")
    if not version.startswith("3."):
        raise CertificateError(
            f"{path} is a DCC of version {version!r}; versions 3.x are read.", _OTHER_FORM
        )
    return root


def _text(root: ET.Element, where: str) -> str:
    found = (root.findtext(where, "", NAMESPACES) or "").strip()
    if not found:
        raise CertificateError(
            f"The certificate lacks {where.replace('dcc:', '')}, which every DCC has.", _OTHER_FORM
        )
    return found


def _name(quantity: ET.Element) -> str:
    return (quantity.findtext("dcc:name/dcc:content", "", NAMESPACES) or "").strip()


def _ours(found: list[tuple[str, ET.Element]]) -> Iterator[tuple[str, CellValue]]:
    """Yield the cell's quantities by the names that this program gives them."""
    keys = CRYSTAL | RIGID
    for name, one in found:
        for word in one.get("refType", "").split():
            key = word.removeprefix(REF_TYPE)
            if word.startswith(REF_TYPE) and key in keys:
                value, u, unit = _measured(name, one)
                wanted = parse_unit(keys[key][1])
                if unit.powers != wanted.powers:
                    raise CertificateError(
                        f"{name!r} has another unit than {keys[key][1]}.", _OTHER_FORM
                    )
                yield key, CellValue(value * unit.factor, u * unit.factor)


def _is_gain(quantity: ET.Element) -> bool:
    """Whether a quantity is a sensitivity or a gain; our own gains of a moving cell are none."""
    own = {f"{REF_TYPE}{key}" for key in IDENTIFIED}
    if own & set(quantity.get("refType", "").split()):
        return False
    text = quantity.findtext("si:real/si:unit", None, NAMESPACES)
    text = text or quantity.findtext("si:realListXMLList/si:unitXMLList", None, NAMESPACES)
    try:
        return parse_unit(text or "").powers in (_GAIN.powers, _SENSITIVITY.powers)
    except CertificateError:  # of another quantity: whoever needs it will read it
        return False


def _gain(name: str, quantity: ET.Element) -> CellValue:
    """Return S in N/V; the relative uncertainty of an inverse is the value's own."""
    value, u, unit = _measured(name, quantity)
    if not value > 0:
        raise CertificateError(
            f"{name!r} is {value:g}, and a sensitivity is positive.",
            "A reversed polarity is set by the sign of trigger.level_v, not by the gain.",
        )
    at = value * unit.factor
    gain = at if unit.powers == _GAIN.powers else 1 / at
    return CellValue(gain, gain * u / value)


def _measured(name: str, quantity: ET.Element) -> tuple[float, float, Unit]:
    """Return value, standard uncertainty and unit of a quantity."""
    real = quantity.find("si:real", NAMESPACES)
    if real is None:
        raise CertificateError(
            f"{name!r} is a list of values, and a prior needs one.",
            "Ask for one sensitivity of your range, or copy the value by hand into [sensor].",
        )
    unit = parse_unit(real.findtext("si:unit", "", NAMESPACES))
    value = _number(name, real.findtext("si:value", None, NAMESPACES))
    for element, stated, factor in _UNCERTAINTIES:
        found = real.find(element, NAMESPACES)
        if found is not None:
            u = _number(name, found.findtext(stated, None, NAMESPACES))
            k = _number(name, found.findtext(factor, None, NAMESPACES)) if factor else 1.0
            if not (u > 0 and k >= 1):
                raise CertificateError(
                    f"{name!r} has the uncertainty {u:g} with k = {k:g}.",
                    "A prior needs a positive uncertainty and a coverage factor of 1 or more.",
                )
            return value, u / k, unit
    raise CertificateError(
        f"{name!r} states no expanded uncertainty with its coverage factor.",
        "A prior needs one: ask the laboratory, nothing is assumed here.",
    )


_WRAPPER = "si:measurementUncertaintyUnivariate"
_UNCERTAINTIES: tuple[tuple[str, str, str | None], ...] = (
    (f"{_WRAPPER}/si:expandedMU", "si:valueExpandedMU", "si:coverageFactor"),
    (f"{_WRAPPER}/si:standardMU", "si:valueStandardMU", None),
    (f"{_WRAPPER}/si:coverageIntervalMU", "si:valueStandardMU", None),
    ("si:expandedUnc", "si:uncertainty", "si:coverageFactor"),
    ("si:coverageInterval", "si:standardUnc", None),
)
"""Element, its uncertainty and its coverage factor: D-SI 2.2 first, then D-SI 2.1 and older."""


def _number(name: str, text: str | None) -> float:
    try:
        number = float(text or "")
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise CertificateError(f"{name!r} has {text!r} where a number belongs.", _OTHER_FORM)
    return number
