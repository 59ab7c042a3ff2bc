"""Packages that only a comparison needs, and that nothing in the project requires."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

from par4_kinematics.errors import InputError


def package_to_compare(name: str, distribution: str) -> ModuleType:
    """Return a package by its name; `distribution` is what pip installs it as.

    Raises:
        InputError: it is not installed.
    """
    try:
        return import_module(name)
    except ImportError as error:
        raise InputError(f'comparison with {name} asked, package not found; run: pip install '
                         f'{distribution}') from error
