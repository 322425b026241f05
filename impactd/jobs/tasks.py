"""The tasks of a worker: every function takes an order and gives a result, both JSON.

This is the one place where the daemon calls the analysis for stored shots. An order comes from
`impactd.jobs.orders`, a result goes to `impactd.jobs.results`.
"""

from __future__ import annotations

import base64
import dataclasses
import tempfile
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import numpy as np

from analysis import calibrate as analysis_calibrate
from analysis import fit_campaign as analysis_fit_campaign
from analysis.base_models import BASE_MODELS
from analysis.campaign import Campaign, Quantity, Sensor, Shot, Sphere, Surface, Uncertainty
from analysis.diagnosis.named_model import fit_named
from analysis.errors import AnalysisError
from analysis.fit.result import FitResult
from impactd.aliases import Json
from impactd.jobs.curves import curve_of
from impactd.jobs.progress import report
from impactd.jobs.rebound import check_rebound, with_later_landings, with_restitution
from impactd.storage.assemble import assemble_campaign
from impactd.storage.campaign_digest import campaign_files
from impactd.storage.campaign_folder import read_campaign
from impactd.storage.json_fields import Fields
from impactd.storage.materials_json import (
    SENSOR_KEYS,
    sensor_from_json,
    sphere_from_json,
    surface_from_json,
)
from impactd.storage.shot_metadata import StoredShot
from impactd.storage.shot_store import read_shot
from impactd.storage.version import software

FORMAT = "impactd-shot-fit/1"


@dataclass(frozen=True)
class _Known:
    """Materials as an order carries them."""

    spheres: dict[str, Sphere]
    surfaces: dict[str, Surface]


def fit_shot(order: Json) -> Json:
    """Fit one shot with each of the order's models; return ``fits``, one result for each."""
    (stored,) = _read(order)
    campaign = campaign_of(order, [stored])
    fits = []
    for position, model in enumerate(order["models"]):
        report(f"fitting {model}", position / len(order["models"]))
        try:
            result = _fit_one(campaign, model, _definition(order, model))
            found = _shot_result(result, stored)
            checked = check_rebound(
                stored.metadata, order["shots"][0].get("rebound_height_m"), result
            )
            flags = sorted({*found["flags"], *checked.pop("flags", ())})
            found |= {**checked, "flags": flags}
            if order.get("with_curves") and result.shots:
                found["curve"] = curve_of(result.shots[0])
        except AnalysisError as error:
            # This model cannot be fitted to this shot; the others may. An outcome, not a failure.
            outcome = {"status": "not_evaluable", "message": str(error)}
            found = {"format": FORMAT, "model": model, "outcome": outcome, "flags": []}
        fits.append({**found, **_provenance(order, [stored]), **_version(order, model)})
    return {"fits": fits}


def fit_campaign(order: Json) -> Json:
    """Fit several shots together; return ``fit``: ``impactd-fit/1``."""
    shots = _read(order)
    campaign, model = campaign_of(order, shots), order["model"]
    definition = _definition(order, model)
    campaign = with_later_landings(campaign, model, definition)
    if definition is None:
        result = analysis_fit_campaign(campaign, model, progress=report)
    else:
        result = fit_named(campaign, definition, progress=report)
    return {"fit": {**result.to_json(), **_provenance(order, shots), **_version(order, model)}}


def calibrate(order: Json) -> Json:
    """Calibrate the load cell from drops of known spheres on known surfaces.

    Return ``calibration``: ``impactd-calibration/1``.
    """
    shots = _read(order)
    campaign, model = campaign_of(order, shots), order["model"]
    campaign = with_later_landings(campaign, model, _definition(order, model))
    result = analysis_calibrate(campaign, model, progress=report)
    return {"calibration": {**result.to_json(), **_provenance(order, shots)}}


