"""A load cell's certificate comes in as the prior of its gain, or is refused with the reason."""

from __future__ import annotations

import json
import shutil

import pytest

from impactd.certificates.cell_certificate import read_cell_certificate
from impactd.certificates.dsi_units import parse_unit
from impactd.certificates.errors import CertificateError
from impactd.storage.campaign_folder import read_campaign

OLD = (
    "<si:expandedUnc><si:uncertainty>{u}</si:uncertainty><si:coverageFactor>{k}</si:coverageFactor>"
    "<si:coverageProbability>0.95</si:coverageProbability></si:expandedUnc>"
)
NEW = (
    "<si:measurementUncertaintyUnivariate><si:expandedMU><si:valueExpandedMU>{u}"
    "</si:valueExpandedMU><si:coverageFactor>{k}</si:coverageFactor><si:coverageProbability>0.95"
    "</si:coverageProbability></si:expandedMU></si:measurementUncertaintyUnivariate>"
)
STANDARD = (
    "<si:measurementUncertaintyUnivariate><si:standardMU><si:valueStandardMU>{u}"
    "</si:valueStandardMU></si:standardMU></si:measurementUncertaintyUnivariate>"
)


def quantity(value, unit, uncertainty=NEW, *, u=1.0, k=2, name="Sensitivity"):
    """Return a quantity as laboratories write it."""
    return (
        f'<dcc:quantity><dcc:name><dcc:content lang="en">{name}</dcc:content></dcc:name><si:real>'
        f"<si:value>{value}</si:value><si:unit>{unit}</si:unit>{uncertainty.format(u=u, k=k)}"
        "</si:real></dcc:quantity>"
    )


@pytest.fixture
def laboratory(tmp_path):
    """Return a maker of another laboratory's certificates."""

    def make(*quantities, version="3.2.1"):
        file = tmp_path / "cell.xml"
        file.write_text(
            f"""<?xml version="1.0" encoding="UTF-8"?>
<dcc:digitalCalibrationCertificate xmlns:dcc="https://ptb.de/dcc" xmlns:si="https://ptb.de/si"
 schemaVersion="{version}"><dcc:administrativeData><dcc:coreData>
<dcc:uniqueIdentifier>K-4711</dcc:uniqueIdentifier>
<dcc:endPerformanceDate>2026-02-03</dcc:endPerformanceDate></dcc:coreData>
<dcc:items><dcc:item><dcc:identifications><dcc:identification><dcc:issuer>manufacturer</dcc:issuer>
<dcc:value>SN 88</dcc:value></dcc:identification></dcc:identifications></dcc:item></dcc:items>
<dcc:calibrationLaboratory><dcc:contact><dcc:name><dcc:content>Force Lab</dcc:content></dcc:name>
</dcc:contact></dcc:calibrationLaboratory></dcc:administrativeData>
<dcc:measurementResults><dcc:measurementResult><dcc:results><dcc:result><dcc:data>
{"".join(quantities)}
</dcc:data></dcc:result></dcc:results></dcc:measurementResult></dcc:measurementResults>
</dcc:digitalCalibrationCertificate>""",
            "utf-8",
        )
        return file

    return make


@pytest.mark.parametrize(
    ("value", "unit", "form", "u", "k", "gain", "gain_u"),
    [
        (500, r"\milli\volt\newton\tothe{-1}", NEW, 10, 2, 2.0, 0.02),
        (0.5, r"\volt\per\newton", OLD, 0.02, 2, 2.0, 0.04),
        (500, r"\volt\kilo\newton\tothe{-1}", STANDARD, 5, 1, 2.0, 0.02),
        (2, r"\newton\per\volt", NEW, 0.09, 3, 2.0, 0.03),
    ],
)
def test_a_sensitivity_becomes_the_gain(laboratory, value, unit, form, u, k, gain, gain_u):  # noqa: PLR0917 - pytest fills them by name
    """Any prefix, either direction, D-SI 2.2 and older, expanded and standard uncertainties."""
    file = laboratory(quantity(70, r"\kilogram"), quantity(value, unit, form, u=u, k=k))
    found = read_cell_certificate(file)
    assert found.values["hsd_n_per_v"].value == pytest.approx(gain)
    assert found.values["hsd_n_per_v"].u == pytest.approx(gain_u)
    assert (found.identifier, found.laboratory) == ("K-4711", "Force Lab")
    assert found.serial_numbers == ("SN 88",)


