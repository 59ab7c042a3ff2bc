"""Coloured noise of the rows: an autoregressive model per joint, exact over missing rows."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numba
import numpy as np
import scipy

ORDER = 6
NEARLY_ONE = 0.9999
"""Largest absolute value of a pole of the noise, of one that has a variance."""


@dataclass(frozen=True)
class ArNoise:
    """r_t = sum_k a_k r_{t-k} + e_t, var(e) = variance.

    Attributes:
        coefficients: a, (p,).
        variance: of the innovation, N2 m2.
    """

    coefficients: np.ndarray
    variance: float

    def autocovariance(self, lags: int) -> np.ndarray:
        """Return the autocovariance at lags 0 .. lags - 1, (lags,)."""
        order = len(self.coefficients)
        companion = _companion(self.coefficients)
        covariance = _stationary_covariance(companion, self.variance)
        values = list(covariance[0])
        while len(values) < lags:
            values.append(float(self.coefficients @ values[-1:-order - 1:-1]))
        return np.array(values[:lags])

    def whitened_power(self, cycles: np.ndarray) -> np.ndarray:
        """Return the factor by which whitening multiplies the power of a wave without gaps.

        Args:
            cycles: of the wave from row to row, (...).
        """
        turns = np.exp(-2j * np.pi * np.asarray(cycles)[..., None]
                       * np.arange(1, len(self.coefficients) + 1))
        return np.abs(1.0 - turns @ self.coefficients) ** 2 / self.variance

    @property
    def size(self) -> float:
        """Standard deviation of the series, N m."""
        return float(np.sqrt(self.autocovariance(1)[0]))

    def whitening(self, valid: np.ndarray, louder: np.ndarray | None = None) -> Whitening:
        """Return the filter that whitens series of which some rows (n,) are valid.

        `louder` is the ratio (n,) of the noise of each row to that of this model, 1 by default.
        """
        companion = _companion(self.coefficients)
        gain, scale = _gains(np.ascontiguousarray(valid), companion, self.variance,
                             _stationary_covariance(companion, self.variance))
        return Whitening(np.ascontiguousarray(self.coefficients), gain, scale,
                         np.ones(len(valid)) if louder is None else 1.0 / louder)

    def whiten(self, columns: np.ndarray, valid: np.ndarray) -> np.ndarray:
        """Return the standardised innovations (n, k) of columns (n, k); zero where not valid."""
        return self.whitening(valid).of(columns)


@dataclass(frozen=True)
class Whitening:
    """The Kalman filter that turns a series with missing rows into standardised innovations.

    It treats invalid rows as missing, which is exact: nothing is joined and nothing is lost at the
    edges. Its gains are those of the noise and of the rows, whatever the series.

    Attributes:
        coefficients: of the autoregression, (p,).
        gain: of each row, (n, p); zero where the row is missing.
        scale: one over the standard deviation of the innovation, (n,); zero where it is missing.
        weight: by which each row is multiplied before, (n,).
    """

    coefficients: np.ndarray
    gain: np.ndarray
    scale: np.ndarray
    weight: np.ndarray

    def of(self, columns: np.ndarray) -> np.ndarray:
        """Return the standardised innovations (n, k) of columns (n, k); zero where missing."""
        return _whiten(np.ascontiguousarray(self.weight[:, None] * columns), self.coefficients,
                       self.gain, self.scale)

    def adjoint(self, white: np.ndarray) -> np.ndarray:
        """Return z (n,) of standardised rows w (n,): z @ c = w @ (whitened c) for any series c.

        So the products of w with many whitened series need none of these series whitened.
        """
        return self.weight * _adjoint(
            np.ascontiguousarray(white), self.coefficients, self.gain, self.scale)


def _companion(coefficients: np.ndarray) -> np.ndarray:
    order = len(coefficients)
    companion = np.eye(order, k=-1)
    companion[0] = coefficients
    return companion


def _stationary_covariance(companion: np.ndarray, variance: float) -> np.ndarray:
    order = len(companion)
    innovation = np.zeros((order, order))
    innovation[0, 0] = variance
    flat = np.linalg.solve(np.eye(order * order) - np.kron(companion, companion),
                           innovation.ravel())
    covariance = flat.reshape(order, order)
    return 0.5 * (covariance + covariance.T)


@numba.njit(cache=True, error_model='numpy', nogil=True)
def _gains(valid, companion, variance, initial):
    """Return the gains (n, p) of a Kalman filter and one over its innovations' deviations (n,)."""
    n, order = len(valid), companion.shape[0]
    gains, scale = np.zeros((n, order)), np.zeros(n)
    covariance, half = initial.copy(), np.empty((order, order))
    for row in range(n):
        if valid[row]:
            spread = covariance[0, 0]
            scale[row] = 1.0 / np.sqrt(spread)
            for i in range(order):
                gain = covariance[i, 0] / spread
                # rounding is left where the last rows are all known
                gains[row, i] = gain if abs(gain) > 1e-14 else 0.0
            for i in range(order):
                for j in range(order):
                    half[i, j] = covariance[i, j] - covariance[i, 0] * covariance[0, j] / spread
            covariance[:] = half
        for i in range(order):
            for j in range(order):
                if i > 0:
                    half[i, j] = covariance[i - 1, j]
                else:
                    total = 0.0
                    for k in range(order):
                        total += companion[0, k] * covariance[k, j]
                    half[i, j] = total
        for i in range(order):
            for j in range(order):
                if j > 0:
                    covariance[i, j] = half[i, j - 1]
                else:
                    total = 0.0
                    for k in range(order):
                        total += half[i, k] * companion[0, k]
                    covariance[i, j] = total
        covariance[0, 0] += variance
    return gains, scale


