"""The elements that every DCC is made of: text, a contact, a quantity with its uncertainty."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from typing import Any

from impactd.settings.certificate import Contact

DCC = "https://ptb.de/dcc"
SI = "https://ptb.de/si"
SCHEMA_VERSION = "3.3.0"
LANGUAGE = "en"
COVERAGE_FACTOR = 2.0
"""k of every expanded uncertainty, as calibration laboratories state it (EA-4/02)."""
COVERAGE_PROBABILITY = 0.95
"""Of that k in round figures, as the same guide states it; 0.9545 of a normal distribution."""
NAMESPACES = {"dcc": DCC, "si": SI}

for _prefix, _address in NAMESPACES.items():
    ET.register_namespace(_prefix, _address)


def child(parent: ET.Element, name: str, text: str | None = None, **attributes: str) -> ET.Element:
    """Append an element.

    Parameters
    ----------
    name : str
        With its prefix: ``dcc:coreData``.
    """
    prefix, _, local = name.partition(":")
    made = ET.SubElement(parent, f"{{{NAMESPACES[prefix]}}}{local}", attributes)
    made.text = text
    return made


def worded(parent: ET.Element, name: str, text: str) -> ET.Element:
    """Append an element that holds a text in the certificate's language."""
    made = child(parent, name)
    child(made, "dcc:content", text, lang=LANGUAGE)
    return made


def contact(parent: ET.Element, name: str, who: Contact) -> ET.Element:
    """Append a contact with its address; what nobody stated is left out."""
    made = child(parent, name)
    worded(made, "dcc:name", who.name)
    if who.e_mail is not None:
        child(made, "dcc:eMail", who.e_mail)
    location = child(made, "dcc:location")
    if who.street is not None:
        child(location, "dcc:street", who.street)
    if who.post_code is not None:
        child(location, "dcc:postCode", who.post_code)
    child(location, "dcc:city", who.city)
    child(location, "dcc:countryCode", who.country_code)
    return made


def quantity(
    parent: ET.Element, name: str, measured: Mapping[str, Any], unit: str, ref_type: str
) -> ET.Element:
    """Append a quantity with its expanded uncertainty.

    Parameters
    ----------
    measured : mapping
        ``value`` and its standard uncertainty ``u``, in the unit.
    unit : str
        As the D-SI writes it.
    ref_type : str
        What a program finds it by; several words where it is known by several.
    """
    made = child(parent, "dcc:quantity", refType=ref_type)
    worded(made, "dcc:name", name)
    real = child(made, "si:real")
    child(real, "si:value", f"{measured['value']:.10g}")
    child(real, "si:unit", unit)
    stated = child(child(real, "si:measurementUncertaintyUnivariate"), "si:expandedMU")
    child(stated, "si:valueExpandedMU", f"{COVERAGE_FACTOR * measured['u']:.4g}")
    child(stated, "si:coverageFactor", f"{COVERAGE_FACTOR:g}")
    child(stated, "si:coverageProbability", f"{COVERAGE_PROBABILITY:g}")
    return made
