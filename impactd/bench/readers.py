"""What readers of a large archive cost: the moduli of 10 000 shots, and an abort beside them.

A daemon on a simulated rig serves an archive made for the purpose. Everything is timed at a client
on the same machine; status and an idle abort, asked in the same run, are the references.
"""

from __future__ import annotations

import multiprocessing
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from multiprocessing.synchronize import Event
from pathlib import Path
from statistics import median, quantiles

from impactd import blas_threads
from impactd.bench.figure import Figure
from impactd.bench.large_archive import FittedShot, fill_archive, fitted_shots
from impactd.client.connection import Connection
from impactd.data_lock import read_holder
from impactd.demo.rig_process import RigProcess
from impactd.settings.materials import load_materials
from impactd.settings.settings import find_config, load_settings
from impactd.storage.archive import Archive

SHOTS = 10_000
ROUNDS = 50
CHANGES = 5
READERS = 4
GOAL_S = 0.05
GOAL_BYTES = 30e6
GOAL_ABORT_S = 0.1
MODULI, STATUS, ABORT = "/v1/moduli", "/v1/status", "/v1/abort"


def measure() -> list[Figure]:
    """Return the figures of this benchmark."""
    blas_threads.keep_to_one()
    settings = load_settings(find_config("simulated.toml"))
    templates = fitted_shots(settings, load_materials(settings.materials.file))
    return measure_readers(templates)


def measure_readers(
    templates: list[FittedShot], shots: int = SHOTS, rounds: int = ROUNDS
) -> list[Figure]:
    """Fill an archive, serve it, and time its readers.

    Parameters
    ----------
    templates : list of FittedShot
        Whose results the archive's shots have.
    rounds : int
        How often each request is timed.

    Returns
    -------
    list of Figure
        Moduli unchanged and after a new fit, memory, abort beside four readers.
    """
    with tempfile.TemporaryDirectory(prefix="bench-readers-") as place:
        folder = Path(place)
        data = folder / "archive"
        fill_archive(data, templates, shots)
        with _serving(folder / "empty") as (client, empty):
            client.get(MODULI)
            empty_bytes = empty()
        with _serving(data) as (client, held_bytes):
            client.get(MODULI)  # waits until the archive is taken in
            status_s = _timed(lambda: client.get(STATUS), rounds)
            moduli_s = _timed(lambda: client.get(MODULI), rounds)
            changed_s = []
            for _ in range(CHANGES):
                fill_archive(data, templates, 1)
                changed_s += _timed(lambda: client.get(MODULI), 1)
            idle_s = _timed(lambda: client.send("POST", ABORT), rounds)
            with _readers(client.url, _new_token(data)):
                busy_s = _timed(lambda: client.send("POST", ABORT), rounds)
            grown_bytes = held_bytes() - empty_bytes
    name = f"GET {MODULI} at {shots} shots"
    return [
        _figure(f"{name}: median", moduli_s, status_s, f"GET {STATUS}", GOAL_S),
        _figure(f"{name}, after a new fit: median", changed_s, status_s, f"GET {STATUS}", GOAL_S),
        _figure(
            f"POST {ABORT} beside {READERS} such readers: median",
            busy_s,
            idle_s,
            "idle",
            GOAL_ABORT_S,
        ),
        Figure(
            f"POST {ABORT} beside {READERS} such readers: p95",
            quantiles(busy_s, n=20)[-1],
            "s",
            quantiles(idle_s, n=20)[-1],
            "idle",
            quantiles(idle_s, n=20)[-1] / quantiles(busy_s, n=20)[-1],
        ),
        Figure(
            f"memory of the daemon for {shots} shots, readers included",
            grown_bytes,
            "B",
            empty_bytes,
            "without shots",
            goal=f"<= {GOAL_BYTES / 1e6:g} MB",
            met=grown_bytes <= GOAL_BYTES,
        ),
    ]


def _figure(
    name: str, times_s: list[float], reference_s: list[float], reference_name: str, goal_s: float
) -> Figure:
    value, reference = median(times_s), median(reference_s)
    return Figure(
        name,
        value,
        "s",
        reference,
        reference_name,
        reference / value,
        goal=f"<= {1e3 * goal_s:g} ms",
        met=value <= goal_s,
    )


def _timed(ask: Callable[[], object], rounds: int) -> list[float]:
    took_s = []
    for _ in range(rounds):
        began_s = time.perf_counter()
        ask()
        took_s.append(time.perf_counter() - began_s)
    return took_s


@contextmanager
def _serving(data: Path) -> Iterator[tuple[Connection, Callable[[], float]]]:
    """Serve an archive; yield an administrator's client and what tells the daemon's memory."""
    log = data.with_name(f"{data.name}.log")
    with RigProcess(find_config("simulated.toml"), data, log) as rig, rig.connect() as client:

        def held_bytes() -> float:
            status = Path(f"/proc/{read_holder(data)['pid']}/status").read_text()
            (line,) = (one for one in status.splitlines() if one.startswith("VmRSS:"))
            return 1024.0 * int(line.split()[1])

        yield client, held_bytes


def _new_token(data: Path) -> str:
    with Archive.open(data, reserve_bytes=0) as archive:
        return archive.tokens.create("readers", "read")[1]


@contextmanager
def _readers(url: str, token: str) -> Iterator[None]:
    """Let processes of their own ask for the moduli without a pause."""
    context = multiprocessing.get_context("spawn")
    end = context.Event()
    with ExitStack() as stack:
        stack.callback(end.set)
        for _ in range(READERS):
            begun = context.Event()
            reader = context.Process(target=_read, args=(url, token, begun, end), daemon=True)
            reader.start()
            stack.callback(reader.join)
            begun.wait()
        stack.callback(end.set)
        yield


def _read(url: str, token: str, begun: Event, end: Event) -> None:
    with Connection(url, token, timeout_s=120.0) as client:
        while not end.is_set():
            client.get(MODULI)
            begun.set()