def diagnose(order: Json) -> Json:
    """Diagnose stored shots, or the campaign folder ``campaign``.

    Return ``diagnosis``: ``impactd-diagnosis/1``, and ``report_html``: its page. It is made here,
    because drawing takes a second that the sample stream should not have to share.
    """
    from impactd.diagnosis.report import page  # noqa: PLC0415 - matplotlib, when it is needed
    from impactd.diagnosis.run import diagnose as close_the_loop  # noqa: PLC0415

    if "campaign" in order:
        path = Path(order["campaign"])
        campaign, origin = read_campaign(path, calibrated=False), _origin(path)
    else:
        shots = _read(order)
        campaign, origin = campaign_of(order, shots), _provenance(order, shots)
    found = close_the_loop(
        campaign,
        order["base"],
        budget_s=order.get("budget_s"),
        progress=report,
    )
    return {
        "diagnosis": {**found, **origin},
        "report_html": page(found),
    }


def result_sheet(document: Json, name: str, made_utc: str) -> str:
    """Return the one page of a diagnosis for the file: a PDF in base64."""
    from impactd.diagnosis.result_sheet import Source, write_result_sheet  # noqa: PLC0415

    files = document.get("files") or dict(
        zip(
            (f"{number:06d}.h5" for number in document["shot_numbers"]),
            document["file_sha256"],
            strict=True,
        )
    )
    with tempfile.TemporaryDirectory() as place:
        file = Path(place, "sheet.pdf")
        write_result_sheet(file, document, Source(name, files), datetime.fromisoformat(made_utc))
        return base64.b64encode(file.read_bytes()).decode()


def warm_up() -> None:
    """Load, or compile, what the first fit needs."""
    rate_hz, trigger, samples = 1e6, 2000, 8000
    generator = np.random.default_rng(0)
    signal = generator.normal(0.0, 1e-3, samples)
    signal[trigger : trigger + 100] += 2.0 * np.sin(np.linspace(0.0, np.pi, 100))
    known = Quantity(3e9, 6e7), Quantity(0.35, 0.01)
    campaign = Campaign(
        shots=(
            Shot(
                name="warm-up",
                signal=signal,
                sample_rate_hz=rate_hz,
                trigger_index=trigger,
                sphere="sphere",
                surface="surface",
                drop_height_m=0.047,
                restitution=Quantity(0.8, 0.01),
            ),
        ),
        spheres={"sphere": Sphere("sphere", 4.76e-3, 0.6e-3, *known)},
        surfaces={"surface": Surface("surface", *known)},
        sensor=Sensor(
            compliance_m_per_v=Quantity(5.6e-9, 2e-10),
            crystal_mass_kg=Quantity(35.4e-3, 3.1e-3),
            crystal_stiffness_n_per_m=Quantity(4.16e8, 4.2e7),
            crystal_damping_n_s_per_m=Quantity(560.0, 60.0),
            hsd_n_per_v=Quantity(1.78, 0.09),
        ),
        speed_repeatability=0.003,
    )
    for model in BASE_MODELS:
        _fit_one(campaign, model)


def _definition(order: Json, model: str) -> Json | None:
    found: Json | None = order.get("definitions", {}).get(model)
    return found


def _version(order: Json, model: str) -> Json:
    definition = _definition(order, model)
    return {} if definition is None else {"model_version": definition["version"]}


def _fit_one(campaign: Campaign, model: str, definition: Json | None = None) -> FitResult:
    if definition is not None:
        return fit_named(campaign, definition, by_pair=True, heldout=False, priors=True)
    return analysis_fit_campaign(campaign, model, by_pair=True, heldout=False)


def _read(order: Json) -> list[StoredShot]:
    return [read_shot(Path(one["path"]), one["sha256"]) for one in order["shots"]]


