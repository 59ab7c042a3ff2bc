"""The unit of stamps and of times between them, in messages, bags and nodes."""

from __future__ import annotations

SECOND = 1_000_000_000
"""Nanoseconds. They are counted in whole numbers: floats of dates are no finer than 200 ns."""
