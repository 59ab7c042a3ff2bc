"""Columns whose combinations are all quadratic functions of some variables."""

from __future__ import annotations

from itertools import combinations_with_replacement

import numpy as np


def quadratic_columns(variables: np.ndarray) -> np.ndarray:
    """Return 1, the variables (m, J) less their means, and the products of these, (m, k)."""
    centred = variables - variables.mean(axis=0)
    products = [centred[:, one] * centred[:, two]
                for one, two in combinations_with_replacement(range(variables.shape[1]), 2)]
    return np.column_stack((np.ones(len(variables)), centred, *products))