def campaign_of(order: Json, shots: list[StoredShot]) -> Campaign:
    """Return shots, in the order of their numbers, with all that an order knows of them.

    Each has its restitution from the bounce. The order has ``shots`` and the members of
    `orders.knowledge`.
    """
    known = _Known(
        {name: sphere_from_json(name, _fields(one)) for name, one in order["spheres"].items()},
        {name: surface_from_json(name, _fields(one)) for name, one in order["surfaces"].items()},
    )
    sensor = sensor_from_json(Fields(order["sensor"], file="order", known=SENSOR_KEYS))
    metadata = shots[0].metadata
    if metadata.source == "import":
        # Recorded elsewhere: our load cell and our release have nothing to do with it.
        campaign = assemble_campaign(
            shots,
            known,
            metadata.sensor or Sensor(),
            metadata.gravity_m_per_s2,
            metadata.speed_repeatability,
        )
    else:
        campaign = assemble_campaign(
            shots, known, sensor, order["gravity_m_per_s2"], order["speed_repeatability"]
        )
        if order.get("height_offset_u_m"):
            offset = Uncertainty(order["height_offset_u_m"])
            campaign = dataclasses.replace(campaign, u_height_offset_m=offset)
    rebounds = {one["number"]: one.get("rebound_height_m") for one in order["shots"]}
    by_number = sorted(shots, key=lambda one: one.shot.number)
    bounced = [
        with_restitution(shot, stored.metadata, rebounds.get(stored.shot.number))
        for shot, stored in zip(campaign.shots, by_number, strict=True)
    ]
    return dataclasses.replace(campaign, shots=tuple(bounced))


def _fields(value: object) -> Fields:
    return Fields(value, file="order")


def _shot_result(result: FitResult, stored: StoredShot) -> Json:
    """Return a one-shot fit as the archive keeps it, the pair's modulus first."""
    whole = result.to_json()
    kept = {key: whole.get(key) for key in ("model", "outcome", "covariance", "parameters")}
    if not whole["shots"]:
        return {"format": FORMAT, **kept, "flags": [result.outcome.status]}
    (shot,) = whole["shots"]
    (pair,) = whole["pairs"].values()
    reduced = pair.get("reduced_modulus_Pa")
    if reduced is not None:
        reduced = {**reduced, "u_calibration": pair["u_calibration_Pa"]}
    measured = result.problem.shots[0].shot.restitution
    return {
        "format": FORMAT,
        **kept,
        "sphere": shot["sphere"],
        "surface": shot["surface"],
        "drop_height_m": shot["drop_height_m"],
        "reduced_modulus_Pa": reduced,
        "stiffness_over_mass": pair.get("stiffness_over_mass"),
        "pairs": whole["pairs"],
        "restitution": shot["restitution"],
        "restitution_prior": None if measured is None else dataclasses.asdict(measured),
        "impact_speed_m_per_s": shot["impact_speed_m_per_s"],
        "contact_time_s": shot["contact_time_s"],
        "touch_down_s": shot["touch_down_s"],
        "peak": shot["peak"],
        "rms": shot["rms"],
        "noise_rms": whole["noise_rms_V"],
        "r2": shot["r2"],
        "nrmse": shot["nrmse"],
        "chi2_per_dof": shot["chi2_per_dof"],
        "degrees_of_freedom": whole["degrees_of_freedom"],
        "uncertainty_widened_by": whole["uncertainty_widened_by"],
        "assumptions": whole["assumptions"],
        "flags": sorted({*whole["flags"], *shot["flags"]}),
    }


def _origin(path: Path) -> Json:
    """Return what a campaign folder's result rests on: files, and no shots of the archive."""
    files = campaign_files(path)
    return {
        "calibration": None,
        "shot_numbers": [],
        "file_sha256": list(files.values()),
        "files": files,
        "software": software(),
    }


def _provenance(order: Json, shots: list[StoredShot]) -> Json:
    return {
        "calibration": order["calibration"],
        "materials_version": order.get("materials_version", 0),
        "shot_numbers": [one.shot.number for one in shots],
        "file_sha256": [one.shot.sha256 for one in shots],
        "software": software(),
    }