def test_of_several_sensitivities_one_is_chosen(laboratory):
    """The ranges of a cell are never mixed: each is named, and one is taken by its name."""
    unit = r"\volt\per\newton"
    file = laboratory(
        quantity(0.5, unit, u=0.01, name="range 1"), quantity(0.05, unit, u=0.001, name="range 2")
    )
    with pytest.raises(CertificateError, match=r"'range 1', 'range 2'.*--quantity"):
        read_cell_certificate(file)
    found = read_cell_certificate(file, named="range 2")
    assert found.values["hsd_n_per_v"].value == pytest.approx(20.0)
    with pytest.raises(CertificateError, match="has no quantity 'range 3'"):
        read_cell_certificate(file, named="range 3")


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (quantity(4, r"\pico\coulomb\per\newton"), "conditioner"),
        (quantity(0.5, r"\volt\per\newton", ""), "no expanded uncertainty"),
        (quantity(0.5, r"\volt\per\newton", u=0), "positive uncertainty"),
        (quantity(0.5, r"\volt\per\newton", k=0.5), "coverage factor"),
        (quantity(-0.5, r"\volt\per\newton"), "positive"),
        (quantity("about 2", r"\volt\per\newton"), "number belongs"),
        (
            "<dcc:quantity><si:realListXMLList><si:valueXMLList>1 2</si:valueXMLList>"
            r"<si:unitXMLList>\volt\per\newton</si:unitXMLList></si:realListXMLList></dcc:quantity>",
            "list of values",
        ),
    ],
)
def test_what_gives_no_prior_is_refused(laboratory, content, said):
    """A charge, a value without uncertainty or k, a list: nothing is assumed."""
    with pytest.raises(CertificateError, match=said):
        read_cell_certificate(laboratory(content))


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("", "no XML"),
        ("<a/>", "no DCC"),
        ('<!DOCTYPE a [<!ENTITY b "b">]><a>&b;</a>', "document type"),
        ("<dcc:digitalCalibrationCertificate xmlns:dcc='https://ptb.de/dcc'/>", "version"),
    ],
)
def test_what_is_no_certificate_is_refused(tmp_path, content, said):
    """Other XML, entities, another version: one sentence says what to do."""
    file = tmp_path / "other.xml"
    file.write_text(content)
    with pytest.raises(CertificateError, match=said):
        read_cell_certificate(file)


@pytest.mark.parametrize(
    "unit", ["V/N", r"\volt\per", r"\kilo", r"\volt\tothe{x}", r"\furlong", ""]
)
def test_units_that_are_none_are_refused(unit):
    """A unit that is not read in full is not read at all."""
    with pytest.raises(CertificateError, match="cannot be read"):
        parse_unit(unit)


def test_a_campaign_takes_the_prior(laboratory, folder, run, tmp_path):
    """It stands where a campaign keeps the cell; another value there is not replaced silently."""
    copied = tmp_path / "campaign"
    shutil.copytree(folder.parent if folder.is_file() else folder, copied)

    def read(volts_per_newton, *more):
        """Read a certificate into the campaign; return its gain."""
        certificate = laboratory(quantity(volts_per_newton, r"\volt\per\newton", u=0.01))
        result = run("certificate", "read", certificate, "--campaign", copied, *more)
        gain = read_campaign(copied).sensor.hsd_n_per_v
        return result, (gain.value, gain.u)

    assert read(0.5)[1] == pytest.approx((2.0, 0.02))
    assert read(0.5)[0].exit_code == 0  # the same value again
    other, gain = read(0.25)
    assert "--replace" in str(other.exception)
    assert gain == pytest.approx((2.0, 0.02))
    assert read(0.25, "--replace")[1] == pytest.approx((4.0, 0.08))


def test_lines_for_the_settings_are_printed(laboratory, run):
    """They say whose certificate it is, and are TOML as [sensor] takes it."""
    said = run("certificate", "read", laboratory(quantity(0.5, r"\volt\per\newton", u=0.01))).output
    assert "# certificate K-4711 of Force Lab, 2026-02-03" in said
    assert 'certificate = "K-4711"' in said
    assert "hsd_n_per_v = { value = 2, u = 0.02 }" in said


def test_our_own_certificate_comes_back(certificate, rig, run):
    """All five quantities of the cell, with half the expanded uncertainty."""
    said = run("certificate", "read", certificate, "--json")
    values = json.loads(said.output)["values"]
    for key, stated in rig.result["parameters"].items():
        assert values[key]["value"] == pytest.approx(stated["value"], rel=1e-8)
        assert values[key]["u"] == pytest.approx(stated["u"], rel=1e-3)
    gain = rig.result["hsd"]["gain_N_per_V"]
    assert values["hsd_n_per_v"]["value"] == pytest.approx(gain["value"], rel=1e-8)
    assert len(values) == 5
