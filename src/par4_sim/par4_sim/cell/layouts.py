"""Layouts for PlotJuggler and Foxglove, made from the table of topics: `make docs` writes them.

`python -m par4_sim.cell.layouts FOLDER` writes `par4.plotjuggler.xml` and `par4.foxglove.json`.
Both show the joints, the amplifiers and the platform; Foxglove also the robot and the diagnostics.
"""

from __future__ import annotations

import json
import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from par4_kinematics.files import write_text
from par4_kinematics.interface import (
    AMPLIFIER_VOLTAGE,
    BASE_FRAME,
    DIAGNOSTICS,
    JOINT_STATES,
    PLATFORM_POSE,
    ROBOT_DESCRIPTION,
    Topic,
)
from par4_kinematics.robot import JOINT_NAMES

COLOURS = ('#1f77b4', '#d62728', '#2ca02c', '#9467bd')
JOINT_FIELDS = ('position', 'velocity', 'effort')
PLOTJUGGLER, FOXGLOVE = 'par4.plotjuggler.xml', 'par4.foxglove.json'
LEGEND_WIDTH = 145
"""Pixels; the names of the joints fit into it."""
CAMERA = {'perspective': True, 'distance': 2.2, 'phi': 75, 'thetaOffset': 45, 'fovy': 45,
          'near': 0.01, 'far': 100, 'target': [0, 0, 0], 'targetOffset': [0, 0, -0.45],
          'targetOrientation': [0, 0, 0, 1]}
"""m and degrees: the robot fills the panel; by default it is looked at from 20 m."""


@dataclass(frozen=True)
class Plot:
    """A picture over time: a field of the four joints of a topic, or the position of a pose."""

    title: str
    topic: Topic
    field: str

    @property
    def of_joints(self) -> bool:
        """Whether it has a curve for each joint."""
        return self.field in JOINT_FIELDS


PLOTS = (
    Plot('joint position, rad', JOINT_STATES, 'position'),
    Plot('joint speed, rad/s', JOINT_STATES, 'velocity'),
    Plot('amplifier voltage, V', AMPLIFIER_VOLTAGE, 'effort'),
    Plot('platform position, m', PLATFORM_POSE, 'pose.position'),
)


def absolute(topic: Topic) -> str:
    """Return the name of a topic of a robot without a namespace."""
    return f'/{topic.name.lstrip("/")}'


def plotjuggler() -> str:
    """Return the layout for PlotJuggler, which finds the joints by name."""
    root = ElementTree.Element('root')
    window = ElementTree.SubElement(root, 'tabbed_widget',
                                    {'name': 'Main Window', 'parent': 'main_window'})
    tab = ElementTree.SubElement(window, 'Tab', tab_name='par4', containers='1')
    splitter = ElementTree.SubElement(
        ElementTree.SubElement(tab, 'Container'), 'DockSplitter', orientation='-',
        count=str(len(PLOTS)), sizes=';'.join(len(PLOTS) * [f'{1 / len(PLOTS):g}']))
    for plot in PLOTS:
        area = ElementTree.SubElement(splitter, 'DockArea', name=plot.title)
        picture = ElementTree.SubElement(area, 'plot', mode='TimeSeries', style='Lines',
                                         flip_x='false', flip_y='false')
        ElementTree.SubElement(picture, 'limitY')
        curves = ([f'{name}/{plot.field}' for name in JOINT_NAMES] if plot.of_joints
                  else [f'{plot.field.replace(".", "/")}/{axis}' for axis in 'xyz'])
        for curve, colour in zip(curves, COLOURS, strict=False):
            ElementTree.SubElement(picture, 'curve', name=f'{absolute(plot.topic)}/{curve}',
                                   color=colour)
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(
        root, encoding='unicode') + '\n'


def foxglove() -> str:
    """Return the layout for Foxglove, which finds the joints by their places: arms are first.

    Curves are over the time of receipt. Stamps of a simulation begin at zero, and Lichtblick, which
    has the layouts of Foxglove, counts from the first receipt: curves over stamps would lie decades
    to the left.
    """
    panels: dict[str, Any] = {}
    for number, plot in enumerate(PLOTS):
        fields = ({name: f'{plot.field}[{joint}]' for joint, name in enumerate(JOINT_NAMES)}
                  if plot.of_joints else {axis: f'{plot.field}.{axis}' for axis in 'xyz'})
        panels[f'Plot!plot{number}'] = {
            'foxglovePanelTitle': plot.title, 'lichtblickPanelTitle': plot.title,
            'showLegend': True, 'legendDisplay': 'left', 'sidebarDimension': LEGEND_WIDTH,
            'isSynced': True, 'xAxisVal': 'timestamp',
            'paths': [{'value': f'{absolute(plot.topic)}.{field}', 'label': label,
                       'enabled': True, 'timestampMethod': 'receiveTime', 'color': colour}
                      for (label, field), colour in zip(fields.items(), COLOURS, strict=False)]}
    panels['3D!robot'] = {
        'followTf': BASE_FRAME, 'cameraState': CAMERA,
        'scene': {'transforms': {'showLabel': False, 'axisScale': 0, 'lineWidth': 0}},
        'topics': {absolute(topic): {'visible': True}
                   for topic in (ROBOT_DESCRIPTION, PLATFORM_POSE)}}
    panels['DiagnosticSummary!states'] = {'topicToRender': absolute(DIAGNOSTICS)}
    plots = [name for name in panels if name.startswith('Plot!')]
    layout = {'direction': 'row', 'splitPercentage': 60, 'first': _stacked(plots),
              'second': _stacked(['3D!robot', 'DiagnosticSummary!states'])}
    return json.dumps({'configById': panels, 'globalVariables': {}, 'userNodes': {},
                       'playbackConfig': {'speed': 1}, 'layout': layout}, indent=2) + '\n'


def _stacked(panels: Sequence[str]) -> Any:
    """Return panels one above the other, equally high."""
    if len(panels) == 1:
        return panels[0]
    return {'direction': 'column', 'splitPercentage': round(100 / len(panels)),
            'first': panels[0], 'second': _stacked(panels[1:])}


if __name__ == '__main__':
    for name, content in ((PLOTJUGGLER, plotjuggler()), (FOXGLOVE, foxglove())):
        write_text(Path(sys.argv[1]) / name, content)
