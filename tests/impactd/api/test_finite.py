"""JSON without NaN."""

from __future__ import annotations

import json
import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from impactd.api.finite import without_nan

_TEXT = st.text(st.characters(exclude_categories=()))  # lone surrogates too


def test_numpy_values_become_plain_ones():
    """Scalars and arrays of numpy are values like any other."""
    given_value = {"a": np.float32(1.5), "b": np.array([1.0, math.nan]), 3: (np.int64(2), True)}
    assert without_nan(given_value) == {"a": 1.5, "b": [1.0, None], "3": [2, True]}


@settings(deadline=None)
@given(
    st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats() | _TEXT,
        lambda inner: st.lists(inner) | st.dictionaries(_TEXT, inner),
    )
)
def test_whatever_comes_out_is_json(value):
    """Any nested value can be written as strict JSON."""
    json.dumps(without_nan(value), allow_nan=False, ensure_ascii=False).encode()
