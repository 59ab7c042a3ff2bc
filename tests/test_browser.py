"""Reports in a headless Chromium: no error, no request, every picture and trace drawn."""

from __future__ import annotations

import base64
import html
import json
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from test_commands import run, simulated

from par4_dynamics.model import read_model
from par4_identification.commands import identify
from par4_sim.report.traces import MOST_VALUES, Trace, shown_part, traces_of
from robots import REFERENCE

BROWSER = next(filter(None, map(shutil.which, (
    'chromium', 'chromium-browser', 'google-chrome'))), None)
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


@pytest.fixture(scope='module')
def page(tmp_path_factory) -> str:
    folder = tmp_path_factory.mktemp('page')
    bag = simulated(folder, '<b>bag<!--', read_model('table1', REFERENCE), 5, 4.0)
    assert run(identify, bag, '--robot', 'reference', '--output', folder / 'out').code == 0
    return (folder / 'out' / 'report.html').read_text(encoding='utf-8')


def told_by_browser(page: str, folder: Path, width: int, *options: str) -> dict:
    """Return what the page tells of itself once it is shown."""
    watched = page.replace('<head>', f'<head>{WATCH}', 1).replace('</body>', f'{TELL}</body>', 1)
    (folder / 'watched.html').write_text(watched, encoding='utf-8')
    shown = subprocess.run(
        [BROWSER, '--headless', '--no-sandbox', '--disable-gpu', f'--window-size={width},900',
         f'--user-data-dir={folder / "profile"}', '--virtual-time-budget=5000', *options,
         '--dump-dom', (folder / 'watched.html').as_uri()],
        capture_output=True, text=True, check=True, timeout=120)
    found = re.search(r'<html[^>]* data-told="([^"]*)"', shown.stdout)
    assert found, shown.stderr
    return json.loads(html.unescape(found[1]))


@pytest.mark.skipif(BROWSER is None, reason='no Chromium is installed')
@pytest.mark.parametrize(('width', 'options'), [(1200, ()), (500, ('--force-dark-mode',))])
def test_a_report_draws_everything_and_asks_for_nothing(page, tmp_path, width, options):
    told = told_by_browser(page, tmp_path, width, *options)
    assert told['errors'] == told['requests'] == []
    assert len(told['pictures']) >= 3
    assert all(told['pictures'])
    assert told['traces'] == [True] * len(REFERENCE.joint_names)
    assert told['wider'] <= 0


@pytest.mark.skipif(BROWSER is None, reason='no Chromium is installed')
def test_an_error_in_a_page_would_be_seen(page, tmp_path):
    broken = page.replace('</body>', '<script>nowhere.at.all()</script><img src="data:,"></body>')
    told = told_by_browser(broken, tmp_path, 1200)
    assert 'nowhere' in told['errors'][0]
    assert not all(told['pictures'])


def test_traces_come_back_from_the_page_to_a_pixel():
    t = np.delete(5.0 + 1e-3 * np.arange(2000), slice(700, 900))
    values = np.stack((np.sin(t), 30.0 * np.cos(3.0 * t)), axis=1)
    traces = traces_of(t, [Trace('told', '#000000', values)], ('a', 'b'), 'N m')
    content = json.loads(traces.content)
    assert content['period'] == pytest.approx(1e-3)
    assert content['length'] == 2000
    packed = content['traces'][0]
    for column, scale, wanted in zip(packed['columns'], packed['scales'], values.T, strict=True):
        told = np.frombuffer(base64.b64decode(column), '<i2')
        assert (told[700:900] == -32768).all()
        left = scale * np.delete(told, slice(700, 900)) - wanted
        assert np.abs(left).max() < 2e-5 * np.abs(wanted).max()


def test_of_a_long_log_the_worst_part_is_shown_within_five_megabytes():
    t = 1e-3 * np.arange(400_000)
    part = shown_part(t, np.exp(-((t - 230.0) / 5.0) ** 2), 8)
    assert part.stop - part.start == MOST_VALUES // 8
    assert t[part][0] < 220.0
    assert t[part][-1] > 240.0
    values = np.random.default_rng(0).normal(size=(part.stop - part.start, 4))
    two = [Trace(name, '#000000', values) for name in ('measured', 'calculated')]
    assert len(traces_of(t[part], two, 'abcd', 'N m').content) < 2_300_000
