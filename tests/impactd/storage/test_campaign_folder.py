"""Campaign folders: every field is looked at, and one bad shot sinks nobody else."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analysis.fit.fit_shot import usable_shots
from analysis.fit.problem import build
from analysis.model.impact_model import model_named
from impactd.storage.archive import ArchiveError
from impactd.storage.campaign_folder import read_campaign, read_campaign_folder, write_campaign
from impactd.storage.errors import CampaignError

Make = Callable[..., Path]
Root = dict[str, Any]
SHARED = Path(__file__).resolve().parents[4] / "shared"


def test_a_good_folder_reads_whole(campaign_folder: Make) -> None:
    """Codes become volts, and every known quantity arrives where the analysis looks for it."""
    folder = campaign_folder()

    campaign = read_campaign(folder)
    shot = campaign.shots[0]

    assert len(campaign.shots) == 3
    assert campaign.rejected == ()
    assert shot.signal[230] == np.load(folder / "shot000.npy")[230] * 0.00030517578125
    assert (shot.quantum, shot.trigger_index, shot.drop_height_m) == (0.00030517578125, 200, 0.047)
    assert shot.restitution is not None
    assert shot.restitution.value == 0.82
    assert campaign.sensor.crystal_stiffness_n_per_m is not None
    assert campaign.sensor.crystal_stiffness_n_per_m.u == 4.2e7
    assert campaign.surfaces["specimen"].youngs_modulus_pa is None
    assert campaign.spheres["acetal"].mass_kg == 0.0006116
    assert (campaign.gravity_m_per_s2, campaign.speed_repeatability) == (9.81, 0.003)


def test_the_json_file_itself_may_be_named(campaign_folder: Make) -> None:
    """Folder and campaign.json are the same campaign."""
    folder = campaign_folder()

    assert len(read_campaign(folder / "campaign.json").shots) == 3


def test_what_is_absent_is_unknown(campaign_folder: Make) -> None:
    """Without sensor, release, materials and heights the rest still reads."""

    def strip(root: Root, _: Path) -> None:
        for key in ("sensor", "release", "gravity_m_per_s2"):
            del root[key]
        root["spheres"]["acetal"] = {}
        for shot in root["shots"]:
            for key in ("drop_height_m", "restitution", "sphere", "surface"):
                del shot[key]

    campaign = read_campaign(campaign_folder(strip))

    assert campaign.speed_repeatability is None
    assert campaign.sensor.hsd_n_per_v is None
    assert campaign.spheres["acetal"].radius_m is None
    assert campaign.shots[0].sphere is None


def _set(*path: str | int, to: object) -> Callable[[Root, Path], None]:
    def change(root: Root, _: Path) -> None:
        place: Any = root
        for key in path[:-1]:
            place = place[key]
        place[path[-1]] = to

    return change


WHOLE = [
    (_set("format", to="impactd-campaign/2"), "$.format", "impactd-campaign/1"),
    (_set("gravity_m_per_s2", to=-1), "$.gravity_m_per_s2", "between 0.0001"),
    (_set("gravity_m_per_s2", to=True), "$.gravity_m_per_s2", "must be a number"),
    (_set("gravity_m_per_s2", to=10**400), "$.gravity_m_per_s2", "finite"),
    (_set("gravity", to=9.81), "$.gravity", "gravity_m_per_s2"),
    (_set("release", to=3), "$.release", "object"),
    (_set("release", "speed_repeatability", to=-0.1), "$.release.speed_repeatability", "between"),
    (_set("sensor", "crystal_mass_kg", to=0.03), "$.sensor.crystal_mass_kg", "object"),
    (_set("sensor", "crystal_mass_kg", to={"value": 0.03}), "$.sensor.crystal_mass_kg.u", "uncer"),
    (
        _set("sensor", "crystal_mass_kg", to={"value": 0, "u": 1}),
        "$.sensor.crystal_mass_kg.value",
        "between 1e-09",
    ),
    (
        _set("sensor", "hsd_N_per_V", to={"value": 1, "u": -1}),
        "$.sensor.hsd_N_per_V.u",
        "between 0",
    ),
    (_set("sensor", "complience_m_per_V", to={}), "$.sensor.complience_m_per_V", "compliance"),
    (_set("sensor", "log_covariance", to=[[1]]), "$.sensor.log_covariance", "(4, 4)"),
    (_set("sensor", "log_covariance", to=[["x"]]), "$.sensor.log_covariance", "numbers"),
    (_set("spheres", "acetal", "mass_kg", to=-0.1), "$.spheres.acetal.mass_kg", "1e+06 kg"),
    (_set("spheres", "acetal", "mass", to=0.1), "$.spheres.acetal.mass", "mass_kg"),
    (_set("spheres", "acetal", "radius_m", to=4.76), "$.spheres.acetal.mass_kg", "in metres"),
    (_set("spheres", "acetal", "mass_kg", to=0.6116), "$.spheres.acetal.mass_kg", "in kilograms"),
    (_set("spheres", "acetal", "radius_m", to="5 mm"), "$.spheres.acetal.radius_m", "number"),
    (
        _set("surfaces", "specimen", "poissons_ratio", to={"value": 0.6, "u": 0.1}),
        "$.surfaces.specimen.poissons_ratio.value",
        "between",
    ),
    (_set("surfaces", to=[]), "$.surfaces", "object"),
    (_set("shots", to={}), "$.shots", "array"),
    (_set("shots", to=[]), "$.shots", "at least one"),
]


@pytest.mark.parametrize(("change", "path", "reason"), WHOLE, ids=[row[1] for row in WHOLE])
def test_a_bad_folder_is_refused_with_path_and_reason(
    campaign_folder: Make, change: Callable[[Root, Path], None], path: str, reason: str
) -> None:
    """What is wrong with the folder as a whole names file, JSON path and reason."""
    folder = campaign_folder(change)

    with pytest.raises(CampaignError) as caught:
        read_campaign(folder)

    assert caught.value.json_path == path
    assert reason in caught.value.reason
    assert caught.value.file == str(folder / "campaign.json")


def _file(write: Callable[[Path], None], name: str = "shot001.npy") -> Callable[[Root, Path], None]:
    def change(root: Root, folder: Path) -> None:
        (folder / "shot001.npy").unlink()
        root["shots"][1]["file"] = name
        write(folder / name)

    return change


def _saved(values: Any) -> Callable[[Root, Path], None]:
    return _file(lambda path: np.save(path, values, allow_pickle=True))


def _holding(position: int, value: float) -> np.ndarray:
    values = np.random.default_rng(0).normal(size=500)
    values[position] = value
    return values


def _csv(text: str) -> Callable[[Root, Path], None]:
    return _file(lambda path: path.write_text(text) and None, "shot001.csv")


SHOT = [
    (_set("shots", 1, to=7), "$.shots[1]", "object"),
    (_set("shots", 1, "file", to=None), "$.shots[1].file", "missing"),
    (_set("shots", 1, "file", to="nowhere.npy"), "$.shots[1].file", "does not exist"),
    (_set("shots", 1, "file", to="../other.npy"), "$.shots[1].file", "outside"),
    (_set("shots", 1, "file", to="/etc/passwd"), "$.shots[1].file", "outside"),
    (_set("shots", 1, "file", to="campaign.json"), "$.shots[1].file", "neither"),
    (_set("shots", 1, "file", to="a\0b.npy"), "$.shots[1].file", "U+0000"),
    (_set("shots", 1, "sample_rate_Hz", to=0), "$.shots[1].sample_rate_Hz", "between 1 "),
    (_set("shots", 1, "sample_rate_Hz", to=None), "$.shots[1].sample_rate_Hz", "missing"),
    (_set("shots", 1, "sample_rate_hz", to=1), "$.shots[1].sample_rate_hz", "sample_rate_Hz"),
    (_set("shots", 1, "samples", to=501), "$.shots[1].samples", "has 500"),
    (_set("shots", 1, "volts_per_code", to=None), "$.shots[1].volts_per_code", "integer codes"),
    (_set("shots", 1, "volts_per_code", to=-1), "$.shots[1].volts_per_code", "between 1e-15"),
    (_set("shots", 1, "trigger_index", to=500), "$.shots[1].trigger_index", "500 samples only"),
    (_set("shots", 1, "trigger_index", to=-1), "$.shots[1].trigger_index", "between 0"),
    (_set("shots", 1, "trigger_index", to=-5), "$.shots[1].trigger_index", "is -5; it must be"),
    (_set("shots", 1, "file", to="shot000.npy"), "$.shots[1].file", "is $.shots[0] already"),
    (_set("shots", 1, "trigger_index", to=2.5), "$.shots[1].trigger_index", "whole"),
    (_set("shots", 1, "trigger_index", to=None), "$.shots[1].trigger_index", "missing"),
    (_set("shots", 1, "sphere", to="marble"), "$.shots[1].sphere", "not described"),
    (_set("shots", 1, "surface", to="sand"), "$.shots[1].surface", "specimen"),
    (_set("shots", 1, "drop_height_m", to=0), "$.shots[1].drop_height_m", "100 m"),
    (_set("shots", 1, "drop_height", to=47), "$.shots[1].drop_height", "drop_height_m"),
    (
        _set("shots", 1, "restitution", to={"value": 1.2, "u": 0.1}),
        "$.shots[1].restitution.value",
        "between",
    ),
    (_set("shots", 1, "quantity", to="pressure"), "$.shots[1].quantity", "force_N"),
    (_saved(_holding(77, np.nan)), "$.shots[1].file", "first at sample 77"),
    (_saved(_holding(5, np.inf)), "$.shots[1].file", "infinity"),
    (_saved(np.full(500, 3.5)), "$.shots[1].file", "flat"),
    (_saved(np.zeros((2, 500))), "$.shots[1].file", "one-dimensional"),
    (_saved(np.arange(9.0)), "$.shots[1].file", "9 samples"),
    (_saved(np.array([], float)), "$.shots[1].file", "0 samples"),
    (_saved(np.zeros(500, complex)), "$.shots[1].file", "integers or floats"),
    (_saved(np.array([{"a": 1}] * 500)), "$.shots[1].file", "integers or floats"),
    (_file(lambda path: path.write_bytes(b"junk") and None), "$.shots[1].file", "no .npy file"),
    (_file(lambda path: path.write_bytes(b"") and None), "$.shots[1].file", "no .npy file"),
    (_file(lambda path: path.mkdir()), "$.shots[1].file", "a directory"),
    (
        _file(lambda path: path.write_bytes(b"x") and None, "shot.wav"),
        "$.shots[1].file",
        "neither",
    ),
    (_csv("t,v\n0,1\n"), "$.shots[1].file", "header"),
    (_csv("time_s,volts\n"), "$.shots[1].file", "shape"),
    (_csv("time_s,volts\n0,1\n1e-6,x\n"), "$.shots[1].file", "no table"),
    (_csv("time_s,volts\n0,1\n1e-6,2,3\n"), "$.shots[1].file", "no table"),
    (_csv("time_s,volts\n0,1\n0,2\n"), "$.shots[1].file", "does not rise"),
    (_csv("time_s,volts\n0,1\n1e-6,2\n5e-6,2\n6e-6,1\n"), "$.shots[1].file", "not sampled evenly"),
    (
        _csv("time_s,volts\n" + "".join(f"{i * 2e-6},{i % 7}\n" for i in range(500))),
        "$.shots[1].sample_rate_Hz",
        "time column",
    ),
]


@pytest.mark.parametrize(
    ("change", "path", "reason"), SHOT, ids=[f"{row[1]}-{row[2]}" for row in SHOT]
)
def test_a_bad_shot_is_listed_and_the_rest_goes_on(
    campaign_folder: Make, change: Callable[[Root, Path], None], path: str, reason: str
) -> None:
    """What is wrong with one shot is told under ``rejected``; the two others are read."""
    campaign = read_campaign(campaign_folder(change))

    (rejected,) = campaign.rejected
    assert rejected.path == path
    assert reason in rejected.reason
    assert [shot.name for shot in campaign.shots] == ["shot000.npy", "shot002.npy"]


def test_two_blows_in_one_file_are_two_shots(campaign_folder: Make) -> None:
    """What tells them apart is where each begins."""

    def change(root: Root, _: Path) -> None:
        root["shots"][1] |= {"file": "shot000.npy", "trigger_index": 210}

    assert not read_campaign(campaign_folder(change)).rejected


def test_a_refused_shot_goes_by_its_name(campaign_folder: Make) -> None:
    """Its name, where it has one, stands in place of the file's, as in every result."""

    def change(root: Root, _: Path) -> None:
        root["shots"][1] |= {"name": "Monday 2", "sphere": "marble"}

    (rejected,) = read_campaign(campaign_folder(change)).rejected

    assert rejected.name == "Monday 2"


