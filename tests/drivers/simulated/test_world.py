"""The simulated rig as its transports see it."""

from __future__ import annotations

import itertools
import json
import math
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from drivers.errors import ConfigurationError
from drivers.simulated.clock import RigClock
from drivers.simulated.effects import make_effect
from drivers.simulated.noise import NoiseSettings, noise_record, noise_table
from drivers.simulated.replay import Recording
from drivers.simulated.truth import seal, unseal
from drivers.simulated.world import World, WorldSettings

RATE_HZ = 1e6
RANGE_V = 10.0
LSB_V = 2 * RANGE_V / 65536


def a_world(**changes: object) -> World:
    """Return a world that moves as fast as it is read."""
    return World(WorldSettings(clock_speed=math.inf, **changes))  # type: ignore[arg-type]


def volts(codes: NDArray[np.uint16]) -> NDArray[np.float64]:
    """Return codes in volts."""
    return codes.astype(np.float64) * LSB_V - RANGE_V


def record(world: World, samples: int = 500_000, height_m: float = 0.03) -> NDArray[np.uint16]:
    """Hang a sphere, stream, release, and return everything from the release on."""
    world.set_vacuum(True)
    world.load("acetal", "polycarbonate", height_m)
    world.start_stream(RATE_HZ, RANGE_V)
    world.read_codes(0, 1000)
    world.set_vacuum(False)
    blocks = [world.read_codes(1000 + i, 8192) for i in range(0, samples, 8192)]
    world.stop_stream()
    return np.concatenate(blocks)[:samples]


def test_same_seed_and_same_commands_give_the_same_codes() -> None:
    """Everything that happens by chance comes from the seed."""
    a, b = (record(a_world(seed=5, effects="random"), 200_000) for _ in range(2))
    np.testing.assert_array_equal(a, b)
    assert np.any(a != record(a_world(seed=6, effects="random"), 200_000))


def test_block_size_does_not_change_the_codes() -> None:
    """A host that reads in other pieces sees the same signal."""
    whole = record(a_world(), 150_000)
    world = a_world()
    world.load("acetal", "polycarbonate", 0.03)
    world.start_stream(RATE_HZ, RANGE_V)
    world.read_codes(0, 1000)
    world.set_vacuum(False)
    np.testing.assert_array_equal(world.read_codes(1000, 150_000), whole)


