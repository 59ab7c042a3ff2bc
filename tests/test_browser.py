"""What the browser tests of reports would notice, and the traces that a page carries."""

from __future__ import annotations

import base64
import json

import numpy as np
import pytest
from browser import BROWSER, told_by_browser

from par4_sim.report.traces import MOST_VALUES, Trace, shown_part, traces_of

PAGE = '<!DOCTYPE html><html><head></head><body>{}</body></html>'


@pytest.mark.skipif(BROWSER is None, reason='no Chromium is installed; no report was opened in it')
def test_an_error_a_request_and_what_is_not_drawn_would_be_seen():
    told = told_by_browser(PAGE.format(
        '<script>nowhere.at.all()</script><img src="data:,"><canvas></canvas>'
        '<p style="width: 3000px">wide</p><link rel="stylesheet" href="http://127.0.0.1:9/missing.css">'))
    assert 'nowhere' in told['errors'][0]
    assert len(told['requests']) == 1
    assert told['requests'][0].endswith('missing.css')
    assert told['pictures'] == told['traces'] == [False]
    assert told['wider'] > 1000


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
