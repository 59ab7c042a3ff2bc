"""Naming what a model gets wrong: evidence, search, verdict and the next experiment."""
