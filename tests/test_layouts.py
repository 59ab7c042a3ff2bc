"""Layouts for plotting programs: they show what the nodes publish, and are installed."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

from par4_kinematics import interface
from par4_kinematics.ros.qos import message_type
from par4_sim.layouts import FOXGLOVE, PLOTJUGGLER, absolute, foxglove, plotjuggler

PACKAGE = Path(__file__).parents[1] / 'src' / 'par4_sim'
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


def test_every_panel_has_its_place():
    content = json.loads(foxglove())

    def placed(part):
        return [part] if isinstance(part, str) else [
            *placed(part['first']), *placed(part['second'])]

    assert sorted(placed(content['layout'])) == sorted(content['configById'])
