# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What a search remembers of the nodes: how many have changed their status in its last states."""

from types import SimpleNamespace

import numpy as np
import pytest

from dolfinx_contact.solvers.search import COUNTED_ITERATES, Search


@pytest.mark.parametrize("states", [1, 2, 3, COUNTED_ITERATES, COUNTED_ITERATES + 1, 200])
@pytest.mark.parametrize("rate", [0.0, 0.01, 0.5])
def test_changes_are_those_of_all_statuses(states, rate):
    """Counted as they come, in two contacts, one of them empty or not: as many as a table of all statuses has in its last rows."""
    random = np.random.default_rng(states)
    search, rows = Search(None, None, np.inf), []
    row = random.integers(3, size=40)
    for _ in range(states):
        row = np.where(random.random(40) < rate, random.integers(3, size=40), row)
        parts = np.split(row.astype(np.uint8), [states % 40])
        search.count_changes(SimpleNamespace(nodes=[SimpleNamespace(status=s) for s in parts]))
        rows.append(row)
    last = np.array(rows[-COUNTED_ITERATES:])
    changed = (last[1:] != last[:-1]).any(axis=0).sum()
    assert search.changes == (changed, len(last))
