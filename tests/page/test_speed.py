"""How quick the page is: figures that are printed; only a hopeless one fails."""

from __future__ import annotations

from tests.page.conftest import TABLET, Visitor

_HOPELESS_MS = 20_000  # machines are noisy; the goals are 1 s, 0.5 s and 2 s

_FIRST_PAINT = """() => performance.getEntriesByType('paint')
  .find((entry) => entry.name === 'first-contentful-paint').startTime"""
_DRAW = """async (number) => {
  const { drawRecord } = await import('/page/charts/trace.js');
  const { plotly } = await import('/page/charts/plotly.js');
  await plotly();
  const place = document.createElement('div');
  place.className = 'chart flat';
  document.querySelector('main').append(place);
  const begun = performance.now();
  const answer = await fetch(`/v1/shots/${number}/trace?points=4000`);
  const trace = await answer.json();
  const fetched = performance.now();
  await drawRecord(place, trace);
  await new Promise((drawn) => requestAnimationFrame(() => setTimeout(drawn)));
  const ended = performance.now();
  place.remove();
  return { samples: trace.samples, fetch: fetched - begun, draw: ended - fetched };
}"""
_HEAR_OF_STORED = """() => {
  const source = new EventSource('/v1/events');
  window.stored = new Promise((heard) => source.addEventListener('drop.stored', () => {
    source.close();
    heard(performance.now());
  }));
}"""
_SINCE_STORED = "async () => performance.now() - await window.stored"


def _shots(page) -> list[dict]:
    """Return the shots as the page is told of them, the last first."""
    return page.evaluate("fetch('/v1/shots').then((answer) => answer.json())")["items"]


def test_a_modulus_is_on_the_screen_soon_after_the_impact(daemon, browser):
    """Of warm drops; a record ends long after its impact, and the rig's clock runs fast here."""
    visitor = Visitor(daemon, browser, size=TABLET)
    page = visitor.page
    visitor.sign_in()
    took_ms = []
    for _ in range(3):
        visitor.go("Log")
        visitor.go("Drop")
        before = _shots(page)
        number = before[0]["number"] + 1 if before else 1
        visitor.choose("acetal", "polycarbonate", 25)
        page.evaluate(_HEAR_OF_STORED)
        visitor.arm_and_drop()
        visitor.shot(number)
        since_stored_ms = page.evaluate(_SINCE_STORED)
        shot = page.evaluate(f"fetch('/v1/shots/{number}').then((answer) => answer.json())")
        rest_ms = 1e3 * (shot["samples"] - shot["trigger_index"]) / shot["sample_rate_hz"]
        took_ms.append(rest_ms + since_stored_ms)
    print(f"\nmodulus shown after the impact: {', '.join(f'{one:.0f}' for one in took_ms)} ms")
    assert min(took_ms) < _HOPELESS_MS
    visitor.context.close()


def test_the_page_is_there_at_once_and_draws_a_record_quickly(daemon, browser):
    """First paint without plotly; 400 000 samples drawn from 4000 that lose no spike."""
    visitor = Visitor(daemon, browser, size=TABLET)
    page = visitor.page
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    paints = []
    for _ in range(3):
        page.goto(daemon.url)
        page.get_by_label("Token").wait_for()
        paints.append(page.evaluate(_FIRST_PAINT))
    assert not any("plotly.min.js" in url for url in asked)
    visitor.sign_in()
    found = _shots(page)
    if not found:
        visitor.choose("acetal", "specimen", 30)
        visitor.arm_and_drop()
        page.locator(".modulus").wait_for()
        found = _shots(page)
    drawn = [page.evaluate(_DRAW, found[0]["number"]) for _ in range(4)]
    print(f"\nfirst contentful paint: {', '.join(f'{one:.0f}' for one in paints)} ms")
    for one in drawn:
        print(
            f"{one['samples']} samples: asked for in {one['fetch']:.0f} ms, "
            f"drawn in {one['draw']:.0f} ms"
        )
    assert drawn[0]["samples"] == 400_000
    assert min(paints) < _HOPELESS_MS
    assert min(one["draw"] for one in drawn) < _HOPELESS_MS
    visitor.context.close()