def test_a_shot_without_a_pulse_is_listed_with_its_place(campaign_folder: Make) -> None:
    """What only the fit can see is refused with name, JSON path and reason, too."""

    def change(root: Root, folder: Path) -> None:
        root["shots"][1]["trigger_index"] = 2000
        noise = np.random.default_rng(1).normal(0.0, 5.0, 4000)
        np.save(folder / "shot001.npy", noise.astype(np.int16))

    _, (rejected,) = usable_shots(read_campaign(campaign_folder(change)))

    assert (rejected.name, rejected.path) == ("shot001.npy", "$.shots[1]")
    assert "no more than noise" in rejected.reason


def test_a_gravity_that_nobody_stated_is_told(campaign_folder: Make) -> None:
    """The standard value is taken, and every result says so where a height rests on it."""

    def change(root: Root, _: Path) -> None:
        del root["gravity_m_per_s2"]

    campaign = read_campaign(campaign_folder(change))
    problem = build(campaign, model_named("kv"))

    assert campaign.gravity_m_per_s2 == 9.80665
    assert any("No gravity_m_per_s2 given" in one for one in problem.assumptions)


def test_the_mark_of_a_windows_editor_is_read_over(campaign_folder: Make) -> None:
    """A campaign.json that begins with a byte order mark reads like one without."""
    folder = campaign_folder()
    file = folder / "campaign.json"
    file.write_bytes(b"\xef\xbb\xbf" + file.read_bytes())

    assert len(read_campaign(folder).shots) == 3


