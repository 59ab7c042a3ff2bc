"""Commands without their report: the same numbers, and nothing is loaded to draw."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from par4_identification.commands.identify import identify_bags
from par4_sim.bags.bag_writer import BagWriter

RUN = """
import sys
from par4_identification.commands import {command}
{command}.{function}.main(sys.argv[1:], standalone_mode=False)
print('loaded:', *sorted({{'matplotlib', 'jinja2', 'scipy.signal'}} & set(sys.modules)))
"""


@pytest.mark.usefixtures('unrendered')
def test_without_report_the_numbers_are_the_same_and_nothing_draws(tmp_path, capsys):
    (tmp_path / 'axis.yaml').write_text(
        'schema: par4/axis/1\nname: slide\njoint: slide\nkind: linear\ngain: 35.0\n')
    t = 1e-3 * np.arange(12000)
    rate = 2.0 * np.pi * np.array((0.31, 1.7))
    angle, size = np.outer(t, rate), np.array((0.08, 0.012))
    q, qd, qdd = (part @ size for part in (
        np.sin(angle), rate * np.cos(angle), -rate ** 2 * np.sin(angle)))
    noise = np.random.default_rng(1).normal(size=len(t))
    force = 95.0 * qdd + 20.0 * np.sign(qd) + 200.0 * qd + noise
    with BagWriter(tmp_path / 'bag') as bag:
        for row in range(len(t)):
            bag.write_joint_state('/joint_states', (1000 + row) * 1_000_000, ['slide'], [q[row]],
                                  effort=[force[row]])

    def words(command: str, *options: str) -> list[str]:
        return [str(tmp_path / 'bag'), '--robot', str(tmp_path / 'axis.yaml'), '--output',
                str(tmp_path / command), *options]

    def run(command: str, function: str, *options: str) -> str:
        return subprocess.run(
            [sys.executable, '-c', RUN.format(command=command, function=function),
             *words(command, *options)], capture_output=True, text=True, check=True).stdout

    results = tmp_path / 'identify' / 'identification.json'
    identify_bags.main(words('identify', '--report'), standalone_mode=False)
    assert 'results and report:' in capsys.readouterr().out
    with_report = results.read_text()
    said = run('identify', 'identify_bags', '--no-report')
    assert 'results:' in said
    assert results.read_text() == with_report
    for command, lines, files in (
            ('identify', said, {'identification.json', 'model.yaml'}),
            ('diagnose', run('diagnose', 'diagnose_bags', '--no-report'),
             {'diagnosis.json', 'extended_model.yaml'}),
            ('validate', run('validate', 'validate_bag', '--no-report', '--model',
                             str(tmp_path / 'identify' / 'model.yaml')), {'validation.json'})):
        assert lines.splitlines()[-1] == 'loaded:'
        assert {path.name for path in (tmp_path / command).iterdir()} == files
