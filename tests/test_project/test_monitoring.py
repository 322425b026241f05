"""Alert rules and dashboard ask for metrics that the daemon has, and promtool accepts them."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[2]
MONITORING = ROOT / "systemd" / "monitoring"
needs_promtool = pytest.mark.skipif(
    shutil.which("promtool") is None, reason="needs promtool (Debian: apt install prometheus)"
)


def known() -> set[str]:
    """Return the names of all metrics in the sources."""
    found = set()
    for file in (ROOT / "impactd" / "api").glob("*metrics.py"):
        found |= set(re.findall(r'"(impactd_\w+)"', file.read_text("utf-8")))
    wide = {f"{name}_expanded_uncertainty" for name in found if name.startswith("impactd_cell_")}
    return found | wide | {"impactd_http_requests_total", "impactd_http_request_seconds_bucket"}


def asked(expressions: list[str]) -> set[str]:
    """Return the metrics that expressions name."""
    return {name for one in expressions for name in re.findall(r"impactd_\w+", one)}


def test_alerts_and_dashboard_name_what_there_is() -> None:
    """No rule and no panel waits for a metric that the daemon does not have."""
    rules = yaml.safe_load((MONITORING / "alerts.yml").read_text("utf-8"))["groups"][0]["rules"]
    board = json.loads((MONITORING / "dashboard.json").read_text("utf-8"))
    panels = [target["expr"] for panel in board["panels"] for target in panel["targets"]]
    assert asked([rule["expr"] for rule in rules]) <= known()
    assert asked(panels) <= known()
    assert len({panel["id"] for panel in board["panels"]}) == len(board["panels"])
    for rule in rules:
        assert {"summary", "remedy"} <= rule["annotations"].keys()


@needs_promtool
@pytest.mark.parametrize(
    "words",
    [
        ("check", "rules", "alerts.yml"),
        ("test", "rules", "alerts_test.yml"),
        ("check", "config", "prometheus.yml"),
    ],
    ids=lambda words: " ".join(words[:2]),
)
def test_promtool_accepts_the_rules(words: tuple[str, ...]) -> None:
    """Rules and configuration are valid, and the rules fire when they should."""
    made = subprocess.run(
        ["promtool", *words], cwd=MONITORING, capture_output=True, text=True, check=False
    )
    assert made.returncode == 0, made.stdout + made.stderr


@needs_promtool
def test_every_expression_of_the_dashboard_is_promql(tmp_path: Path) -> None:
    """Each panel's expression, its variables filled in, is one that promtool parses."""
    board = json.loads((MONITORING / "dashboard.json").read_text("utf-8"))
    rules = [
        {"record": f"panel:{panel['id']}:{target['refId']}", "expr": target["expr"]}
        for panel in board["panels"]
        for target in panel["targets"]
    ]
    file = tmp_path / "rules.yml"
    file.write_text(yaml.safe_dump({"groups": [{"name": "panels", "rules": rules}]}))
    made = subprocess.run(
        ["promtool", "check", "rules", str(file)], capture_output=True, text=True, check=False
    )
    assert made.returncode == 0, made.stdout + made.stderr
