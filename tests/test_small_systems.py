"""Linear systems of a model's columns against numpy's, with and without what rounding leaves."""

from __future__ import annotations

import numpy as np
import pytest

from par4_identification.diagnosis.evidence.estimates import _with_columns
from par4_identification.diagnosis.evidence.small_systems import (
    directions,
    orthonormal,
    quadratic,
    solved,
)


@pytest.fixture
def columns() -> np.ndarray:
    """Return four designs of five columns, (4, 40, 5), of very different sizes."""
    rng = np.random.default_rng(3)
    return rng.normal(size=(4, 40, 5)) * 10.0 ** np.arange(-6.0, 4.0, 2.0)


def test_what_columns_explain_is_what_least_squares_leaves(columns) -> None:
    target = np.random.default_rng(4).normal(size=40)
    gram, moment = columns.transpose(0, 2, 1) @ columns, columns.transpose(0, 2, 1) @ target
    left = [np.linalg.lstsq(part, target, rcond=None)[1][0] for part in columns]
    found = quadratic(gram, moment, np.einsum('skk->sk', gram))
    np.testing.assert_allclose(found, target @ target - left, rtol=1e-9)
    one = quadratic(gram[0], moment[0], np.diag(gram[0]))
    assert float(one) == pytest.approx(found[0], rel=1e-12)


def test_a_column_that_is_there_twice_explains_nothing_more(columns) -> None:
    target = np.random.default_rng(5).normal(size=40)
    twice = np.concatenate((columns, 3.0 * columns[..., 1:2]), axis=2)
    found = [quadratic(part.transpose(0, 2, 1) @ part, part.transpose(0, 2, 1) @ target,
                       np.sum(part ** 2, axis=1)) for part in (columns, twice)]
    np.testing.assert_allclose(found[1], found[0], rtol=1e-6)
    part = twice[0] / np.linalg.norm(twice[0], axis=0)
    values, vectors = directions(part.T @ part)
    assert (len(values), vectors.shape) == (5, (6, 5))
    fitted = part @ solved(part.T @ part, part.T @ target)
    np.testing.assert_allclose(fitted @ fitted, found[0][0], rtol=1e-6)


@pytest.mark.parametrize('twice', [False, True])
def test_orthonormal_combinations_span_what_columns_span(columns, twice) -> None:
    """With a column that is there twice one combination is left out."""
    part = columns[0] / np.linalg.norm(columns[0], axis=0)
    design = np.column_stack((part, part[:, 1])) if twice else part
    combined = design @ orthonormal(np.tril(design.T @ design))
    np.testing.assert_allclose(combined.T @ combined, np.eye(5), atol=1e-7)
    np.testing.assert_allclose(combined @ (combined.T @ part), part, atol=1e-7)


def test_columns_beside_a_design_have_the_covariance_of_a_fit_of_all(columns) -> None:
    design, more = columns[0][:, :3], columns[0][:, 3:]
    whole = np.linalg.inv(columns[0].T @ columns[0])
    found = _with_columns(np.linalg.inv(design.T @ design), design, more)
    scale = np.sqrt(np.diag(whole))
    np.testing.assert_allclose(found / np.outer(scale, scale), whole / np.outer(scale, scale),
                               atol=1e-9)


def test_the_size_of_what_a_design_imitates_is_not_known(columns) -> None:
    design = columns[0]
    twin = design[:, :1] + 1e-9 * design[:, 1:2]
    found = _with_columns(np.linalg.inv(design.T @ design), design, twin)
    assert np.sqrt(found[-1, -1]) > 1e4 * np.sqrt(np.linalg.inv(design.T @ design)[0, 0])
