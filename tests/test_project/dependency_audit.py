"""Are the installed packages known to be vulnerable, and do they fit each other? For `make check`.

pip-audit asks the advisory database of PyPI. Where that cannot be reached (no network, a mirror
without advisories) this says so and checks the rest: a check that needs the network must not keep
anybody from working without one, and must not pass silently either.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence

LIMIT_S = 120


def verdict(report: str) -> tuple[list[str], str]:
    """Return what a report of pip-audit says.

    Parameters
    ----------
    report : str
        JSON of ``pip-audit --format json``, or nothing.

    Returns
    -------
    tuple of list of str and str
        Known vulnerabilities, one line each, and why the report is incomplete, if it is.
    """
    try:
        packages = json.loads(report)["dependencies"]
    except (ValueError, KeyError, TypeError):
        return [], "pip-audit reached no advisory database"
    found = [
        f"{package['name']} {package['version']}: {known['id']}, mended in "
        f"{', '.join(known['fix_versions']) or 'no version yet'}"
        for package in packages
        for known in package.get("vulns", ())
    ]
    missing = sum("skip_reason" in package for package in packages)
    return found, f"{missing} of {len(packages)} packages could not be looked up" if missing else ""


def _run(*command: str) -> subprocess.CompletedProcess[str]:
    try:
        return subprocess.run(
            [sys.executable, "-m", *command],
            capture_output=True,
            text=True,
            check=False,
            timeout=LIMIT_S,
        )
    except subprocess.TimeoutExpired:
        return subprocess.CompletedProcess(command, 1, "", "no answer in time")


def main(arguments: Sequence[str] = ()) -> int:
    """Return 1 when something is known to be wrong, 0 otherwise; say what was not checked."""
    fits = _run("pip", "--disable-pip-version-check", "check")
    if fits.returncode:
        print(f"dependencies: {fits.stdout.strip()}", file=sys.stderr)
    audit = _run(
        "pip_audit", "--local", "--format", "json", "--progress-spinner", "off", *arguments
    )
    found, incomplete = verdict(audit.stdout)
    for line in found:
        print(f"dependencies: {line}", file=sys.stderr)
    if incomplete:
        print(
            f"dependencies: NOT AUDITED for known vulnerabilities: {incomplete}. Only that they "
            "fit each other was checked; run `make audit` again with a network.",
            file=sys.stderr,
        )
    return int(bool(found) or bool(fits.returncode))


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
