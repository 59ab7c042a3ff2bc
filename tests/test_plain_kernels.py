"""The compiled kernels, with the intrinsics that they read rows by, against the same in Python."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np

COMPUTE = """
import sys
import numba
import numpy as np
from par4_dynamics.model_from_file import read_model
from par4_dynamics.state import state_of_joints
from par4_kinematics import forward_kinematics, inverse_kinematics, jacobian, read_robot
robot = read_robot('reference')
random = np.random.default_rng(5)
x = np.array((0.0, 0.0, -0.75, 0.0)) + random.uniform(-1.0, 1.0, (6, 4)) * (0.15, 0.15, 0.05, 0.4)
q = inverse_kinematics(robot.geometry, x)
state = state_of_joints(robot.geometry, 0.01 * np.arange(6.0), q, *random.normal(size=(2, 6, 4)))
torque = read_model('table1_full', robot).torque(state)
np.savez(sys.argv[1], q=q, x=forward_kinematics(robot.geometry, q),
         jacobian=jacobian(robot.geometry, x), xdd=state.xdd, torque=torque,
         plain=numba.config.DISABLE_JIT)
"""


def test_compiled_kernels_compute_what_python_computes(tmp_path):
    found = []
    for name, plain in (('compiled', '0'), ('plain', '1')):
        file = tmp_path / f'{name}.npz'
        subprocess.run([sys.executable, '-c', COMPUTE, file], check=True,
                       env={**os.environ, 'NUMBA_DISABLE_JIT': plain})
        found.append(np.load(file))
    compiled, plain = found
    assert not compiled['plain']
    assert plain['plain']
    for part in ('q', 'x', 'jacobian', 'xdd', 'torque'):
        np.testing.assert_allclose(compiled[part], plain[part], rtol=1e-11, atol=1e-12)
        assert np.ptp(compiled[part], axis=0).min() > 0.0
