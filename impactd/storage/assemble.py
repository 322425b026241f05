"""Archive shots as a campaign: what the analysis gets to see."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol, TypeVar

from analysis.campaign import Campaign, Sensor, Shot, Sphere, Surface, Uncertainty
from impactd.storage.errors import ArchiveError
from impactd.storage.shot_metadata import StoredShot

M = TypeVar("M", Sphere, Surface)


class MaterialNames(Protocol):
    """The part of the materials file that is needed here."""

    @property
    def spheres(self) -> Mapping[str, Sphere]:
        """Spheres by name."""

    @property
    def surfaces(self) -> Mapping[str, Surface]:
        """Surfaces by name."""


def assemble_campaign(
    shots: Sequence[StoredShot],
    materials: MaterialNames | None,
    sensor: Sensor,
    gravity_m_per_s2: float,
    speed_repeatability: float | None,
) -> Campaign:
    """Return shots of the archive as one campaign, sorted by number and named ``shot 17``.

    Parameters
    ----------
    materials : MaterialNames or None
        Today's materials: for drops of this rig they win over what the files remember, so that
        a corrected mass reaches old shots. A name they do not know, and all of an import, is taken
        from the file.
    speed_repeatability : float or None
        Relative standard deviation of the impact speed. [1]

    Raises
    ------
    ArchiveError
        If two shots describe one material differently.
    """
    spheres: dict[str, Sphere] = {}
    surfaces: dict[str, Surface] = {}
    for stored in shots:
        ours = None if stored.metadata.source == "import" else materials
        _take(spheres, stored.metadata.sphere, {} if ours is None else ours.spheres)
        _take(surfaces, stored.metadata.surface, {} if ours is None else ours.surfaces)
    return Campaign(
        shots=tuple(
            campaign_shot(stored) for stored in sorted(shots, key=lambda one: one.shot.number)
        ),
        spheres=spheres,
        surfaces=surfaces,
        sensor=sensor,
        gravity_m_per_s2=gravity_m_per_s2,
        speed_repeatability=speed_repeatability,
    )


def _take(found: dict[str, M], remembered: M | None, today: Mapping[str, M]) -> None:
    if remembered is None:
        return
    one = today.get(remembered.name, remembered)
    if found.setdefault(one.name, one) != one:
        raise ArchiveError(
            f"The shots disagree about {one.name!r}.",
            why="They were imported from campaigns that describe it differently.",
            remedy="Fit them separately.",
        )


def campaign_shot(stored: StoredShot) -> Shot:
    """Return one shot of the archive as the analysis sees it, named ``shot 17``."""
    recording, metadata = stored.recording, stored.metadata
    return Shot(
        name=f"shot {stored.shot.number}",
        signal=recording.signal,
        sample_rate_hz=recording.sample_rate_hz,
        trigger_index=recording.trigger_index,
        quantity=recording.quantity,
        sphere=None if metadata.sphere is None else metadata.sphere.name,
        surface=None if metadata.surface is None else metadata.surface.name,
        drop_height_m=metadata.drop_height_m,
        restitution=metadata.restitution,
        quantum=recording.quantum,
        clipped=recording.clipped,
        code_zero=recording.offset,
        environment=metadata.environment,
        u_sample_rate_hz=Uncertainty(recording.sample_rate_u_hz)
        if recording.sample_rate_u_hz > 0
        else None,
    )
