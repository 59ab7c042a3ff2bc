"""Reports in a headless Chromium, which tells what a reader of a page would meet."""

from __future__ import annotations

import html
import json
import re
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

BROWSER = next(filter(None, map(shutil.which, (
    'chromium', 'chromium-browser', 'google-chrome'))), None)
"""Path of the browser; None where none is installed."""
FLAGS = ('--headless', '--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run',
         '--disable-background-networking', '--disable-component-update', '--disable-sync')
WIDE, PHONE = (1200, ()), (500, ('--force-dark-mode',))
"""Width of the window, pixels, and further flags."""
WATCH = """<script>
window.seen = [];
window.addEventListener('error', event => window.seen.push(String(event.message)), true);
for (const kind of ['error', 'warn'])
  console[kind] = (...words) => window.seen.push(words.join(' '));
</script>"""
TELL = """<script>
window.addEventListener('load', () => setTimeout(() => {
  const inked = canvas => canvas.getContext('2d').getImageData(
    0, 0, canvas.width, canvas.height).data.some(value => value > 0);
  document.documentElement.dataset.told = JSON.stringify({
    errors: window.seen,
    requests: performance.getEntriesByType('resource').map(entry => entry.name)
      .filter(name => !name.startsWith('data:')),
    pictures: [...document.images].map(image => image.complete && image.naturalWidth > 0),
    traces: [...document.querySelectorAll('canvas')].map(inked),
    wider: document.documentElement.scrollWidth - window.innerWidth});
}, 300));
</script>"""


def told_by_browser(page: str, window: tuple[int, tuple[str, ...]] = WIDE) -> dict[str, Any]:
    """Return what a page tells of itself once it is shown.

    Returns:
        errors: what was written to its console.
        requests: addresses that were asked for.
        pictures, traces: of each image and canvas, whether something is drawn.
        wider: pixels by which the page is wider than the window.
    """
    watched = page.replace('<head>', f'<head>{WATCH}', 1).replace('</body>', f'{TELL}</body>', 1)
    width, options = window
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'watched.html'
        path.write_text(watched, encoding='utf-8')
        shown = subprocess.run(
            [BROWSER, *FLAGS, f'--user-data-dir={folder}/profile', f'--window-size={width},900',
             '--virtual-time-budget=5000', *options, '--dump-dom', path.as_uri()],
            capture_output=True, text=True, check=True, timeout=400)
    found = re.search(r'<html[^>]* data-told="([^"]*)"', shown.stdout)
    assert found, shown.stderr
    return json.loads(html.unescape(found[1]))


def check_in_browser(report: Path, pictures: int, traces: int = 0,
                     window: tuple[int, tuple[str, ...]] = PHONE) -> None:
    """Assert that a report draws all it has without an error, a request or a line too wide.

    Where no browser is installed nothing is checked; `test_browser` is skipped there.

    Args:
        report: file of the page.
        pictures: how many it has at least.
        traces: how many charts it has that can be zoomed into.
        window: in which it is shown.
    """
    if BROWSER is None:
        return
    told = told_by_browser(report.read_text(encoding='utf-8'), window)
    assert told['errors'] == told['requests'] == []
    assert len(told['pictures']) >= pictures
    assert all(told['pictures'])
    assert told['traces'] == [True] * traces
    assert told['wider'] <= 0
