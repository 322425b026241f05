"""The materials file: the paper's tables with honest uncertainties."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from analysis.campaign import Quantity, Uncertainty
from impactd.settings.materials import UnknownMaterialError, load_materials
from impactd.settings.settings import SettingsError, find_config

# The paper's Tables 1 and 2: low and high modulus [Pa], low and high Poisson's ratio [1].
PAPER = {
    ("sphere", "steel"): (194e9, 194e9, 0.33, 0.33),
    ("sphere", "acetal"): (3.0e9, 3.3e9, 0.35, 0.35),
    ("sphere", "polypropylene"): (2.8e9, 3.5e9, 0.38, 0.38),
    ("sphere", "hdpe"): (1.08e9, 1.08e9, 0.35, 0.35),
    ("sphere", "ptfe"): (0.5e9, 0.5e9, 0.46, 0.46),
    ("sphere", "neoprene"): (0.082e9, 0.082e9, 0.499, 0.499),
    ("surface", "aluminium"): (69e9, 69e9, 0.33, 0.33),
    ("surface", "pvc"): (2.5e9, 4.0e9, 0.38, 0.41),
    ("surface", "polycarbonate"): (2.0e9, 2.4e9, 0.37, 0.37),
    ("surface", "ptfe"): (0.5e9, 0.5e9, 0.46, 0.46),
}
MODULUS_FLOOR, POISSON_FLOOR = 0.02, 0.01


@pytest.mark.parametrize(("role", "name"), PAPER)
def test_a_range_becomes_its_middle_and_its_rectangular_uncertainty(role: str, name: str) -> None:
    """Value = middle, u = half width / sqrt(3), never below the floor."""
    materials = load_materials(find_config("materials.toml"))
    entry = (materials.spheres if role == "sphere" else materials.surfaces)[name]
    low, high, nu_low, nu_high = PAPER[role, name]
    assert entry.youngs_modulus_pa is not None
    assert entry.poissons_ratio is not None
    middle = (low + high) / 2
    u = max((high - low) / 2 / math.sqrt(3), MODULUS_FLOOR * middle)
    assert entry.youngs_modulus_pa.value == pytest.approx(middle, rel=1e-3)
    assert entry.youngs_modulus_pa.u == pytest.approx(u, rel=0.01)
    assert entry.poissons_ratio.value == pytest.approx((nu_low + nu_high) / 2)
    nu_u = max((nu_high - nu_low) / 2 / math.sqrt(3), POISSON_FLOOR)
    assert entry.poissons_ratio.u == pytest.approx(nu_u, rel=0.01)


def test_every_shipped_ball_has_a_tolerance() -> None:
    """No radius and no mass of the materials that come along counts as exact."""
    materials = load_materials(find_config("materials.toml"))
    for ball in materials.spheres.values():
        assert ball.u_radius_m is not None
        assert ball.u_mass_kg is not None
        assert ball.radius_m is not None
        assert ball.mass_kg is not None
        assert 1e-4 < ball.u_radius_m.u / ball.radius_m < 0.03
        assert 1e-4 < ball.u_mass_kg.u / ball.mass_kg < 0.01
    steel = materials.spheres["steel"].u_radius_m
    assert steel is not None
    assert (steel.distribution, steel.traceable_to) == ("rectangular", "grade G100, not certified")


def test_the_small_acetal_ball_and_the_specimen_are_there() -> None:
    """A second radius, and a surface whose modulus is to be found."""
    materials = load_materials(find_config("materials.toml"))
    small = materials.spheres["acetal_small"]
    assert (small.radius_m, small.mass_kg) == (3.175e-3, 1.895e-4)
    specimen = materials.surfaces["specimen"]
    assert specimen.youngs_modulus_pa is None
    assert specimen.poissons_ratio is not None
    assert (specimen.poissons_ratio.value, specimen.poissons_ratio.u) == (0.37, 0.02)


def test_only_references_carry_a_calibration() -> None:
    """The reason names the flag and the references there are."""
    materials = load_materials(find_config("materials.toml"))
    assert materials.reference_surfaces == {"aluminium"}
    assert materials.why_no_reference("sphere", "steel") is None
    assert "reference = true" in str(materials.why_no_reference("surface", "specimen"))
    assert "no surface called" in str(materials.why_no_reference("surface", "glass"))


def test_an_unknown_name_lists_the_known_ones() -> None:
    """A request can be mended from the message alone."""
    materials = load_materials(find_config("materials.toml"))
    with pytest.raises(UnknownMaterialError, match="polycarbonate") as raised:
        materials.check("steel", "polycarbonat")
    assert (raised.value.role, raised.value.name) == ("surface", "polycarbonat")


@pytest.mark.parametrize(
    ("text", "path"),
    [
        ("radius_m = -1.0\nmass_kg = 1e-3", "sphere.a.radius_m"),
        ("radius_m = 1e-3\nmass_kg = nan", "sphere.a.mass_kg"),
        ("radius_m = 1e-3\nmass_kg = 1e-3\nradius = 2", "sphere.a.radius"),
        ("radius_m = 1e-3\nmass_kg = 1e-3\nreference = true", "sphere.a.reference"),
    ],
)
def test_a_wrong_material_is_refused_with_its_path(tmp_path: Path, text: str, path: str) -> None:
    """Negative, not a number, misspelt, or a reference without a modulus."""
    file = tmp_path / "materials.toml"
    entry = f"{text}\npoissons_ratio = {{ value = 0.3, u = 0.01 }}\nsource = 'x'\n"
    file.write_text(f"[sphere.a]\n{entry}[surface]\n", encoding="utf-8")
    with pytest.raises(SettingsError) as raised:
        load_materials(file)
    assert raised.value.path_in_file == path


def _written(tmp_path: Path, ball: str) -> Path:
    file = tmp_path / "materials.toml"
    text = f'[sphere.ball]\n{ball}\npoissons_ratio = {{ value = 0.35, u = 0.01 }}\nsource = "s"\n'
    surface = '[surface.plate]\npoissons_ratio = { value = 0.33, u = 0.01 }\nsource = "s"\n'
    file.write_text(text + surface + "coupon_mass_kg = { value = 8.1e-3, u = 1e-6 }\n")
    return file


def test_a_batch_says_how_far_its_balls_may_be_off(tmp_path: Path) -> None:
    """A tolerance is a rectangle; without one of its own the mass follows the diameter cubed."""
    ball = 'radius_m = 4.76e-3\nmass_kg = 6e-4\nbatch = { grade = "G200", traceable_to = "lot 3" }'
    materials = load_materials(_written(tmp_path, ball))
    found, half_m = materials.spheres["ball"], 71e-6
    assert found.u_radius_m is not None
    assert found.u_mass_kg is not None
    assert found.u_radius_m.u == pytest.approx(half_m / 2 / math.sqrt(3))
    assert found.u_mass_kg.u == pytest.approx(6e-4 * 3 * half_m / 9.52e-3 / math.sqrt(3))
    assert found.u_mass_kg.distribution == found.u_radius_m.distribution == "rectangular"
    assert found.u_mass_kg.traceable_to == "lot 3"
    plate = materials.surfaces["plate"]
    assert (plate.coupon_mass_kg, plate.u_coupon_mass_kg) == (8.1e-3, Uncertainty(1e-6))


def test_what_is_weighed_counts_instead_of_the_batch(tmp_path: Path) -> None:
    """A measured mass keeps its own uncertainty; the batch still speaks for the radius."""
    mass = '{ value = 6e-4, u = 2e-7, degrees_of_freedom = 9, traceable_to = "balance 4" }'
    tolerance = 'batch = { grade = "G1000", mass_tolerance_kg = 1e-5 }'
    found = load_materials(
        _written(tmp_path, f"radius_m = 4.76e-3\nmass_kg = {mass}\n{tolerance}")
    ).spheres["ball"]
    assert found.u_mass_kg == Uncertainty(2e-7, "normal", 9.0, "balance 4")
    assert found.u_radius_m is not None
    assert found.u_radius_m.u == pytest.approx(150e-6 / 2 / math.sqrt(3))


def test_an_unknown_grade_is_refused_with_those_there_are(tmp_path: Path) -> None:
    """The message lists the grades."""
    ball = 'radius_m = 4.76e-3\nmass_kg = 6e-4\nbatch = { grade = "G7" }'
    with pytest.raises(SettingsError, match=r"G3, G5.*G2000"):
        load_materials(_written(tmp_path, ball))


def test_a_modulus_may_follow_the_temperature(tmp_path: Path) -> None:
    """A coefficient comes with the temperature it starts from; 23 degC where nobody says."""
    text = find_config("materials.toml").read_text(encoding="utf-8")
    line = "modulus_coefficient_per_k = { value = -5e-3, u = 1e-3 }\n"
    assert "[surface.pvc]\n" in text
    text = text.replace("[surface.pvc]\n", "[surface.pvc]\nmodulus_temperature_c = 20.0\n" + line)
    text = text.replace("[sphere.hdpe]\n", "[sphere.hdpe]\n" + line)
    file = tmp_path / "materials.toml"
    file.write_text(text, encoding="utf-8")
    materials = load_materials(file)
    told = Quantity(-5e-3, 1e-3)
    assert materials.surfaces["pvc"].modulus_coefficient_per_k == told
    assert materials.surfaces["pvc"].modulus_temperature_c == 20.0
    assert materials.spheres["hdpe"].modulus_coefficient_per_k == told
    assert materials.spheres["hdpe"].modulus_temperature_c == 23.0
    assert materials.spheres["acetal"].modulus_coefficient_per_k is None