def test_a_link_out_of_the_folder_is_not_followed(campaign_folder: Make, tmp_path: Path) -> None:
    """A symbolic link that leaves the folder is refused like a path that does."""
    np.save(tmp_path / "secret.npy", np.arange(500))

    def change(_: Root, folder: Path) -> None:
        (folder / "shot001.npy").unlink()
        (folder / "shot001.npy").symlink_to(tmp_path / "secret.npy")

    (rejected,) = read_campaign(campaign_folder(change)).rejected

    assert "outside" in rejected.reason


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("{", "not JSON"),
        ('{"gravity_m_per_s2": NaN}', "no JSON number"),
        ('{"format": 1, "format": 2}', "twice"),
        ("[]", "must be an object"),
        ("[" * 100_000, "nested"),
        ("\udcff", "not UTF-8"),
    ],
)
def test_what_is_no_json_is_refused(tmp_path: Path, text: str, reason: str) -> None:
    """Broken JSON, NaN, repeated keys and wrong encodings have their sentence."""
    (tmp_path / "campaign.json").write_bytes(text.encode("utf-8", "surrogateescape"))

    with pytest.raises(CampaignError, match=reason):
        read_campaign(tmp_path)


def test_a_missing_campaign_is_refused(tmp_path: Path) -> None:
    """A folder without campaign.json says which file is missing."""
    with pytest.raises(CampaignError, match=r"no campaign\.json.*impactd new"):
        read_campaign(tmp_path)


