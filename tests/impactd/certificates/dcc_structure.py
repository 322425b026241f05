"""What the schema of DCC 3.3.0 prescribes for the elements that this program writes.

The official schema (dcc.xsd and what it imports) is free (LGPL-3), but in no package of a registry,
so its text is not kept here: the rules were read in it and are restated, one pattern of children
per element. Two tests ask the schema itself: one where `IMPACTD_DCC_XSD` names it, one with
dcclib, which fetches it from the PTB.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET

CHILDREN = {
    "digitalCalibrationCertificate": "administrativeData measurementResults comment? document?",
    # xs:all: in any order; ours is the documentation's
    "administrativeData": "dccSoftware refTypeDefinitions? coreData items calibrationLaboratory "
    "respPersons customer statements?",
    "dccSoftware": "software+",
    "usedSoftware": "software+",
    "software": "name release type? description?",
    "coreData": "countryCodeISO3166_1 usedLangCodeISO639_1+ mandatoryLangCodeISO639_1+ "
    "uniqueIdentifier identifications? receiptDate? beginPerformanceDate endPerformanceDate "
    "performanceLocation issueDate? reportAmendedSubstituted? previousReport?",
    "items": "name? equipmentClass* description? owner? manufacturer? identifications? item+",
    "item": "name equipmentClass* description? owner? installedSoftwares? manufacturer? model? "
    "identifications itemQuantities? subItems?",
    "identifications": "identification+",
    "identification": "issuer value name?",
    "calibrationLaboratory": "calibrationLaboratoryCode? contact cryptElectronicSeal? "
    "cryptElectronicSignature? cryptElectronicTimeStamp?",
    "respPersons": "respPerson+",
    "respPerson": "person description? role? mainSigner? cryptElectronicSeal? "
    "cryptElectronicSignature? cryptElectronicTimeStamp?",
    "contact": "name eMail? phone? fax? link? location descriptionData?",
    "customer": "name eMail? phone? fax? link? location descriptionData?",
    "person": "name eMail? phone? fax? link? location? descriptionData?",
    "manufacturer": "name eMail? phone? fax? link? location? descriptionData?",
    "location": "(city|countryCode|postCode|postOfficeBox|state|street|streetNo|further)+",
    "statements": "statement+",
    "statement": "name? description? countryCodeISO3166_1* convention? traceable? norm* reference* "
    "link* declaration? valid? date? period? respAuthority? conformity? data?",
    "measurementResults": "usedMethods? usedSoftware? measuringEquipments? influenceConditions? "
    "measurementMetaData? measurementResult+",
    "measurementResult": "name description? usedMethods? usedSoftware? measuringEquipments? "
    "influenceConditions? results measurementMetaData?",
    "usedMethods": "usedMethod+",
    "usedMethod": "name description? norm* reference* link* usedMethodQuantities?",
    "measuringEquipments": "name? equipmentClass* description? owner? identifications? "
    "measuringEquipment+",
    "measuringEquipment": "name equipmentClass* description? certificate? manufacturer? model? "
    "identifications? measuringEquipmentQuantities? installedSoftware?",
    "influenceConditions": "influenceCondition+",
    "influenceCondition": "name description? status? certificate? data",
    "results": "result+",
    "result": "name description? data",
    "data": "(text|formula|byteData|xml|quantity|list)+",
    "quantity": "name? description? real relativeUncertainty? usedMethods? usedSoftware? "
    "measuringEquipments? influenceConditions? measurementMetaData?",
    "byteData": "name? description? fileName mimeType dataBase64",
    "name": "content+",
    "description": "name? content*",
    "declaration": "name? content*",
    "text": "name? content*",
    # D-SI 2.2
    "real": "label? quantityTypeQUDT? value unit significantDigit? dateTime? "
    "measurementUncertaintyUnivariate?",
    "measurementUncertaintyUnivariate": "(expandedMU|standardMU|coverageIntervalMU)",
    "expandedMU": "valueExpandedMU coverageFactor coverageProbability distribution?",
}
_NOT_EMPTY = r"\S+(\s+\S+)*"
_DECIMAL = r"[-+]?\d+(\.\d+)?([eE][-+]?\d+)?"
_DAY = r"\d{4}-\d{2}-\d{2}"
TEXTS = {
    "countryCodeISO3166_1": r"[A-Z]{2}", "countryCode": r"[A-Z]{2}",
    "usedLangCodeISO639_1": r"[a-z]{2}", "mandatoryLangCodeISO639_1": r"[a-z]{2}",
    "uniqueIdentifier": _NOT_EMPTY, "release": _NOT_EMPTY, "model": _NOT_EMPTY,
    "role": _NOT_EMPTY, "eMail": _NOT_EMPTY, "city": _NOT_EMPTY, "street": _NOT_EMPTY,
    "postCode": _NOT_EMPTY, "norm": _NOT_EMPTY, "reference": _NOT_EMPTY, "content": r"(?s).+",
    "fileName": _NOT_EMPTY, "mimeType": _NOT_EMPTY, "dataBase64": r"[A-Za-z0-9+/=]+",
    "type": r"application|bios|driver|editor|firmware|library|os|other",
    "issuer": r"manufacturer|calibrationLaboratory|customer|owner|other",
    "performanceLocation": r"laboratory|customer|laboratoryBranch|customerBranch|other",
    "mainSigner": r"true|false", "beginPerformanceDate": _DAY, "endPerformanceDate": _DAY,
    "issueDate": _DAY, "unit": r"(\\[a-z]+(\{[^{}]*\})?)+", "valueExpandedMU": _DECIMAL,
    "coverageFactor": _DECIMAL, "coverageProbability": r"0?\.\d+|0|1", "value": _NOT_EMPTY,
}  # fmt: skip
"""Pattern of the text of each element without children."""


def faults(root: ET.Element) -> list[str]:
    """Return what breaks a rule, with where it does."""
    return list(_faults(root, ""))


def _faults(element: ET.Element, where: str) -> list[str]:
    name = _local(element)
    here = f"{where}/{name}"
    children = "".join(f"{_local(one)} " for one in element)
    found = []
    if name in CHILDREN:
        if re.fullmatch(_pattern(CHILDREN[name]), children) is None:
            found.append(f"{here}: {children}is not {CHILDREN[name]}")
    elif children:
        found.append(f"{here} is not known to have children")
    elif name not in TEXTS:
        found.append(f"{here} is not known")
    elif re.fullmatch(TEXTS[name], element.text or "") is None:
        found.append(f"{here}: {element.text!r} is not {TEXTS[name]}")
    for one in element:
        found += _faults(one, here)
    return found


def _pattern(rule: str) -> str:
    return (
        re.sub(r"(\w+)", r"(?:\1 )", rule.replace(" ", ""))
        if "|" in rule
        else "".join(re.sub(r"^(\w+)([?*+]?)$", r"(?:\1 )\2", one) for one in rule.split())
    )


def _local(element: ET.Element) -> str:
    return element.tag.rpartition("}")[2]
