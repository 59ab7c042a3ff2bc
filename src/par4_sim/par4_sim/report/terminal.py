"""How commands print tables and sentences."""

from __future__ import annotations

from rich.console import Console
from rich.measure import Measurement
from rich.table import Table

WIDEST = 1000
"""Columns of text that a table may take."""


def print_table(table: Table) -> None:
    """Print a table whole, however narrow the output is: its lines may then be wider than it.

    Files and pipes count as 80 columns wide; rich would leave out what does not fit.
    """
    console = Console(highlight=False)
    whole = Measurement.get(console, console.options.update(max_width=WIDEST), table).maximum
    console.width = max(console.width, whole)
    console.print(table)


def say(*lines: str, whole: bool = False) -> None:
    """Print lines, which a terminal shows broken between words, and files and pipes as they are.

    Args:
        whole: not broken on a terminal either, so that a path in it can be copied.
    """
    console = Console(highlight=False)
    for line in lines:
        console.print(line, soft_wrap=whole or not console.is_terminal, markup=False)
