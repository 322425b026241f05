"""One simulated rig: time, sphere, coupon, cell, noise, and the interface of its transports."""

from __future__ import annotations

import math
import threading
import time
from dataclasses import asdict, dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from drivers.errors import ConfigurationError
from drivers.simulated.clock import RigClock
from drivers.simulated.converter import (
    Board,
    QuietInput,
    quantise,
    quiet_input,
    read_round,
)
from drivers.simulated.draw import draw_rig
from drivers.simulated.effects import Effect, Shot
from drivers.simulated.faults import Faults
from drivers.simulated.flight import Flight, Segment, begin_flight, render_flight
from drivers.simulated.impact import Mechanics, simulate_impact
from drivers.simulated.replay import Recording
from drivers.simulated.rig_model import RIGS
from drivers.simulated.world_settings import WorldSettings

__all__ = ["World", "WorldSettings"]

_NEVER = 1 << 62
_BOUNCES_KEPT = 100
"""Of so many flights, the last, the truth tells every bounce; of others the first touch-down."""


@dataclass(frozen=True)
class _Hanging:
    sphere: str
    surface: str
    drop_height_m: float


@dataclass(frozen=True)
class _Stream:
    began_s: float
    rate_hz: float
    board: Board
    quiet: QuietInput


class World:
    """One rig: time, sphere, coupon, cell, noise. Thread safe.

    ``faults`` are switches for whatever shall break; ``openings_ns`` the host clock at each opening
    of the valve, whatever the daemon says of it.
    """

    def __init__(self, settings: WorldSettings) -> None:
        if settings.cell_model not in ("kv", "hsd"):
            raise ConfigurationError(f"cell_model is 'kv' or 'hsd', not {settings.cell_model!r}.")
        if settings.rig not in RIGS:
            raise ConfigurationError(f"rig is {', '.join(RIGS)}, not {settings.rig!r}.")
        self.settings = settings
        self.clock = RigClock(settings.clock_speed)
        self.faults = Faults()
        self.openings_ns: list[int] = []
        # Two locks, taken in this order: a flight takes a tenth of a second to render, and the
        # valve must answer meanwhile.
        self._sampling = threading.RLock()
        self._lock = threading.RLock()
        self._rig = draw_rig(
            settings.seed,
            settings.spheres,
            settings.surfaces,
            settings.cell,
            settings.effects,
            restitution=settings.restitution,
            restitution_scatter=settings.restitution_scatter,
            gravity_m_per_s2=settings.gravity_m_per_s2,
            rigid_cell=settings.cell_model == "hsd",
            exact=settings.exact,
            rig=settings.rig,
            spread=settings.spread,
        )
        self._vacuum_on = True
        self._hanging: _Hanging | None = None
        self._leaves_s = math.inf
        self._releases = 0
        self._streams = 0
        self._recording = settings.recording
        self._flights: list[tuple[Flight, Recording | None]] = []
        self._stream: _Stream | None = None
        self._segments: dict[int, list[Segment]] = {}
        self._over_s: dict[int, float] = {}  # when a flight's last segment ended, rig time
        self._passed = 0  # flights before this one were over when the stream began
        self._conversions = [c for e in self._rig.effects if (c := e.conversion()) is not None]
        _warm_up(self._rig.effects)

    # -- acquisition side ---------------------------------------------------------------------

    def start_stream(
        self,
        sample_rate_hz: float,
        range_v: float,
        *,
        board_gain: float = 1.0,
        board_offset_v: float = 0.0,
    ) -> None:
        """Start the converter: sample 0 is now.

        The true rate is the one asked for times ``rate_error``. Gain and offset are the board's own
        error, ``V = gain * Vraw + offset``, as its calibration table states it.
        """
        board = Board(range_v, board_gain, board_offset_v)
        rate_hz = sample_rate_hz * self.settings.rate_error * self._rig.inputs.sample_rate_factor
        quiet = self._quiet_input(rate_hz, board)  # sample 0 is after it
        with self._sampling, self._lock:
            self._streams += 1
            self._stream = _Stream(self.clock.now_s(), rate_hz, board, quiet)
            self._segments = {}

    def stop_stream(self) -> None:
        """Stop the converter; do nothing when it stands."""
        with self._sampling:
            stopped, self._stream = self._stream, None
        if stopped is not None:
            # a host that times the start command shall not wait for the next stream's noise
            self._quiet_input(stopped.rate_hz, stopped.board)

    def _quiet_input(self, rate_hz: float, board: Board) -> QuietInput:
        """Return the next stream's input at rest; making it takes a twentieth of a second."""
        seed = (self.settings.seed, self._streams)
        return quiet_input(self.settings.noise, seed, self.settings.offset_v, rate_hz, board)

    def samples_due(self) -> int:
        """Return how many samples the converter has produced since `start_stream`.

        A very large number while a driven clock streams, 0 without a stream.
        """
        stream = self._stream
        if stream is None:
            return 0
        if self.clock.is_driven:
            return _NEVER
        return int((self.clock.now_s() - stream.began_s) * stream.rate_hz)

    def read_codes(self, start: int, count: int) -> NDArray[np.uint16]:
        """Return the converter's codes of samples ``start`` to ``start + count``.

        Offset binary, ``V = code * 2 R / 65536 - R``. A RuntimeError says that no stream runs.
        """
        with self._sampling:
            stream = self._stream
            if stream is None:
                raise RuntimeError("The converter stands: start_stream comes first.")
            with self._lock:
                self.clock.advance_to(stream.began_s + (start + count) / stream.rate_hz)
                self._let_go()
            codes = read_round(stream.quiet.codes, start, count)
            self._add_signal(stream, start, codes)
            for conversion in self._conversions:
                codes = conversion[codes]
            return codes

    def _add_signal(self, stream: _Stream, start: int, codes: NDArray[np.uint16]) -> None:
        """Write over the quiet codes wherever something is to be seen."""
        stop = start + codes.size
        pieces = [s for s in self._visible(stream, stop) if s.first < stop]
        pieces = [s for s in pieces if s.first + s.volts.size > start]
        has_hum = any(e.ambient(np.zeros(1)) is not None for e in self._rig.effects)
        if not pieces and not has_hum:
            return
        low = start if has_hum else max(start, min(s.first for s in pieces))
        high = stop if has_hum else min(stop, max(s.first + s.volts.size for s in pieces))
        volts = read_round(stream.quiet.noise_v, low, high - low).astype(np.float64)
        volts += self.settings.offset_v
        if has_hum:
            t = stream.began_s + np.arange(low, high) / stream.rate_hz
            for effect in self._rig.effects:
                hum = effect.ambient(t)
                if hum is not None:
                    volts += hum
        for piece in pieces:
            a, b = max(low, piece.first), min(high, piece.first + piece.volts.size)
            part = piece.volts[a - piece.first : b - piece.first]
            if piece.replaces_noise:
                volts[a - low : b - low] = part
            else:
                volts[a - low : b - low] += part
        codes[low - start : high - start] = quantise(volts, stream.board)

    def _visible(self, stream: _Stream, stop: int) -> list[Segment]:
        """Return the segments of all flights that may reach before ``stop``, rendered once."""
        found: list[Segment] = []
        with self._lock:
            self._pass_by(stream)
            flights = [(i, *self._flights[i]) for i in range(self._passed, len(self._flights))]
        for i, flight, recording in flights:
            if (flight.landing_s - stream.began_s) * stream.rate_hz > stop + 2e6 and not recording:
                continue
            if self._over_s.get(i, math.inf) < stream.began_s:
                continue  # else every stream would render every flight of the day again
            if i not in self._segments:
                if recording is not None:
                    piece = recording.render(flight.landing_s, stream.began_s, stream.rate_hz)
                    self._segments[i] = [piece]
                else:
                    self._segments[i] = render_flight(
                        self._rig, flight, stream.began_s, stream.rate_hz
                    )
                ends = [s.first + s.volts.size for s in self._segments[i]]
                self._over_s[i] = stream.began_s + max(ends, default=0) / stream.rate_hz
            found += self._segments[i]
        return found

    def _pass_by(self, stream: _Stream) -> None:
        """Drop the flights that were over when the stream began; keep less of old ones."""
        while self._over_s.get(self._passed, math.inf) < stream.began_s:
            del self._over_s[self._passed]
            if self._passed >= _BOUNCES_KEPT:
                self._flights[self._passed - _BOUNCES_KEPT][0].keep_first_touch()
            self._passed += 1

    # -- valve side ---------------------------------------------------------------------------

    def set_vacuum(self, on: bool) -> None:
        """Switch the vacuum; without it the sphere leaves the tube a moment later.

        If it is back in time, the sphere stays where it is.
        """
        with self._lock:
            self._let_go()
            if self._vacuum_on and not on:
                self.openings_ns.append(time.monotonic_ns())
            if on:
                self._leaves_s = math.inf
            elif self._vacuum_on and self._hanging is not None:
                rng = np.random.default_rng([self.settings.seed, 30, self._releases])
                jitter = self.settings.release_jitter_s * rng.standard_normal()
                delay_s = max(self.settings.release_latency_s + jitter, 1e-4)
                self._leaves_s = self.clock.now_s() + delay_s
            self._vacuum_on = on

    def _let_go(self) -> None:
        """Turn a sphere that is due into a flight, which begins when it was due."""
        if self._hanging is None or self.clock.now_s() < self._leaves_s:
            return
        hanging, leaves_s = self._hanging, self._leaves_s
        self._hanging, self._leaves_s = None, math.inf
        seed = (self.settings.seed, 40, self._releases)
        shot = Shot(
            number=self._releases,
            sphere=hanging.sphere,
            surface=hanging.surface,
            drop_height_m=hanging.drop_height_m,
            rng=np.random.default_rng(seed),
        )
        self._releases += 1
        flight = begin_flight(self._rig, shot, leaves_s, self.settings.speed_repeatability, seed)
        self._flights.append((flight, self._recording))

    def vacuum_volts(self) -> float:
        """Return what the vacuum gauge shows. [V]"""
        with self._lock:
            self._let_go()
            if not self._vacuum_on:
                return self.settings.no_vacuum_v
            if self._hanging is None:
                return self.settings.vacuum_open_v
            return self.settings.vacuum_held_v

    # -- the person ---------------------------------------------------------------------------

    def load(self, sphere: str, surface: str, drop_height_m: float) -> None:
        """Hang a sphere over a surface; without vacuum it does not stay.

        A ConfigurationError says that a name is unknown or the height is not positive.
        """
        for name, drawer in ((sphere, self.settings.spheres), (surface, self.settings.surfaces)):
            if name not in drawer:
                raise ConfigurationError(
                    f"The simulated laboratory has no {name!r}; it has {', '.join(drawer)}.",
                    remedy="Name it in the simulated rig's materials.",
                )
        if not drop_height_m > 0.0:
            raise ConfigurationError(f"A drop height is above zero, not {drop_height_m} m.")
        with self._lock:
            self._let_go()
            if self.faults.no_sphere or not self._vacuum_on:
                return
            self._hanging = _Hanging(sphere, surface, drop_height_m)
            self._leaves_s = math.inf

    def replay(self, recording: Recording | None) -> None:
        """Play a recording at the next releases; ``None`` simulates again."""
        with self._lock:
            self._recording = recording

    # -- truth --------------------------------------------------------------------------------

    def truth(self) -> dict[str, object]:
        """Return everything drawn and everything that happened, ready for JSON.

        A rig may run for months: flights before the last hundred have only their first touch-down.
        """
        with self._sampling, self._lock:
            shots = [
                {
                    "sphere": flight.shot.sphere,
                    "surface": flight.shot.surface,
                    "true_drop_height_m": flight.shot.drop_height_m,
                    "landing_s": flight.landing_s,
                    "impact_speed_m_per_s": flight.speed_m_per_s,
                    "replayed": recording is not None,
                    "touches": [asdict(touch) for touch in flight.touches],
                }
                for flight, recording in self._flights
            ]
            noise = asdict(self.settings.noise)
            return {"seed": self.settings.seed, **self._rig.truth(), "noise": noise, "shots": shots}


@lru_cache(maxsize=1)
def _compile_integrator() -> None:
    """Have the integrator compiled before the first sphere falls."""
    bodies = Mechanics(6e-4, 4.76e-3, 1.5e9, 0.8, 9.80665, 0.0354, 4.16e8, 560.0)
    simulate_impact(bodies, 0.5, points=10)


def _warm_up(effects: tuple[Effect, ...]) -> None:
    """Have everything compiled that a flight may need; some effects bring compiled loops."""
    _compile_integrator()
    for effect in effects:
        stage = effect.stage(Shot(0, "", "", 0.01, np.random.default_rng(0)))
        if stage is not None:
            stage.process(np.zeros(2), 1e-6)
