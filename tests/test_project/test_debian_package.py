"""The Debian package: built, installed in a clean Debian, used, upgraded and removed again."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from .debian_tree import debian_tree

ROOT = Path(__file__).parents[2]
DEBIAN = ROOT / "systemd" / "debian"
RECORDER = '#!/bin/sh\necho "$*" >>/systemctl.log\n'


@pytest.mark.parametrize("script", ["postinst", "prerm", "postrm"])
def test_what_dpkg_runs_is_shell(script: str) -> None:
    """Each script of the package is one that Debian's shell can read, and ends at an error."""
    subprocess.run(["sh", "-n", DEBIAN / script], check=True)
    assert "\nset -e\n" in (DEBIAN / script).read_text()
    assert os.access(DEBIAN / script, os.X_OK)


class Machine:
    """A clean Debian without a network, entered by chroot."""

    def __init__(self, tree: Path) -> None:
        self.tree = tree

    def run(self, *words: str, fails: bool = False) -> str:
        """Run a command in it; return what it says."""
        done = subprocess.run(
            ["unshare", "--net", "chroot", self.tree, *words],
            capture_output=True,
            text=True,
            check=False,
            timeout=300,
            env={"PATH": "/usr/sbin:/usr/bin:/sbin:/bin", "LC_ALL": "C.UTF-8"},
        )
        assert bool(done.returncode) == fails, done.stdout + done.stderr
        return done.stdout + done.stderr

    def file(self, path: str) -> Path:
        """Return a path in it as seen from outside."""
        return self.tree / path.lstrip("/")


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    """Return a fresh copy of a minimal Debian with what the package depends on."""
    subprocess.run(["cp", "-a", debian_tree(), tmp_path / "tree"], check=True)
    return Machine(tmp_path / "tree")


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the package that `make deb` builds."""
    if sys.version_info[:2] != (3, 11):
        pytest.skip("Debian 12 has Python 3.11, and a package fits the Python it was built with")
    out = tmp_path_factory.mktemp("deb")
    tools = Path(sys.executable).parent
    words = ["deb", "-o", f"{tools}/python", f"BIN={tools}", f"DEB={out}"]
    built = subprocess.run(
        ["make", "--no-print-directory", *words],  # under another make it would say where it is
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert built.returncode == 0, built.stderr
    return Path(built.stdout.split()[-1])


@pytest.mark.integration
@pytest.mark.timeout(1800)
def test_it_is_installed_upgraded_and_removed(machine: Machine, package: Path) -> None:
    """Without a network it runs at once; settings survive an upgrade, recordings even a purge."""
    shutil.copy(package, machine.file("/tmp"))
    inside = f"/tmp/{package.name}"
    before = machine.run("find", "/etc", "/usr", "-not", "-name", "*-")
    assert "fill in /etc/impactd/impactd.toml" in machine.run("dpkg", "--install", inside)

    assert machine.run("impactd", "--version").startswith("impactd ")
    assert "finite_thickness" in machine.run("impactd", "effects")
    user = ("runuser", "-u", "impactd", "--")
    settings = "/etc/impactd/impactd.toml"
    assert "sensor" in machine.run(*user, "impactd", "doctor", "--config", settings, fails=True)
    shares = "/opt/impactd/share/impactd"
    simulated = ("--config", f"{shares}/config/simulated.toml", "--data", "/var/lib/impactd")
    assert machine.run(*user, "impactd", "token", "create", "--scope", "read", *simulated)
    for unit in ("impactd.service", "impactd-calibration.service", "impactd-calibration.timer"):
        shipped = machine.file(f"/usr/lib/systemd/system/{unit}").read_text()
        assert shipped == (ROOT / "systemd" / unit).read_text()
    assert machine.file("/usr/lib/udev/rules.d/60-impactd.rules").exists()
    assert machine.run("dpkg", "--verify", "impactd") == ""

    # an upgrade, where systemd runs: what it would be told is recorded
    machine.file("/run/systemd/system").mkdir(parents=True)
    systemctl = machine.file("/usr/bin/systemctl")
    systemctl.write_text(RECORDER)
    systemctl.chmod(0o755)
    log = machine.file("/systemctl.log")
    machine.file(settings).write_text("# mine\n")
    machine.run("dpkg", "--install", inside)
    told = log.read_text().splitlines()
    assert told.index("stop impactd.service") < told.index("start impactd.service")
    assert machine.file(settings).read_text() == "# mine\n"

    log.unlink()
    machine.run("dpkg", "--remove", "impactd")
    assert "--quiet disable --now impactd-calibration.timer impactd.service" in log.read_text()
    assert not machine.file("/opt/impactd").exists()
    assert not machine.file("/usr/bin/impactd").is_symlink()
    assert machine.file(settings).exists()

    assert "recordings are kept" in machine.run("dpkg", "--purge", "impactd")
    assert not machine.file("/etc/impactd").exists()
    assert any(machine.file("/var/lib/impactd").iterdir())
    systemctl.unlink()
    after = machine.run("find", "/etc", "/usr", "-not", "-name", "*-")
    assert sorted(after.splitlines()) == sorted(before.splitlines())
