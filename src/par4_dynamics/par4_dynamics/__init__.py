"""Inverse and forward dynamics, models and effects of the Par4 parallel robot."""
