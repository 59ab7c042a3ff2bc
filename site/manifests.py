"""Write the publisher into the manifest of every package: `python site/manifests.py`."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

ROOT = Path(__file__).parents[1]


def publisher_lines() -> str:
    """Return the elements of `package.xml` that say who maintains a package and where it lives."""
    told = tomllib.loads((ROOT / 'publisher.toml').read_text(encoding='utf-8'))
    lines = (f'  <maintainer email={quoteattr(told["email"])}>{escape(told["maintainer"])}'
             f'</maintainer>\n  <license>Apache-2.0</license>\n')
    if told['url']:
        lines += f'  <url type="repository">{escape(told["url"])}</url>\n'
    return lines


def with_publisher(manifest: str) -> str:
    """Return the text of a manifest with the publisher of `publisher.toml` in it."""
    written, count = re.subn(
        r'  <maintainer .*</maintainer>\n  <license>.*</license>\n(  <url.*</url>\n)?',
        lambda _: publisher_lines(), manifest)
    if count != 1:
        raise ValueError('a manifest has maintainer, license and url one behind the other')
    return written


if __name__ == '__main__':
    for path in sorted(ROOT.glob('src/*/package.xml')):
        path.write_text(with_publisher(path.read_text(encoding='utf-8')), encoding='utf-8')
