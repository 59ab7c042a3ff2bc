"""Commands without their report: the same numbers, and nothing is loaded to draw."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest

from par4_identification.commands.identify import identify_bags
from par4_sim.bags.bag_writer import BagWriter

RUN = """
import json, sys
from par4_identification.commands import diagnose, identify, validate
for command, words in zip((identify.identify_bags, diagnose.diagnose_bags, validate.validate_bag),
                          json.loads(sys.argv[1])):
    command.main(words, standalone_mode=False)
    print('loaded:', *sorted({'matplotlib', 'jinja2', 'scipy.signal'} & set(sys.modules)))
"""
FILES = {'identify': {'identification.json', 'model.yaml'},
         'diagnose': {'diagnosis.json', 'extended_model.yaml'}, 'validate': {'validation.json'}}


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

    results = tmp_path / 'identify' / 'identification.json'
    identify_bags.main(words('identify', '--report'), standalone_mode=False)
    assert 'results and report:' in capsys.readouterr().out
    with_report = results.read_text()
    asked = [words('identify', '--no-report'), words('diagnose', '--no-report'), words(
        'validate', '--no-report', '--model', str(tmp_path / 'identify' / 'model.yaml'))]
    lines = subprocess.run([sys.executable, '-c', RUN, json.dumps(asked)], capture_output=True,
                           text=True, check=True).stdout.splitlines()
    assert results.read_text() == with_report
    assert [line for line in lines if line.startswith('loaded:')] == 3 * ['loaded:']
    assert any(line.startswith('results:') for line in lines[:lines.index('loaded:')])
    for command, files in FILES.items():
        assert {path.name for path in (tmp_path / command).iterdir()} == files
