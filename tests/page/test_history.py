"""Shots: search, compare, download."""

from __future__ import annotations

import csv
import hashlib
import json
import re

import h5py
import pytest


@pytest.fixture
def two_shots(visitor):
    """Sign in and make two shots of two pairs; return the visitor and the numbers."""
    visitor.sign_in()
    made = []
    for sphere, surface in (("acetal", "specimen"), ("hdpe", "pvc")):
        visitor.choose(sphere, surface, 20)
        visitor.arm_and_drop()
        words = visitor.page.get_by_text(f"{sphere} on {surface} from 20 mm, Ada")
        words.nth(1).wait_for()  # over the steps, and over the result
        visitor.page.locator(".modulus").wait_for()
        heading = visitor.page.get_by_role("region", name="The latest shot").get_by_role("heading")
        made.append(int(heading.inner_text().split()[1]))
    return visitor, made


@pytest.mark.slow
def test_shots_are_found_compared_and_taken_away(two_shots, tmp_path):
    """Search by material and number; traces over each other; HDF5, CSV and JSON as files."""
    visitor, (first, second) = two_shots
    page = visitor.page
    visitor.go("Shots")
    shots = page.get_by_role("region", name="Shots")
    shots.get_by_role("columnheader", name="E* ± U (95 %) / GPa").wait_for()
    assert "MPa" not in shots.inner_text()  # one unit in a column, also of shots below 1 GPa
    page.get_by_label("Search").fill("HDPE")
    page.get_by_role("link", name=str(first), exact=True).wait_for(state="detached")
    page.get_by_label(f"Choose shot {second}", exact=True).check()
    page.get_by_label("Search").fill("specimen")
    page.get_by_label(f"Choose shot {first}", exact=True).check()
    page.get_by_role("link", name="Compare traces").click()
    page.locator(".legendtext").nth(1).wait_for(state="attached")
    names = page.locator(".legendtext").all_text_contents()
    assert names == [f"{first}: acetal on specimen", f"{second}: hdpe on pvc"]
    apart = page.evaluate(_DIFFERENCE)
    assert apart == [None, 1.0, 1.5, None]
    page.locator(".y2title").get_by_text(f"minus shot {first}").wait_for(state="attached")
    row = page.get_by_role("row").filter(has=page.get_by_role("link", name=str(second), exact=True))
    assert re.search(r"−\d+ %", row.inner_text())

    page.goto(f"{visitor.daemon.url}/#/shots/{first}")
    files = {}
    for form in ("HDF5", "CSV", "JSON"):
        with page.expect_download() as download:
            page.get_by_role("link", name=f"Download {form}").click()
        files[form] = tmp_path / download.value.suggested_filename
        download.value.save_as(files[form])
    shot = json.loads(files["JSON"].read_text())
    content = files["HDF5"].read_bytes()
    assert hashlib.sha256(content).hexdigest() == shot["sha256"]
    with h5py.File(files["HDF5"]) as file:
        assert "entry" in file
    with files["CSV"].open(newline="") as text:
        rows = list(csv.reader(text))
    assert rows[0] == ["time_s", "volts"]
    assert len(rows) == shot["samples"] + 1
    assert max(float(volts) for _, volts in rows[1:]) == pytest.approx(shot["peak"], abs=0.01)
    assert files["HDF5"].name == f"shot-{first:06d}.h5"
    visitor.assert_clean()


_DIFFERENCE = """async () => {
  const { difference } = await import('/page/charts/compare.js');
  return difference({ x: [-1, 0, 1.5, 9], y: [1, 1, 3, 3] }, { x: [0, 1, 2], y: [0, 1, 2] });
}"""
_WARM_DROP = """async () => {
  const session = await (await fetch('/v1/session')).json();
  const environment = {
    temperature_C: { value: 21.3, u: 0.2 },
    relative_humidity: { value: 0.45, u: 0.02 },
  };
  const pair = { sphere: 'acetal', surface: 'specimen', drop_height_m: 0.02, operator: 'Ada' };
  const answer = await fetch('/v1/drops', {
    method: 'POST',
    headers: {
      'Content-Type': 'application/json',
      'Idempotency-Key': crypto.randomUUID(),
      'X-CSRF-Token': session.csrf,
    },
    body: JSON.stringify({ ...pair, environment }),
  });
  return (await answer.json()).number;
}"""
_ANALYSED = """async (number) => {
  for (;;) {
    const drop = await (await fetch(`/v1/drops/${number}`)).json();
    if (drop.state === 'analysed') return drop.shot;
    await new Promise((go_on) => setTimeout(go_on, 500));
  }
}"""


def test_a_shot_shows_temperature_and_humidity_where_they_are_known(visitor):
    """With twice their standard uncertainty, as every number on the page."""
    page = visitor.page
    visitor.sign_in()
    page.locator(".go button[aria-disabled=false]").wait_for()
    number = page.evaluate(_WARM_DROP)
    shot = page.evaluate(_ANALYSED, number)
    page.goto(f"{visitor.daemon.url}/#/shots/{shot}")
    circumstances = page.get_by_role("region", name="Conditions")
    circumstances.get_by_text("21.30 ± 0.39 °C, 45.0 ± 3.9 %").wait_for()
    visitor.assert_clean()


def test_a_shot_is_shown_when_its_traces_do_not_come(visitor):
    """The numbers stay, each picture says why it is missing, and both come once the line holds."""
    page = visitor.page
    visitor.sign_in()
    page.locator(".go button[aria-disabled=false]").wait_for()
    shot = page.evaluate(_ANALYSED, page.evaluate(_WARM_DROP))
    page.route("**/trace?**", lambda route: route.abort())
    page.goto(f"{visitor.daemon.url}/#/shots/{shot}")
    result = page.get_by_role("region", name="Result")
    record = page.get_by_role("region", name="The whole record")
    for place in (result, record):
        place.get_by_text("The daemon does not answer.").wait_for()
    told = result.locator(".verdict .modulus").inner_text()
    page.unroute("**/trace?**")
    visitor.context.set_offline(True)
    page.get_by_role("alert").filter(has_text="The connection is lost.").wait_for()
    assert result.locator(".verdict .modulus").inner_text() == told
    visitor.context.set_offline(False)
    for place in (result, record):
        place.locator(".js-plotly-plot").wait_for()
    assert result.locator(".verdict .modulus").inner_text() == told
