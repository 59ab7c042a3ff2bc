"""Layouts for plotting programs: they show what the nodes publish, and are installed."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

from par4_kinematics import interface
from par4_kinematics.ros.qos import message_type
from par4_sim.cell.layouts import FOXGLOVE, PLOTJUGGLER, PLOTS, absolute, foxglove, plotjuggler

PACKAGE = Path(__file__).parents[1] / 'src' / 'par4_sim'
READ_BY_FOXGLOVE = {
    'Plot': {'foxglovePanelTitle', 'lichtblickPanelTitle', 'paths', 'minXValue', 'maxXValue',
             'minYValue', 'maxYValue', 'showLegend', 'legendDisplay', 'showPlotValuesInLegend',
             'showXAxisLabels', 'showYAxisLabels', 'isSynced', 'xAxisVal', 'xAxisPath',
             'followingViewWidth', 'sidebarDimension'},
    '3D': {'cameraState', 'followTf', 'followMode', 'scene', 'publish', 'transforms', 'topics',
           'layers', 'imageMode'},
    'DiagnosticSummary': {'minLevel', 'pinnedIds', 'hardwareIdFilter', 'topicToRender',
                          'sortByLevel'},
}
"""Keys of each panel, as Lichtblick 1.28 types them, which has the layouts of open Foxglove; the
title has a key of its own in each of the two."""
TOPICS = {absolute(topic): topic for topic in interface.TOPICS}


@pytest.mark.parametrize(('name', 'made'), [(PLOTJUGGLER, plotjuggler), (FOXGLOVE, foxglove)])
def test_the_layout_in_the_package_is_that_of_the_table(name, made):
    assert (PACKAGE / 'layouts' / name).read_text(encoding='utf-8') == made(), 'run make docs'
    assert f'layouts/{name}' in (PACKAGE / 'setup.py').read_text(encoding='utf-8')


def expect_field(topic: str, path: str) -> None:
    """Fail where a message of the topic has no such field."""
    message = message_type(TOPICS[topic])()
    for part in path.split('.'):
        message = getattr(message, part)


def test_every_curve_is_a_field_of_a_message_of_the_contract():
    curves = [curve.get('name') for curve in ElementTree.fromstring(
        plotjuggler().encode()).iter('curve')]
    assert len(set(curves)) == 15
    for curve in curves:
        topic = next(name for name in TOPICS if curve.startswith(f'{name}/'))
        *path, last = curve.removeprefix(f'{topic}/').split('/')
        joint = path == [next((name for name in interface.JOINT_NAMES if [name] == path), '')]
        expect_field(topic, last if joint else '.'.join([*path, last]))
    panels = json.loads(foxglove())['configById']
    paths = [line['value'] for panel in panels.values() for line in panel.get('paths', ())]
    assert len(set(paths)) == 15
    for path in paths:
        topic, _, field = path.partition('.')
        expect_field(topic, re.sub(r'\[[0-3]\]$', '', field))
    assert {*panels['3D!robot']['topics']} <= TOPICS.keys()


def test_a_recorded_bag_has_all_that_a_layout_shows():
    text = plotjuggler() + foxglove()
    shown = {name for name in TOPICS if re.search(rf'"{name}[/".]', text)}
    assert len(shown) == 5
    assert shown <= {absolute(topic)
                     for topic in (*interface.RECORDED_TOPICS, *interface.SHOWN_TOPICS)}


def test_every_panel_has_its_place():
    content = json.loads(foxglove())

    def placed(part):
        return [part] if isinstance(part, str) else [
            *placed(part['first']), *placed(part['second'])]

    assert sorted(placed(content['layout'])) == sorted(content['configById'])


def test_foxglove_knows_every_key():
    """It says nothing of a key that it does not know: the titles of plots once had none."""
    content = json.loads(foxglove())
    assert content.keys() == {'configById', 'globalVariables', 'userNodes', 'playbackConfig',
                              'layout'}
    for name, panel in content['configById'].items():
        assert panel.keys() <= READ_BY_FOXGLOVE[name.partition('!')[0]], name
        for path in panel.get('paths', ()):
            assert path.keys() <= {'value', 'enabled', 'color', 'label', 'timestampMethod',
                                   'showLine', 'lineSize'}
            assert path['timestampMethod'] in ('receiveTime', 'headerStamp')
        assert panel.get('xAxisVal', 'timestamp') == 'timestamp'

    def splits(part):
        if isinstance(part, dict):
            assert part.keys() == {'direction', 'splitPercentage', 'first', 'second'}
            assert part['direction'] in ('row', 'column')
            assert 0 < part['splitPercentage'] < 100
            splits(part['first'])
            splits(part['second'])

    splits(content['layout'])


def foxglove_panels(kind: str) -> list[dict]:
    """Return the settings of all panels of a kind."""
    return [panel for name, panel in json.loads(foxglove())['configById'].items()
            if name.startswith(f'{kind}!')]


def test_foxglove_and_lichtblick_show_the_title_of_each_plot():
    titles = [plot.title for plot in PLOTS]
    for key in ('foxglovePanelTitle', 'lichtblickPanelTitle'):
        assert [panel.get(key) for panel in foxglove_panels('Plot')] == titles


def test_foxglove_plots_over_the_time_of_receipt():
    """Lichtblick counts from the first receipt, and stamps of a simulation begin at zero: over
    these all curves of a bag of the nodes once lay 56 years to the left of the plot.
    """
    assert {path['timestampMethod'] for panel in foxglove_panels('Plot')
            for path in panel['paths']} == {'receiveTime'}


def test_foxglove_draws_curves_beside_the_names_of_the_joints():
    """A legend that floats covers two fifths of the plot."""
    for panel in foxglove_panels('Plot'):
        assert panel['legendDisplay'] == 'left'
        for path in panel['paths']:
            joint = re.search(r'\[([0-3])\]$', path['value'])
            assert path['label'] == (interface.JOINT_NAMES[int(joint[1])] if joint
                                     else path['value'][-1])


def test_foxglove_shows_the_robot_large_and_without_its_frames():
    """By default it is a speck, 20 m away, behind the names of its 29 frames."""
    panel, = foxglove_panels('3D')
    camera = panel['cameraState']
    assert camera.keys() == {'distance', 'perspective', 'phi', 'target', 'targetOffset',
                             'targetOrientation', 'thetaOffset', 'fovy', 'near', 'far'}
    assert 1.0 < camera['distance'] < 4.0, 'the robot is 1 m high'
    assert camera['near'] < 0.1
    assert panel['scene']['transforms'] == {'showLabel': False, 'axisScale': 0, 'lineWidth': 0}


def test_plotjuggler_finds_every_part_where_it_looks():
    """Its reader takes a widget by this name, and as many areas and sizes as `count` says."""
    root = ElementTree.fromstring(plotjuggler().encode())
    assert root.tag == 'root'
    window, = root
    assert (window.tag, window.attrib) == ('tabbed_widget', {'name': 'Main Window',
                                                             'parent': 'main_window'})
    tab, = window
    container, = tab
    splitter, = container
    assert (tab.tag, container.tag, splitter.tag) == ('Tab', 'Container', 'DockSplitter')
    assert 'tab_name' in tab.attrib
    assert splitter.get('orientation') in ('-', '|')
    sizes = [float(size) for size in splitter.get('sizes').split(';')]
    assert len(sizes) == int(splitter.get('count')) == len(splitter)
    assert sum(sizes) == pytest.approx(1.0)
    for area in splitter:
        plot, = area
        assert (area.tag, plot.tag, plot.get('mode')) == ('DockArea', 'plot', 'TimeSeries')
        assert plot.get('style') in ('Lines', 'Dots', 'LinesAndDots', 'Sticks', 'Steps')
        assert {curve.tag for curve in plot} == {'limitY', 'curve'}
        for curve in plot.iter('curve'):
            assert re.fullmatch('#[0-9a-f]{6}', curve.get('color'))
