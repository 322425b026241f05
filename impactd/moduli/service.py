"""Moduli over the archive: the stored fit of every shot goes into one network of materials.

No trace is read and nothing is fitted here; the answer follows the archive at once. What takes time
is kept: the observations of all shots, and the adjusted network of each choice of shots until a
fit is written.
"""

# ruff: noqa: PLC0415 - imported when first asked for: the rig must not wait for the fits to load

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import structlog

from analysis.base_models import DEFAULT_BASE
from impactd.aliases import Json
from impactd.moduli.adjustment import adjusted, at_temperature, calibrations_of_other_bases
from impactd.moduli.control_chart import PairChart
from impactd.moduli.observations import Observations, ShotUse
from impactd.settings.materials import Materials
from impactd.storage.archive import Archive, Calibration
from impactd.storage.timestamp import utc_now
from impactd.storage.version import software

if TYPE_CHECKING:
    from analysis import PairObservation

FORMAT = "impactd-moduli/1"
BUDGET_FORMAT = "impactd-budget/1"
MODELS_KEPT = 3
"""Observations of so many models: both bases and the active one. About 1 kB a shot each."""
NETWORKS_KEPT = 8
"""Adjusted networks of so many choices of model and time. About 0.1 kB a shot each."""

_WAIT_S = 0.5
_log = structlog.get_logger("impactd.moduli")


@dataclass(frozen=True)
class ModuliAnswer:
    """The moduli of all stored fits together."""

    head: Json
    """All members of ``impactd-moduli/1`` but the lists."""
    lists: dict[str, bytes]
    """``shots`` and ``excluded`` as JSON in UTF-8: together they have an entry for every shot."""


@dataclass(frozen=True)
class _Network:
    """An adjusted network, with the state of knowledge it was made from.

    ``materials`` are those ``stated``, at the temperature of the shots.
    """

    version: int
    observations: Observations
    stated: Materials
    materials: Materials
    found: Json
    lists: dict[str, bytes]
    seen: list[PairObservation]


