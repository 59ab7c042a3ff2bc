"""Naming what a model gets wrong: evidence, selection, sufficiency, verdict."""
