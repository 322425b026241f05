"""MQTT 5: every event once to its topic, and the light as a retained message.

=====================================  =========================================================
``impactd/<rig>/status``               the light (retained)
``impactd/<rig>/online``               ``true`` or ``false`` (retained; the broker says ``false``
                                       when the bridge dies)
``impactd/<rig>/events/<a>/<b>``       each event of kind ``a.b``, QoS 1
=====================================  =========================================================
"""

from __future__ import annotations

import asyncio
import contextlib
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from impactd.bridges.message import event_json, status_json
from impactd.bridges.other_end import OtherEnd, Say
from impactd.bridges.place import Place
from impactd.client.async_rig import AsyncRig
from impactd.client.errors import LostError, RigError, UnreachableError
from impactd.client.events import Event

if TYPE_CHECKING:
    import aiomqtt
    from paho.mqtt.properties import Properties

LIGHT_EVERY_S = 2.0
"""As often as the page looks; every event brings a look of its own."""
AGAIN_AFTER_S = 2.0
"""A broker or a daemon is back seconds after a restart."""
_EXACTLY_ONE_ACK = 1
"""QoS 1: the broker acknowledges, and only then does the place move on."""


@dataclass(frozen=True)
class Broker:
    """Where messages go.

    Attributes
    ----------
    host : str
        Name or address.
    port : int
        1883, or 8883 with ``tls``.
    topic : str
        What all topics begin with, ``impactd/<rig>``.
    username, password : str or None
        As the broker asks for them.
    tls : bool
        Whether the line is encrypted, checked by the system's certificates.
    """

    host: str
    port: int
    topic: str
    username: str | None = None
    password: str | None = None
    tls: bool = False


async def carry(rig: AsyncRig, broker: Broker, place: Place, say: Say) -> None:
    """Carry events and the light to a broker until cancelled; a lost line is taken up again.

    Parameters
    ----------
    place : Place
        Behind which event it begins. An event may arrive twice after a crash, with one id; none
        is left out.
    say : callable
        Takes a sentence when the broker or the daemon is away, and when it is back.

    Raises
    ------
    RigError
        If aiomqtt is not installed, or the token is not valid.
    """
    try:
        import aiomqtt  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise RigError("this needs aiomqtt: pip install 'impactd[bridges]'.") from error
    will = aiomqtt.Will(f"{broker.topic}/online", b"false", qos=1, retain=True)
    there = OtherEnd(f"The MQTT broker {broker.host}:{broker.port}", say)
    daemon = OtherEnd("The daemon", say)
    while True:
        try:
            async with aiomqtt.Client(
                broker.host,
                broker.port,
                username=broker.username,
                password=broker.password,
                tls_params=aiomqtt.TLSParameters() if broker.tls else None,
                protocol=aiomqtt.ProtocolVersion.V5,
                will=will,
            ) as client:
                await client.publish(f"{broker.topic}/online", b"true", qos=1, retain=True)
                there.is_there()
                await _session(rig, client, broker.topic, place, daemon)
        # both come back
        except* aiomqtt.MqttError as group:
            there.is_away(group)
        except* (LostError, UnreachableError) as group:
            daemon.is_away(group)
        await asyncio.sleep(AGAIN_AFTER_S)


async def _session(
    rig: AsyncRig, client: aiomqtt.Client, topic: str, place: Place, daemon: OtherEnd
) -> None:
    changed = asyncio.Event()
    async with asyncio.TaskGroup() as group:
        group.create_task(_tell_light(rig, client, topic, changed, daemon))
        async for event in rig.events(place.last):
            await client.publish(
                event_topic(topic, event), event_json(event), qos=_EXACTLY_ONE_ACK,
                properties=_properties(event),
            )  # fmt: skip
            place.arrived(event.id)
            changed.set()


async def _tell_light(
    rig: AsyncRig,
    client: aiomqtt.Client,
    topic: str,
    changed: asyncio.Event,
    daemon: OtherEnd,
) -> None:
    told = b""
    while True:
        changed.clear()
        light = status_json(await rig.status())
        daemon.is_there()
        if light != told:
            await client.publish(f"{topic}/status", light, qos=_EXACTLY_ONE_ACK, retain=True)
            told = light
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(changed.wait(), LIGHT_EVERY_S)


def _properties(event: Event) -> Properties:
    from paho.mqtt.packettypes import PacketTypes  # noqa: PLC0415 - comes with aiomqtt
    from paho.mqtt.properties import Properties  # noqa: PLC0415 - as above

    found = Properties(PacketTypes.PUBLISH)
    found.ContentType = "application/json"
    found.UserProperty = [("event-id", str(event.id))]
    return found


def topic_of(rig_name: str) -> str:
    """Return what the topics of a rig begin with; what MQTT reserves becomes a dash."""
    return "impactd/" + re.sub(r"[/+#\s]+", "-", rig_name)


def event_topic(topic: str, event: Event) -> str:
    """Return where an event goes: ``drop.stored`` to ``.../events/drop/stored``."""
    return f"{topic}/events/{event.kind.replace('.', '/')}"