class ModuliService:
    """Answers with the moduli of all stored fits together. Thread safe."""

    def __init__(self, archive: Archive) -> None:
        self._archive = archive
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._observations: OrderedDict[str, Observations] = OrderedDict()
        self._networks: OrderedDict[tuple[str | None, ...], _Network] = OrderedDict()
        self._budgets: OrderedDict[tuple[str | None, ...], tuple[_Network, Json]] = OrderedDict()

    def start(
        self, model: str, materials: Callable[[], Materials], wait: Callable[[float], bool]
    ) -> None:
        """Read the archive and adjust its network beforehand, in a thread.

        ``wait`` waits for at most so many seconds and tells whether more urgent work is done.
        """

        def fill() -> None:
            """Wait, then read."""
            while not wait(_WAIT_S):
                if self._stop.wait(_WAIT_S):  # also where `wait` returns at once
                    return
            try:
                with self._lock:
                    self._observations_of(model).update(self._stop.is_set)
                if not self._stop.is_set():
                    self._network(materials(), model, None, None)
            except Exception:  # whoever asks for moduli meets the same error and is told
                _log.exception("the fits could not be read beforehand")

        self._thread = threading.Thread(target=fill, name="moduli", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the thread; the archive may then be closed."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join()

    def answer(
        self,
        materials: Materials,
        *,
        specimen: str | None = None,
        since: str | None = None,
        until: str | None = None,
        model: str = DEFAULT_BASE,
    ) -> ModuliAnswer:
        """Return what all stored fits together say about each material.

        Beside the network's result, ``impactd-moduli/1`` has ``calibration`` (which, its date,
        until when it is valid, whether it is overdue), ``shots`` (numbers and SHA-256 of the files)
        and ``excluded``. Every modulus carries ``calibration_overdue``. Without any usable fit
        ``moduli`` is empty and ``warnings`` says so.

        Parameters
        ----------
        specimen : str, optional
            Only report this surface and its pairs. All shots still take part: a sphere that was
            dropped on a reference tells about the specimen too.
        since, until : str, optional
            First timestamp of a shot that counts and first that does not, in the archive's form.

        Raises
        ------
        AnalysisError
            If a shot names a material that is unknown today.
        """
        network = self._network(materials, model, since, until)
        state = _calibration_state(self._archive.calibrations.current())
        found = network.found if specimen is None else _only(network.found, specimen)
        head = {
            **found,
            "moduli": {
                key: entry
                | _stated(network, key, entry)
                | {"calibration_overdue": state["overdue"]}
                for key, entry in found["moduli"].items()
            },
            "warnings": found["warnings"] + ([state["sentence"]] if state["sentence"] else []),
            "specimen": specimen,
            "since": since,
            "until": until,
            "calibration": state,
            "software": software(),
        }
        return ModuliAnswer(head, network.lists)

    def charts(
        self, *, since: str | None = None, until: str | None = None, model: str = DEFAULT_BASE
    ) -> dict[tuple[str, str], PairChart]:
        """Return the control chart of every pair; see `Observations.charts`."""
        with self._lock:
            observations = self._observations_of(model)
            observations.update()
            return observations.charts(since, until)

    def _network(
        self, materials: Materials, model: str, since: str | None, until: str | None
    ) -> _Network:
        key = (model, since, until)
        with self._lock:  # computed once: whoever asks for the same meanwhile waits for it
            observations = self._observations_of(model)
            observations.update()
            kept = self._networks.pop(key, None)
            if (
                kept is None
                or kept.observations is not observations
                or kept.version != observations.version
                or kept.stated is not materials
            ):
                kept = self._adjust(materials, model, observations, since, until)
            self._networks[key] = kept
            if len(self._networks) > NETWORKS_KEPT:
                self._networks.popitem(last=False)
            return kept

    def _observations_of(self, model: str) -> Observations:
        found = self._observations.pop(model, None) or Observations(self._archive, model)
        self._observations[model] = found
        if len(self._observations) > MODELS_KEPT:
            self._observations.popitem(last=False)
        return found

    def _adjust(
        self,
        materials: Materials,
        model: str,
        observations: Observations,
        since: str | None,
        until: str | None,
    ) -> _Network:
        uses = observations.chosen(since, until)
        seen = [use.observation for use in uses if use.observation is not None]
        moved, told = at_temperature(materials, uses)
        found = self._adjusted(moved, seen, model)
        found["warnings"] = [*found["warnings"], *told]
        found.pop("shots", None)  # by name only; the answer's list has the hashes too
        lists = _lists(uses)
        return _Network(observations.version, observations, materials, moved, found, lists, seen)

    def _adjusted(self, materials: Materials, seen: list[PairObservation], model: str) -> Json:
        if not seen:
            return {
                "format": FORMAT,
                "model": model,
                "moduli": {},
                "pairs": {},
                "network": None,
                "covariance": None,
                "calibrations": [],
                "warnings": [_no_fit(model)],
            }
        found = adjusted(self._archive, materials, seen, model).result.to_json()
        others = calibrations_of_other_bases(self._archive, seen, model)
        return {**found, "warnings": found["warnings"] + others}

    def budget(
        self,
        materials: Materials,
        *,
        specimen: str | None = None,
        since: str | None = None,
        until: str | None = None,
        model: str = DEFAULT_BASE,
    ) -> Json:
        """Return the uncertainty budget of every modulus of `answer`: ``impactd-budget/1``.

        It is computed when it is asked for, without delaying who asks for moduli, and kept with
        them. It has no moduli where none is stated; ``specimen`` limits the report to that surface.
        """
        network = self._network(materials, model, since, until)
        key = (model, since, until)
        with self._lock:
            kept = self._budgets.get(key)
        if kept is None or kept[0] is not network:
            kept = network, _budgets(self._archive, network, model)
            with self._lock:
                self._budgets.pop(key, None)
                self._budgets[key] = kept
                if len(self._budgets) > NETWORKS_KEPT:
                    self._budgets.popitem(last=False)
        moduli = network.found["moduli"]
        wanted = [n for n in kept[1] if specimen is None or _is_surface(n, moduli[n], specimen)]
        return {
            "format": BUDGET_FORMAT,
            "model": model,
            # copies: whoever asks may add a decision
            "moduli": {n: {m: dict(one) for m, one in kept[1][n].items()} for n in wanted},
            "status": {name: moduli[name]["status"] for name in wanted},
            "warnings": network.found["warnings"],
            "specimen": specimen,
            "since": since,
            "until": until,
            "shots": len(network.seen),
            "software": software(),
        }


def _stated(network: _Network, key: str, entry: Json) -> Json:
    """Return the stated modulus, and the one adjusted by all shots."""
    if entry["status"] != "reference":
        return {}
    known = network.stated.spheres if entry["side"] == "sphere" else network.stated.surfaces
    material = known.get(key.removeprefix(f"{entry['side']}:"))
    stated = None if material is None else material.youngs_modulus_pa
    if stated is None:
        return {}
    return {"stated_youngs_modulus_Pa": {"value": stated.value, "u": stated.u, "unit": "Pa"}}


def _lists(uses: Sequence[ShotUse]) -> dict[str, bytes]:
    taking_part = [use.entry for use in uses if use.observation is not None]
    excluded = [use.entry for use in uses if use.observation is None]
    return {"shots": _joined(taking_part), "excluded": _joined(excluded)}


def _joined(entries: list[str]) -> bytes:
    return f"[{','.join(entries)}]".encode()


def _budgets(archive: Archive, network: _Network, model: str) -> Json:
    if not network.seen:
        return {}
    from analysis.moduli_budget import network_budgets_json

    found = network_budgets_json(adjusted(archive, network.materials, network.seen, model))
    moduli: Json = found["moduli"]
    return moduli


def _no_fit(model: str) -> str:
    return (
        f"No stored shot has a usable {model} fit for this choice. Shots that were stored before "
        f"{model} was chosen get one by `impactd refit`."
    )


def _is_surface(key: str, entry: Json, specimen: str) -> bool:
    return key in (specimen, f"surface:{specimen}") and entry["side"] == "surface"


def _only(found: Json, specimen: str) -> Json:
    pairs = {key: one for key, one in found["pairs"].items() if one["surface"] == specimen}
    kept = {key: one for key, one in found["moduli"].items() if _is_surface(key, one, specimen)}
    warnings = list(found["warnings"])
    if not kept:
        warnings.append(f"No usable shot was dropped on {specimen!r}.")
    return {**found, "moduli": kept, "pairs": pairs, "warnings": warnings}


def _calibration_state(current: Calibration | None) -> Json:
    if current is None or current.valid_until_utc is None:
        return {
            "number": None,
            "finished_utc": None,
            "valid_until_utc": None,
            "overdue": True,
            "sentence": "The load cell has not been calibrated; its certificate was used.",
        }
    overdue = current.valid_until_utc <= utc_now()
    sentence = f"The calibration is overdue since {current.valid_until_utc}." if overdue else ""
    return {
        "number": current.number,
        "finished_utc": current.finished_utc,
        "valid_until_utc": current.valid_until_utc,
        "overdue": overdue,
        "sentence": sentence,
    }
