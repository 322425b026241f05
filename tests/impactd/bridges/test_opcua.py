"""The rig over OPC UA, seen by asyncua's stock client."""

from __future__ import annotations

import asyncio
import contextlib
import socket

import pytest

from impactd.bridges.opcua import NAMESPACE, serve
from impactd.client import AsyncRig
from tests.impactd.api.conftest import ACETAL_ON_ALUMINIUM, Rig

asyncua = pytest.importorskip("asyncua")


async def until(look, fine) -> object:
    """Return what is seen once it is fine."""
    async with asyncio.timeout(60):
        while not fine(seen := await look()):
            await asyncio.sleep(0.05)
    return seen


@contextlib.asynccontextmanager
async def seen_through(served: Rig, scope: str):
    """A client's view of a rig whose bridge has a token of that scope."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        endpoint = f"opc.tcp://127.0.0.1:{free.getsockname()[1]}/impactd"
    started = asyncio.Event()
    async with AsyncRig(served.url, served.token(scope)) as rig:
        work = asyncio.create_task(serve(rig, endpoint, started=started))
        await asyncio.wait_for(started.wait(), 30)
        try:
            async with asyncua.Client(endpoint, timeout=60) as client:
                space = await client.get_namespace_index(NAMESPACE)
                device = await client.nodes.objects.get_child(f"{space}:Rig")

                async def read(name: str) -> object:
                    return await (await device.get_child(f"{space}:{name}")).read_value()

                yield device, space, read
        finally:
            work.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await work


def test_a_drop_over_opc_ua_ends_in_its_variables(served: Rig) -> None:
    """The method Drop drops; light, shot, advice and modulus are read as variables."""
    body = ACETAL_ON_ALUMINIUM

    async def story() -> None:
        async with seen_through(served, "operate") as (device, space, read):
            await until(lambda: read("Ready"), bool)
            assert str(await read("Sentence")).startswith("READY")
            number = await device.call_method(
                f"{space}:Drop", body["sphere"], body["surface"], body["drop_height_m"], "ab"
            )
            await until(lambda: read("LastShot"), lambda shot: shot == number)
            assert await read("LastSphere") == body["sphere"]
            modulus = await read("LastReducedModulusPa")
            assert 1e9 < modulus < 10e9
            assert 0 < await read("LastReducedModulusExpandedUncertaintyPa") < modulus

    asyncio.run(story())


def test_a_bridge_with_a_reading_token_moves_nothing(served: Rig) -> None:
    """Drop and Abort are refused; the variables are still there."""

    async def story() -> None:
        async with seen_through(served, "read") as (device, space, read):
            denied = asyncua.ua.uaerrors.BadUserAccessDenied
            with pytest.raises(denied):
                await device.call_method(f"{space}:Drop", "acetal", "aluminium", 0.03, "ab")
            with pytest.raises(denied):
                await device.call_method(f"{space}:Abort")
            assert await read("State")

    asyncio.run(story())
    assert served.reader.get("/v1/log").json()["items"][0]["data"].get("status") == 403
