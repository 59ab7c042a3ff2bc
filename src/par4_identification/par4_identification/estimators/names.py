"""The estimators by name, apart from what computes them."""

from __future__ import annotations

ESTIMATORS = ('weighted', 'ordinary', 'robust', 'instrumental', 'consistent')
"""As `par4_identify --estimator` offers them."""
