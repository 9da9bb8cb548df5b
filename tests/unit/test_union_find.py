"""Connected sets: the root of a set is its lowest element, whatever the order of the links."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from rigidimpulse.core.union_find import roots


def test_roots_are_the_lowest_elements_of_connected_components() -> None:
    random = np.random.default_rng(4)
    for number, links in ((1, 0), (2, 1), (50, 20), (50, 49), (400, 390)):
        first, second = random.integers(number, size=(2, links))
        found = roots(number, first, second)
        _, label = connected_components(coo_array((np.ones(links), (first, second)), shape=(number, number)), directed=False)
        wanted = np.array([np.flatnonzero(label == label[i])[0] for i in range(number)])
        np.testing.assert_array_equal(found, wanted)
        shuffled = random.permutation(links)
        np.testing.assert_array_equal(roots(number, second[shuffled], first[shuffled]), wanted)


def test_a_link_too_few_is_noticed() -> None:
    chain = np.arange(9)
    assert not roots(10, chain, chain + 1).any()
    assert np.array_equal(np.unique(roots(10, np.delete(chain, 4), np.delete(chain + 1, 4))), [0, 5])
