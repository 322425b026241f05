"""Prometheus metrics of what the rig measures: moduli, noise, the cell, its calibration, the disk.

Everything is read from the index at the scrape; what a scrape needs is kept until a fit, a
calibration or a shot is written.
"""

# ruff: noqa: PLC0415 - imported when first asked for: the rig must not wait for the fits to load

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from typing import Any

from prometheus_client.core import GaugeMetricFamily, Metric

from impactd.advice import advice, best_fit
from impactd.aliases import Json
from impactd.storage.archive import Archive
from impactd.storage.calibrations import DROPS
from impactd.storage.shots import Shot

LOOKED_AT_SHOTS = 200
"""Newest shots in which the last one of each pair is looked for: a page of the API."""
_DAY_S = 86_400.0
FILLING_DAYS = 7.0
"""Over which the archive's growth is taken: a working week and its weekend."""


class DomainMetrics:
    """The metrics of the last shots and calibrations."""

    def __init__(self, archive: Archive) -> None:
        self._archive = archive
        self._kept: dict[str, tuple[object, list[Metric]]] = {}

    def collect(self) -> Iterator[Metric]:
        """Yield the metrics.

        Yields
        ------
        Metric
            One per family; families of what is not known are empty.
        """
        archive = self._archive
        newest = archive.shots(limit=1)
        last = newest[0].number if newest else 0
        yield from self._fresh("shots", (last, archive.fits.last_id()), self._shots)
        done = [
            one
            for one in archive.calibrations.list(limit=20)
            if one.kind == DROPS and one.result and not one.problem
        ][:2]
        yield from self._fresh(
            "cell", tuple(one.number for one in done), lambda: _cell([c.result for c in done])
        )
        yield from self._calibration()
        yield from self._disk()

    def _fresh(self, name: str, state: object, make: Any) -> list[Metric]:
        kept = self._kept.get(name)
        if kept is None or kept[0] != state:
            kept = state, list(make())
            self._kept[name] = kept
        return kept[1]

    def _shots(self) -> Iterator[Metric]:
        pair = ["sphere", "surface", "model"]
        modulus = GaugeMetricFamily(
            "impactd_last_reduced_modulus_pascals",
            "Of the last usable shot of a pair. [Pa]",
            labels=pair,
        )
        wide = GaugeMetricFamily(
            "impactd_last_reduced_modulus_expanded_uncertainty_pascals",
            "Its expanded uncertainty U (95 %). [Pa]",
            labels=pair,
        )
        noise = GaugeMetricFamily(
            "impactd_noise", "Before the trigger of the last shot, in the unit of its signal."
        )
        seen: set[tuple[str | None, str | None]] = set()
        for shot in self._archive.shots(limit=LOOKED_AT_SHOTS):
            if (shot.sphere, shot.surface) in seen:
                continue
            found = self._fit_of(shot)
            if found is None:
                continue
            if not noise.samples and found[1].get("noise_rms") is not None:
                noise.add_metric([], float(found[1]["noise_rms"]))
            quantity = found[1].get("reduced_modulus_Pa")
            if quantity is not None and found[2]:
                seen.add((shot.sphere, shot.surface))
                labels = [str(shot.sphere), str(shot.surface), found[0]]
                modulus.add_metric(labels, float(quantity["value"]))
                wide.add_metric(labels, float(quantity["expanded"]["U"]))
        yield from (modulus, wide, noise)

    def _fit_of(self, shot: Shot) -> tuple[str, Json, bool] | None:
        """Return model, result and whether the shot may be used; None where it is not fitted."""
        fits = self._archive.fits.for_shot(shot.number)
        best = best_fit(fits)
        if best is None:
            return None
        return best.model, best.result, advice(shot, fits)[0] != "repeat"

    def _calibration(self) -> Iterator[Metric]:
        current = self._archive.calibrations.current()
        moments = {
            "impactd_calibration_finished_timestamp_seconds": "When the cell was calibrated. [s]",
            "impactd_calibration_valid_until_timestamp_seconds": "When the next one is due. [s]",
        }
        told = (current.finished_utc, current.valid_until_utc) if current else (None, None)
        for (name, meaning), moment in zip(moments.items(), told, strict=True):
            family = GaugeMetricFamily(name, meaning)
            if moment is not None:
                family.add_metric([], datetime.fromisoformat(moment).timestamp())
            yield family

    def _disk(self) -> Iterator[Metric]:
        family = GaugeMetricFamily(
            "impactd_disk_seconds_left",
            "Until the reserve is reached, at the pace of the last 7 days. [s]",
        )
        now = datetime.now(UTC)
        since = (now - timedelta(days=FILLING_DAYS)).strftime("%Y-%m-%dT%H:%M:%S.%fZ")
        stored = self._archive.shots(since=since, limit=LOOKED_AT_SHOTS)
        if stored:
            # of many shots the newest: their span, and no less than an hour of it
            oldest = datetime.fromisoformat(stored[-1].started_utc)
            full = len(stored) == LOOKED_AT_SHOTS
            days = (now - oldest) / timedelta(days=1) if full else FILLING_DAYS
            pace = sum(shot.size_bytes for shot in stored) / max(days, 1 / 24)
            family.add_metric([], max(self._archive.free_bytes(), 0) / pace * _DAY_S)
        yield family


def _cell(newest_first: list[Json | None]) -> Iterator[Metric]:
    names = {
        "gain_N_per_V": ("impactd_cell_gain_newtons_per_volt", "Gain of the load cell. [N/V]"),
        "natural_frequency_Hz": ("impactd_cell_frequency_hertz", "Its frequency f0. [Hz]"),
        "damping_ratio": ("impactd_cell_damping_ratio", "Its damping ratio. [1]"),
    }
    documents = [one for one in reversed(newest_first) if one is not None]
    last: Json = {}
    if documents:
        from analysis.cell_drift import drift_series

        last = drift_series(documents)[-1]
    for key, (name, meaning) in names.items():
        value = GaugeMetricFamily(name, meaning)
        wide = GaugeMetricFamily(f"{name}_expanded_uncertainty", f"U (95 %). {meaning}")
        found = last.get("identifiable", {}).get(key)
        if found is not None:
            value.add_metric([], float(found["value"]))
            wide.add_metric([], float(found["expanded"]["U"]))
        yield from (value, wide)
    moved = GaugeMetricFamily(
        "impactd_cell_drift",
        "Largest change since the calibration before, over its standard uncertainty. [1]",
    )
    since = last.get("since_previous")
    if since and since.get("largest_in_u") is not None:
        moved.add_metric([], float(since["largest_in_u"]))
    yield moved