def test_notes_of_people_are_tolerated(campaign_folder: Make) -> None:
    """Keys nobody knows and nobody could have meant are left alone."""
    change = _set("shots", 0, "source_file", to="accel_5.csv")

    assert read_campaign(campaign_folder(change)).rejected == ()


def test_csv_reads_like_npy(campaign_folder: Make) -> None:
    """A csv of volts gives the same signal, and its own sample rate where none is stated."""

    def change(root: Root, folder: Path) -> None:
        volts = np.load(folder / "shot001.npy") * 0.00030517578125
        rows = "".join(f"{i * 1e-6:.7f},{v!r}\n" for i, v in enumerate(volts.tolist()))
        (folder / "shot001.csv").write_text("time_s,volts\n" + rows)
        root["shots"][1]["file"] = "shot001.csv"
        del root["shots"][1]["sample_rate_Hz"]

    folder = campaign_folder(change)
    campaign = read_campaign(folder)

    assert campaign.rejected == ()
    assert campaign.shots[1].sample_rate_hz == pytest.approx(1e6)
    assert np.array_equal(
        campaign.shots[1].signal, np.load(folder / "shot001.npy") * 0.00030517578125
    )


def test_a_clipped_shot_is_kept_and_flagged(campaign_folder: Make) -> None:
    """A record on a limit is no bad record."""

    def change(_: Root, folder: Path) -> None:
        codes = np.load(folder / "shot001.npy")
        np.save(folder / "shot001.npy", np.minimum(codes, 2500))

    campaign = read_campaign(campaign_folder(change))

    assert [shot.clipped for shot in campaign.shots] == [False, True, False]