def test_a_rig_of_many_drops_forgets_bounces(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of old flights the first touch-down is kept, and none of them is looked at again."""
    monkeypatch.setattr("drivers.simulated.world._BOUNCES_KEPT", 2)
    world = a_world()
    records = [record(world, 700_000) for _ in range(5)]
    told = [len(shot["touches"]) for shot in world.truth()["shots"]]  # type: ignore[attr-defined]
    assert told[:2] == [1, 1]
    assert min(told[2:]) > 5
    rendered: list[float] = []
    monkeypatch.setattr(
        "drivers.simulated.world.render_flight", lambda *_: rendered.append(1.0) or []
    )
    record(world, 700_000)
    assert sum(rendered) == 1
    assert all(np.abs(volts(r)).max() > 0.5 for r in records)


def test_sphere_falls_bounces_and_each_bounce_is_weaker() -> None:
    """In a vacuum: first touch after latency and fall; then flights with the rebound speed."""
    world = a_world(release_jitter_s=0.0, speed_repeatability=0.0, rig="paper")
    signal = volts(record(world))
    touches = world.truth()["shots"][0]["touches"]  # type: ignore[index]
    fall_s = math.sqrt(2 * 0.03 / 9.80665)
    latency_s = world.settings.release_latency_s
    first = int(np.argmax(signal > 0.05)) / RATE_HZ
    assert first == pytest.approx(latency_s + fall_s, abs=5e-5)
    assert len(touches) >= 5
    for a, b in itertools.pairwise(touches):
        assert b["speed_m_per_s"] == pytest.approx(a["rebound_speed_m_per_s"])
        flight_s = b["time_s"] - a["time_s"] - a["contact_time_s"]
        assert flight_s == pytest.approx(2 * b["speed_m_per_s"] / 9.80665)
    second = round(touches[1]["time_s"] * RATE_HZ) - 1000  # the record begins at sample 1000
    assert 0.2 < np.max(signal[second : second + 300]) / np.max(signal) < 0.9


def test_bounces_end_below_the_noise() -> None:
    """Half a second later nothing but noise is left."""
    world = a_world()
    signal = volts(record(world, 700_000))
    assert np.std(signal[-50_000:]) < 2e-3


def test_restored_vacuum_keeps_a_sphere_that_has_not_left_yet() -> None:
    """The valve's latency works both ways."""
    world = a_world()
    world.load("acetal", "polycarbonate", 0.03)
    world.start_stream(RATE_HZ, RANGE_V)
    world.set_vacuum(False)
    world.read_codes(0, 2000)
    world.set_vacuum(True)
    assert np.max(volts(world.read_codes(2000, 300_000))) < 0.05
    assert world.vacuum_volts() == world.settings.vacuum_held_v


def test_gauge_tells_held_open_and_no_vacuum_apart() -> None:
    """Three states, three voltages."""
    world = a_world()
    s = world.settings
    assert world.vacuum_volts() == s.vacuum_open_v
    world.load("acetal", "polycarbonate", 0.03)
    assert world.vacuum_volts() == s.vacuum_held_v
    world.set_vacuum(False)
    assert world.vacuum_volts() == s.no_vacuum_v
    world.start_stream(RATE_HZ, RANGE_V)
    world.read_codes(0, 100_000)
    world.set_vacuum(True)
    assert world.vacuum_volts() == s.vacuum_open_v


def test_without_vacuum_or_without_a_sphere_nothing_hangs() -> None:
    """Loading is then done in vain, and releasing makes no impact."""
    world = a_world()
    world.set_vacuum(False)
    world.load("acetal", "polycarbonate", 0.03)
    world.set_vacuum(True)
    assert world.vacuum_volts() == world.settings.vacuum_open_v
    world.faults.no_sphere = True
    assert np.max(volts(record(world, 300_000))) < 0.05
    world.faults.clear()
    assert np.max(volts(record(world, 300_000))) > 1.0


def test_unknown_material_is_refused_by_name() -> None:
    """The message lists what there is."""
    with pytest.raises(ConfigurationError, match=r"no 'wood'; it has .*acetal"):
        a_world().load("wood", "polycarbonate", 0.03)
    with pytest.raises(ConfigurationError, match="above zero"):
        a_world().load("acetal", "polycarbonate", 0.0)


def test_reading_without_a_stream_is_refused() -> None:
    """A converter that stands has no samples."""
    world = a_world()
    assert world.samples_due() == 0
    with pytest.raises(RuntimeError, match="start_stream"):
        world.read_codes(0, 10)


def test_true_rate_moves_the_impact_in_samples() -> None:
    """A slow converter takes fewer samples until the sphere lands."""
    quick = volts(record(a_world(release_jitter_s=0.0)))
    slow = volts(record(a_world(release_jitter_s=0.0, rate_error=0.99)))
    a, b = (int(np.argmax(s > 0.05)) + 1000 for s in (quick, slow))
    assert b / a == pytest.approx(0.99, abs=1e-3)


def test_a_boards_own_error_is_in_its_codes() -> None:
    """V = gain * Vraw + offset gives the true voltage back."""
    world = a_world(offset_v=1.0, noise=NoiseSettings(0.0))
    world.start_stream(RATE_HZ, RANGE_V, board_gain=1.01, board_offset_v=0.02)
    assert volts(world.read_codes(0, 10)) * 1.01 + 0.02 == pytest.approx(1.0, abs=LSB_V)


def test_converter_stops_at_the_ends_of_its_range() -> None:
    """A signal beyond the range sits on the last code."""
    world = a_world()
    world.load("steel", "aluminium", 0.05)
    world.start_stream(RATE_HZ, 1.0)
    world.set_vacuum(False)
    codes = world.read_codes(0, 200_000)
    assert codes.max() == 65535
    assert codes.min() == 0


def test_hum_is_on_the_line_before_anything_falls() -> None:
    """The mains does not wait for the valve."""
    hum = make_effect("mains_hum", {"amplitude_v": 0.1, "frequency_hz": 50.0, "harmonics": 1.0})
    world = a_world(effects=(hum,))
    world.start_stream(RATE_HZ, RANGE_V)
    signal = volts(world.read_codes(0, 40_000))
    assert np.ptp(signal) == pytest.approx(0.2, rel=0.1)
    assert a_world().truth()["effects"] == []


def test_codes_a_bad_converter_never_gives_are_missing() -> None:
    """Every 64th code stays away."""
    bad = make_effect("x_adc_nonlinearity", {"amplitude_codes": 5.0, "period_codes": 2000.0})
    codes = record(a_world(effects=(bad,)), 200_000)
    assert not np.any(codes % 64 == 63)


def test_a_recording_is_replayed_code_for_code() -> None:
    """At its own rate and range the recorded codes come back untouched."""
    rng = np.random.default_rng(1)
    codes = rng.integers(-3000, 12_000, 3000).astype(np.int16)
    recording = Recording.from_codes(
        codes, volts_per_code=LSB_V, sample_rate_hz=RATE_HZ, trigger_index=500
    )
    world = a_world(recording=recording)
    got = record(world, 200_000).astype(np.int32) - 32768
    at = int(np.flatnonzero(np.abs(got) > 100)[0]) - int(np.flatnonzero(np.abs(codes) > 100)[0])
    np.testing.assert_array_equal(got[at : at + 3000], codes)
    landing_s = world.truth()["shots"][0]["landing_s"]  # type: ignore[index]
    assert at + 500 + 1000 == pytest.approx(landing_s * RATE_HZ, abs=1)


def test_a_recording_of_another_rate_keeps_its_duration() -> None:
    """Half the rate, half the samples."""
    pulse = np.zeros(2000)
    pulse[1000:1200] = 5.0
    world = a_world(recording=Recording(pulse, 2e6, 1000), noise=NoiseSettings(0.0))
    assert np.count_nonzero(volts(record(world, 200_000)) > 2.5) == pytest.approx(100, abs=2)
    world.replay(None)
    assert np.max(volts(record(world, 200_000))) < 4.9


@pytest.mark.parametrize(
    ("samples", "trigger"), [(np.zeros((2, 2)), 0), (np.array([0.0, np.nan]), 0), (np.zeros(5), 5)]
)
def test_a_broken_recording_is_refused(samples: NDArray[np.float64], trigger: int) -> None:
    """Two rows, a hole, or a trigger outside."""
    with pytest.raises(ValueError, match=r"recording|Trigger"):
        Recording(samples, 1e6, trigger)


def test_truth_is_ready_for_json_and_sealed_for_its_owner(tmp_path: Path) -> None:
    """The envelope has mode 0600 and gives back what went in."""
    world = a_world(effects="random", seed=9)
    record(world, 150_000)
    path = tmp_path / "truth.json"
    seal(path, {})
    seal(path, world.truth())
    assert path.stat().st_mode & 0o777 == 0o600
    assert unseal(path) == json.loads(json.dumps(world.truth()))
    assert len(unseal(path)["effects"]) == 1
    path.write_text("[]")
    with pytest.raises(ValueError, match="sealed truth"):
        unseal(path)


def test_accelerated_clock_runs_ahead_of_the_hosts() -> None:
    """A thousand rig seconds pass within a host's second or so."""
    clock = RigClock(1e5)
    clock.sleep_until(1000.0)
    assert clock.now_s() >= 1000.0
    world = World(WorldSettings(clock_speed=1e3))
    world.start_stream(RATE_HZ, RANGE_V)
    world.clock.sleep_until(world.clock.now_s() + 1.0)
    assert world.samples_due() >= RATE_HZ
    with pytest.raises(ValueError, match="above 0"):
        RigClock(0.0)


def test_a_driven_clock_moves_only_when_told() -> None:
    """It jumps where somebody waits, and never back."""
    clock = RigClock(math.inf)
    clock.sleep_until(3.0)
    clock.advance_to(2.0)
    assert clock.now_s() == 3.0


def test_noise_has_the_level_and_colour_asked_for() -> None:
    """White, AR(1) and 1/f, each by its own mark."""
    rng = np.random.default_rng(2)
    red = noise_record(NoiseSettings(2e-3, ar1=0.6), 200_000, rng)
    assert np.std(red) == pytest.approx(2e-3, rel=0.02)
    assert np.corrcoef(red[1:], red[:-1])[0, 1] == pytest.approx(0.6, abs=0.01)
    table = noise_table(NoiseSettings(1e-3, pink_corner_hz=1e4), 1 << 18, RATE_HZ, rng)
    power = np.abs(np.fft.rfft(table)) ** 2
    f = np.fft.rfftfreq(table.size, 1 / RATE_HZ)
    low = power[(f > 500) & (f < 1500)].mean() / power[(f > 2e5)].mean()
    assert low == pytest.approx(11.0, rel=0.3)
    with pytest.raises(ValueError, match="ar1"):
        NoiseSettings(ar1=1.0)


def test_no_two_streams_share_their_noise() -> None:
    """What comes before the trigger is new in every shot, whenever it is looked at."""
    world = a_world()
    streams = []
    for _ in range(4):
        world.start_stream(RATE_HZ, RANGE_V)
        streams.append(volts(world.read_codes(0, 1 << 20)))
        world.stop_stream()
    lines = [np.fft.rfft(stream - stream.mean()) for stream in streams]
    for one, other in itertools.combinations(lines, 2):
        shared = np.fft.irfft(one * np.conj(other)) / (1 << 20)
        assert np.abs(shared).max() < 0.01 * 1.5e-3**2


def test_a_cell_model_nobody_knows_is_refused() -> None:
    """Only kv and hsd exist."""
    with pytest.raises(ConfigurationError, match="'kv' or 'hsd'"):
        a_world(cell_model="maxwell")
