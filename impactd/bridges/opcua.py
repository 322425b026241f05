"""OPC UA: the rig as an object with variables, and methods that ask the daemon.

See ``impactd/decisions/0005-opc-ua-rather-than-epics.md``.
"""

from __future__ import annotations

import asyncio
import contextlib
from typing import Any

from impactd.client.async_rig import AsyncRig
from impactd.client.errors import RigError, TokenError
from impactd.client.shot import Shot

NAMESPACE = "urn:impactd:rig"
LIGHT_EVERY_S = 1.0
"""A choice: who subscribes is told of a change within a second."""


async def serve(rig: AsyncRig, endpoint: str, *, started: asyncio.Event | None = None) -> None:
    """Serve a rig over OPC UA until cancelled.

    Parameters
    ----------
    rig : AsyncRig
        With a token that may read; methods need one that may operate.
    endpoint : str
        For example ``opc.tcp://127.0.0.1:4840/impactd``.
    started : asyncio.Event, optional
        Set once clients are answered.

    Raises
    ------
    RigError
        If asyncua is not installed.
    """
    try:
        from asyncua import Server  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise RigError("this needs asyncua: pip install 'impactd[bridges]'.") from error
    server = Server()
    await server.init()
    server.set_endpoint(endpoint)
    server.set_server_name("impactd")
    space = await server.register_namespace(NAMESPACE)
    device = await server.nodes.objects.add_object(space, "Rig")
    shown = await _add_variables(device, space)
    await _add_methods(device, space, rig)
    async with server:
        if started is not None:
            started.set()
        async with asyncio.TaskGroup() as group:
            group.create_task(_show_light(rig, shown))
            group.create_task(_show_shots(rig, shown))


_VARIABLES: dict[str, Any] = {
    "Ready": False,
    "Sentence": "",
    "State": "",
    "DropUnderWay": 0,
    "LastShot": 0,
    "LastSphere": "",
    "LastSurface": "",
    "LastAdvice": "",
    "LastPeak": 0.0,
    "LastReducedModulusPa": float("nan"),
    "LastReducedModulusExpandedUncertaintyPa": float("nan"),
}
"""OPC UA has a type for every variable; what is not known is 0, empty or not-a-number."""


async def _add_variables(device: Any, space: int) -> dict[str, Any]:
    return {
        name: await device.add_variable(space, name, value) for name, value in _VARIABLES.items()
    }


async def _show_light(rig: AsyncRig, shown: dict[str, Any]) -> None:
    while True:
        try:
            status = await rig.status()
        except RigError as error:
            await _write(shown, Ready=False, Sentence=f"NOT READY: {error}", State="UNKNOWN")
        else:
            await _write(
                shown, Ready=status.ready, Sentence=status.sentence, State=status.state,
                DropUnderWay=status.drop or 0,
            )  # fmt: skip
        await asyncio.sleep(LIGHT_EVERY_S)


async def _show_shots(rig: AsyncRig, shown: dict[str, Any]) -> None:
    async for shot in rig.shots(limit=1):
        await _show_shot(shown, shot)
    async for event in rig.events():
        if event.kind == "drop.analysed":
            with contextlib.suppress(RigError):
                await _show_shot(shown, await rig.shot(int(event.data["shot"])))


async def _show_shot(shown: dict[str, Any], shot: Shot) -> None:
    found = shot.usable_modulus
    nan = float("nan")
    await _write(
        shown,
        LastSphere=shot.sphere or "",
        LastSurface=shot.surface or "",
        LastAdvice=shot.advice or "",
        LastPeak=float(shot.peak),
        LastReducedModulusPa=float(found["value"]) if found else nan,
        LastReducedModulusExpandedUncertaintyPa=float(found["expanded"]["U"]) if found else nan,
        LastShot=shot.number,  # last: who subscribes to it finds the rest in place
    )


async def _write(shown: dict[str, Any], **values: Any) -> None:
    for name, value in values.items():
        await shown[name].write_value(value)


async def _add_methods(device: Any, space: int, rig: AsyncRig) -> None:
    from asyncua import ua, uamethod  # noqa: PLC0415 - as above

    def refused(error: RigError) -> Any:
        """Return the status code of a refusal; the daemon's words are in its log."""
        denied = isinstance(error, TokenError)
        codes = ua.StatusCodes
        return ua.StatusCode(codes.BadUserAccessDenied if denied else codes.BadInvalidState)

    @uamethod  # type: ignore[untyped-decorator]
    async def abort(parent: Any) -> Any:
        """Abort whatever the rig does, and return the daemon's sentence."""
        del parent
        try:
            return (await rig.abort()).sentence
        except RigError as error:
            return refused(error)

    @uamethod  # type: ignore[untyped-decorator]
    async def drop(parent: Any, sphere: str, surface: str, height_m: float, operator: str) -> Any:
        """Begin a drop and return its number."""
        del parent
        try:
            return await rig.begin_drop(sphere, surface, height_m, operator=operator)
        except RigError as error:
            return refused(error)

    text, number = ua.VariantType.String, ua.VariantType.Double
    await device.add_method(space, "Abort", abort, [], [text])
    await device.add_method(space, "Drop", drop, [text, text, number, text], [ua.VariantType.Int64])