def test_what_is_written_reads_back(campaign_folder: Make, tmp_path: Path) -> None:
    """Codes, quantities and materials survive a round trip unchanged."""
    first = read_campaign_folder(campaign_folder())

    path = write_campaign(
        tmp_path / "copy", first.campaign, tuple(one.recording for one in first.shots)
    )
    second = read_campaign_folder(path)

    assert second.campaign.spheres == first.campaign.spheres
    assert second.campaign.surfaces == first.campaign.surfaces
    assert second.campaign.sensor == first.campaign.sensor
    for before, after in zip(first.shots, second.shots, strict=True):
        assert np.array_equal(before.shot.signal, after.shot.signal)
        assert after.recording.samples.dtype == before.recording.samples.dtype
        assert after.shot.quantum == before.shot.quantum
        assert after.shot.code_zero == before.shot.code_zero
        assert after.shot.restitution == before.shot.restitution
    with pytest.raises(ArchiveError, match="already"):
        write_campaign(tmp_path / "copy", first.campaign)


@pytest.mark.parametrize(
    ("folder", "shots", "quantity"),
    [
        ("campaigns/clean", 54, "voltage"),
        ("campaigns/highpass", 54, "voltage"),
        ("data/drop-tower", 5, "acceleration_m_per_s2"),
        ("data/repeated-shock", 51, "acceleration_m_per_s2"),
        ("data/sphere-taps", 99, "voltage"),
    ],
)
def test_shared_campaigns_read_whole(folder: str, shots: int, quantity: str) -> None:
    """The recordings that others made all read, and none is called clipped."""
    path = SHARED / folder
    if not path.exists():
        pytest.skip(f"{path} is not here")

    campaign = read_campaign(path)

    assert (len(campaign.shots), campaign.rejected) == (shots, ())
    assert {shot.quantity for shot in campaign.shots} == {quantity}
    assert not any(shot.clipped for shot in campaign.shots)
    listed = json.loads((path / "campaign.json").read_text())["shots"]
    assert [shot.name for shot in campaign.shots] == [one["file"] for one in listed]


@pytest.mark.parametrize("header", ["volts", "acceleration_m_per_s2"])
def test_both_headers_of_a_csv_are_read_where_quantity_says_so(tmp_path, header):
    """`time_s,volts` is the general header; the quantity's own is accepted as well."""
    times = np.arange(400) * 1e-5
    signal = np.sin(times * 1e3) + 2.0
    rows = "\n".join(f"{t:.6f},{x:.6f}" for t, x in zip(times, signal, strict=True))
    (tmp_path / "a.csv").write_text(f"time_s,{header}\n{rows}\n")
    shot = {"file": "a.csv", "name": "Monday 1", "trigger_index": 10}
    shot["quantity"] = "acceleration_m_per_s2"
    document = {"format": "impactd-campaign/1", "shots": [shot]}
    (tmp_path / "campaign.json").write_text(json.dumps(document))
    (read,) = read_campaign(tmp_path).shots
    assert read.name == "Monday 1"
    assert read.quantity == "acceleration_m_per_s2"
