"""A window that shows a robot as it moves, in a process of its own.

The engine that draws holds Python's lock while it draws and ends its process when its window is
closed: in the process of a simulation it would slow the physics and take it down.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import sys
import time
from collections.abc import Callable, MutableSequence
from multiprocessing import resource_tracker
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from par4_kinematics.errors import UnreachableError
from par4_kinematics.held_signals import held_back
from par4_kinematics.robot import Robot

if TYPE_CHECKING:
    from par4_sim.pictures.view import View

FRAME_PERIOD = 1.0 / 30.0
"""Seconds between pictures."""


class Window:
    """Shows the newest pose it was given; giving one takes a microsecond.

    Args:
        robot: what is shown.
        x: first pose (4,), m, rad.

    Raises:
        InputError: there is no screen.
    """

    def __init__(self, robot: Robot, x: ArrayLike) -> None:
        from par4_sim.pictures.view import require_screen  # slow to load and only needed here
        require_screen()
        context = multiprocessing.get_context('spawn')
        self._pose = context.RawArray('d', np.asarray(x, dtype=float).tolist())
        self._process = context.Process(target=_run, args=(robot, self._pose), daemon=True)
        resource_tracker.ensure_running()
        with held_back(signal.SIGINT):  # Ctrl-C is for the simulation, which closes this
            self._process.start()

    @property
    def open(self) -> bool:
        """Whether the window is there; its user may have closed it."""
        return self._process.is_alive()

    def show(self, x: np.ndarray) -> None:
        """Show pose x (4,) with the next picture."""
        self._pose[:] = x.tolist()

    def close(self) -> None:
        """Close the window."""
        self._process.terminate()
        self._process.join()


def _run(robot: Robot, pose: MutableSequence[float]) -> None:
    from par4_sim.pictures.view import View
    with open(os.devnull, 'w', encoding='utf-8') as nowhere:  # the engine talks on stdout
        os.dup2(nowhere.fileno(), sys.stdout.fileno())
    parent = multiprocessing.parent_process()
    if parent is None:
        raise RuntimeError('expected a process of its own')
    follow(View(robot, window=True), pose, parent.is_alive, time.sleep)


def follow(view: View, pose: MutableSequence[float], wanted: Callable[[], bool],
           sleep: Callable[[float], None]) -> None:
    """Show the poses that appear in `pose` (4 numbers) while `wanted` and the view is open.

    A pose that the drawn robot cannot reach leaves the last picture.
    """
    shown: list[float] = []
    try:
        while wanted() and view.open:
            newest = list(pose)
            if newest != shown:
                shown = newest
                with contextlib.suppress(UnreachableError):
                    view.show(newest)
            sleep(FRAME_PERIOD)
    finally:
        view.close()