@numba.njit(cache=True, error_model='numpy', nogil=True)
def _whiten(columns, coefficients, gains, scale):
    n, width = columns.shape
    order = len(coefficients)
    white = np.zeros((n, width))
    state = np.zeros((order, width))  # row (newest + i) % order is the value i rows ago
    innovation, ahead = np.empty(width), np.empty(width)
    newest = 0
    for row in range(n):
        if scale[row] > 0.0:
            for column in range(width):
                innovation[column] = columns[row, column] - state[newest, column]
                white[row, column] = innovation[column] * scale[row]
            for i in range(order):
                gain = gains[row, i]
                if gain != 0.0:
                    place = (newest + i) % order
                    for column in range(width):
                        state[place, column] += gain * innovation[column]
        # predict: the companion shifts and puts the new value in front, over the oldest one
        ahead[:] = 0.0
        for i in range(order):
            place = (newest + i) % order
            for column in range(width):
                ahead[column] += coefficients[i] * state[place, column]
        newest = (newest + order - 1) % order
        state[newest, :] = ahead
    return white


@numba.njit(cache=True, error_model='numpy', nogil=True)
def _adjoint(white, coefficients, gains, scale):
    """Run the steps of `_whiten` backward, each as its transpose."""
    n, order = len(white), len(coefficients)
    unwhitened, state = np.zeros(n), np.zeros(order)
    for row in range(n - 1, -1, -1):
        newest = state[0]
        for i in range(order):
            state[i] = coefficients[i] * newest + (state[i + 1] if i + 1 < order else 0.0)
        if scale[row] > 0.0:
            innovation = scale[row] * white[row]
            for i in range(order):
                innovation += gains[row, i] * state[i]
            unwhitened[row] = innovation
            state[0] -= innovation
    return unwhitened


def fit_noise(residuals: list[np.ndarray], valid: list[np.ndarray], parameters: float = 0.0,
              order: int = ORDER) -> ArNoise:
    """Return the autoregressive model of residual series (n_i,), rows not `valid` left out.

    Yule-Walker on the pooled autocovariance of all series; nothing is joined. With missing rows
    what is read of it need not be the autocovariance of any noise, above all where the noise
    wanders slowly; then Burg's method. The variance of the innovations is that of the innovations
    themselves, as a small difference of large numbers would come out up to a hundred times too
    small. `parameters` is how many of the fitted parameters fall on these rows, a correction of the
    variance.
    """
    count = max(float(sum(np.count_nonzero(mask) for mask in valid)), 1.0)
    coefficients = _yule_walker(residuals, valid, order)
    if coefficients is None:
        coefficients = _burg(residuals, valid, order)
    guess = max(sum(float(np.sum(residual[mask] ** 2))
                    for residual, mask in zip(residuals, valid)) / count, 1e-18)
    found = ArNoise(coefficients, guess)
    squares = sum(float(np.sum(found.whiten(residual[:, None], mask) ** 2))
                  for residual, mask in zip(residuals, valid))
    return replace(found, variance=max(guess * squares / max(count - parameters, 1.0), 1e-18))


def _yule_walker(residuals: list[np.ndarray], valid: list[np.ndarray], order: int
                 ) -> np.ndarray | None:
    """Return the coefficients (p,) of the pooled autocovariance; None if no noise has it."""
    products, pairs = np.zeros(order + 1), np.zeros(order + 1)
    for residual, mask in zip(residuals, valid):
        kept = np.where(mask, residual, 0.0)
        for lag in range(min(order + 1, len(kept))):
            products[lag] += kept[lag:] @ kept[:len(kept) - lag]
            pairs[lag] += np.count_nonzero(mask[lag:] & mask[:len(mask) - lag])
    covariance = products / np.maximum(pairs, 1.0)
    # taper: with missing rows the estimate need not be positive definite
    covariance *= 1.0 - np.arange(order + 1) / max(pairs[0], 1.0)
    covariance[0] = max(covariance[0], 1e-18) * (1.0 + 1e-6)
    coefficients = scipy.linalg.solve_toeplitz(covariance[:order], covariance[1:])
    innovation = covariance[0] - coefficients @ covariance[1:]
    stable = np.max(np.abs(np.linalg.eigvals(_companion(coefficients)))) < NEARLY_ONE
    return coefficients if innovation > 0.0 and stable else None


def _burg(residuals: list[np.ndarray], valid: list[np.ndarray], order: int) -> np.ndarray:
    """Return the coefficients (p,) that predict stretches without missing rows both ways best.

    Burg's method for segments (S. de Waele, P. M. T. Broersen, The Burg algorithm for segments,
    IEEE Trans. Signal Processing 48(10), 2000): each coefficient of reflection is at most 1, so
    that the model is stable.
    """
    series = [(np.where(mask, residual, 0.0), np.where(mask, residual, 0.0), mask)
              for residual, mask in zip(residuals, valid)]
    coefficients = np.zeros(0)
    for _ in range(order):
        # errors of a row predicted by those before it, and of the first of them by those after
        series = [(ahead[1:], back[:-1], whole[1:] & mask[:len(whole[1:])])
                  for (ahead, back, whole), mask in zip(series, valid)]
        both = sum(2.0 * float(ahead[whole] @ back[whole]) for ahead, back, whole in series)
        each = sum(float(ahead[whole] @ ahead[whole] + back[whole] @ back[whole])
                   for ahead, back, whole in series)
        reflection = NEARLY_ONE * both / each if each > 0.0 else 0.0
        series = [(ahead - reflection * back, back - reflection * ahead, whole)
                  for ahead, back, whole in series]
        coefficients = np.append(coefficients - reflection * coefficients[::-1], reflection)
    return coefficients
