"""``impactd bridge``: the daemon's events to what else a laboratory speaks."""

# ruff: noqa: PLC0415 - imported when a command runs: `--help` must not wait for brokers

from __future__ import annotations

from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from impactd.console.options import Url

if TYPE_CHECKING:
    from impactd.client.async_rig import AsyncRig

app = typer.Typer(help="Carry events to MQTT, webhooks or Tiled, or show the rig over OPC UA.")

_State = Annotated[
    Path | None,
    typer.Option(
        "--state",
        metavar="FILE",
        help=("Keeps the number of the last event, so that a restart misses nothing."),
    ),
]


@app.command()
def mqtt(  # noqa: PLR0917 - the framework fills them by name
    broker: Annotated[str, typer.Argument(help="Name or address of the broker.")],
    port: Annotated[int | None, typer.Option("--port", help="1883, with --tls 8883.")] = None,
    topic: Annotated[
        str | None, typer.Option("--topic", help="What topics begin with; impactd/RIG.")
    ] = None,
    username: Annotated[str | None, typer.Option("--username")] = None,
    password_file: Annotated[
        Path | None, typer.Option("--password-file", help="File that holds only the password.")
    ] = None,
    tls: Annotated[
        bool, typer.Option("--tls", help="Encrypt, by the system's certificates.")
    ] = False,
    state: _State = None,
    url: Url = None,
) -> None:
    """Publish events and the light to an MQTT 5 broker until it is ended."""
    from impactd.bridges.mqtt import Broker, carry, topic_of
    from impactd.bridges.place import Place
    from impactd.client import talk

    password = None if password_file is None else password_file.read_text("utf-8").strip()

    async def work(rig: AsyncRig) -> None:
        """Carry."""
        at = topic or topic_of((await rig.connection.run(talk.get("/v1/rig")))["name"])
        number = port or (8883 if tls else 1883)
        await carry(rig, Broker(broker, number, at, username, password, tls), Place(state), _say)

    _run(work, url)


@app.command()
def webhook(
    receiver: Annotated[str, typer.Argument(help="URL that takes the POST requests.")],
    secret_file: Annotated[
        Path, typer.Option("--secret-file", help="Holds the shared secret, whsec_BASE64.")
    ],
    kind: Annotated[
        list[str] | None,
        typer.Option("--kind", help="Only events that begin so, e.g. drop.; may be repeated."),
    ] = None,
    state: _State = None,
    url: Url = None,
) -> None:
    """Post each event, signed (Standard Webhooks), again until it is taken, until it is ended."""
    from impactd.bridges.place import Place
    from impactd.bridges.webhook import Receiver, carry, read_secret

    told = Receiver(receiver, read_secret(secret_file.read_text("utf-8")), tuple(kind or ()))
    place = Place(state)
    _run(lambda rig: carry(rig, told, place, _say), url)


@app.command()
def tiled(
    catalogue: Annotated[str, typer.Argument(help="URL of a Tiled server or a container there.")],
    api_key_file: Annotated[
        Path, typer.Option("--api-key-file", help="File that holds only a key that may write.")
    ],
    name: Annotated[
        str | None, typer.Option("--name", help="The rig's name there; by default its own.")
    ] = None,
    state: _State = None,
    url: Url = None,
) -> None:
    """Keep every stored shot and its modulus in a Tiled server until it is ended.

    Several rigs may share one server. Without a state, all shots are registered first.
    """
    from impactd.bridges.catalogue import Catalogue, carry
    from impactd.bridges.place import Place
    from impactd.client import talk

    api_key = api_key_file.read_text("utf-8").strip()

    async def work(rig: AsyncRig) -> None:
        """Carry."""
        called = name or (await rig.connection.run(talk.get("/v1/rig")))["name"]
        await carry(rig, Catalogue(catalogue, api_key, called), Place(state), _say)

    _run(work, url)


@app.command()
def opcua(
    endpoint: Annotated[
        str, typer.Option("--endpoint", help="Where OPC UA clients connect.")
    ] = "opc.tcp://127.0.0.1:4840/impactd",
    url: Url = None,
) -> None:
    """Show the rig over OPC UA until it is ended.

    Without encryption: leave it on loopback, or on a network of the rig's own. Its methods Abort
    and Drop do what the token allows.
    """
    from impactd.bridges.opcua import serve

    _run(lambda rig: serve(rig, endpoint), url)


def _say(sentence: str) -> None:
    typer.echo(sentence, err=True)


def _run(work: Callable[[AsyncRig], Awaitable[None]], url: str | None) -> None:
    import asyncio

    from impactd.bridges.other_end import first_error
    from impactd.client.async_rig import AsyncRig

    async def with_rig() -> None:
        """Work, and close the line."""
        async with AsyncRig(url) as rig:
            await work(rig)

    try:
        asyncio.run(with_rig())
    except BaseExceptionGroup as group:
        raise first_error(group) from None  # a person reads one sentence
