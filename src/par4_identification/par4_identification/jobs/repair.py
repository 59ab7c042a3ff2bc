"""par4_record --repair: mends a bag that was cut off."""

from __future__ import annotations

from pathlib import Path

from par4_identification.logs.bag_repair import repair_bag


def repaired(bag: Path, output: Path | None) -> str:
    """Write what a cut-off bag still holds as a complete bag; return what that is, in a line."""
    summary = repair_bag(bag, output or beside(bag))
    topics = ', '.join(f'{name} {count}' for name, count in sorted(summary.messages.items()))
    damaged = f'; {summary.damaged} damaged parts left out' if summary.damaged else ''
    without = (f'; left out {", ".join(sorted(summary.left_out))}, of unknown type'
               if summary.left_out else '')
    return (f'{summary.output}: {sum(summary.messages.values())} messages recovered ({topics})'
            f'{damaged}{without}')


def beside(bag: Path) -> Path:
    """Return where a bag is put that was mended: `<bag>_repaired` beside the folder or file."""
    place = bag if bag.name not in ('', '..') else bag.resolve()  # the folder in which one is
    return place.parent / f'{place.stem if bag.is_file() else place.name}_repaired'
