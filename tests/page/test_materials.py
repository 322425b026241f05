"""Materials on the page: changed, added, and who did it."""

from __future__ import annotations

import pytest


def test_a_mass_is_changed_and_a_coupon_added(visitor):
    """The tables and the list of changes show it at once; nonsense is refused in the form."""
    page = visitor.page
    visitor.sign_in()
    visitor.go("Materials")
    page.get_by_role("button", name="Change polypropylene").click()
    form = page.get_by_role("form", name="Change polypropylene")
    form.get_by_label("Mass / g", exact=True).fill("much")
    form.get_by_role("button", name="Keep it").click()
    form.get_by_role("alert").get_by_text("Mass / g is no number.").wait_for()
    form.get_by_label("Mass / g", exact=True).fill("0.412")
    form.get_by_label("Standard uncertainty of Mass / g").fill("0.0002")
    form.get_by_label("Why it is changed").fill("new balance")
    form.get_by_role("button", name="Keep it").click()
    row = page.get_by_role("row").filter(has_text="polypropylene")
    row.get_by_text("0.41200(20)").wait_for()
    page.get_by_role("button", name="Add a coupon").click()
    form = page.get_by_role("form", name="Add a coupon")
    form.get_by_label("Name").fill("plate 7")
    form.get_by_label("ν", exact=True).fill("0.37")
    form.get_by_label("Standard uncertainty of ν").fill("0.02")
    form.get_by_label("Where the values come from").fill("lot 7")
    form.get_by_role("button", name="Keep it").click()
    form.get_by_role("alert").get_by_text("not a valid name").wait_for()
    form.get_by_label("Name").fill("plate_7")
    form.get_by_role("button", name="Keep it").click()
    page.get_by_role("row").filter(has_text="plate_7").wait_for()
    page.get_by_text("the operate changed polypropylene").first.wait_for()
    assert "new balance" in page.get_by_role("region", name="What was changed").inner_text()
    # a refusal of the daemon is a line in the browser's console
    assert [one for one in visitor.complaints if "422" not in one] == []


@pytest.mark.parametrize("width", [768, 1024, 1440])
def test_the_tables_are_seen_whole(visitor, width):
    """No column of a material lies beyond the edge; ± is left to expanded uncertainties."""
    page = visitor.page
    page.set_viewport_size({"width": width, "height": 768})
    visitor.sign_in()
    visitor.go("Materials")
    for name in ("Table of spheres", "Table of coupons"):
        table = page.get_by_role("group", name=name)
        table.wait_for()
        assert table.evaluate("(one) => one.scrollWidth - one.clientWidth") <= 0
        assert "±" not in table.inner_text()
    page.get_by_role("row").filter(has_text="aluminium").get_by_text("69.0(1.4)").wait_for()
    visitor.assert_clean()
