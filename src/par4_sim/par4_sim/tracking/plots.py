"""The pictures of the report: the paper's Fig. 4, the errors, and what the motors did."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from par4_sim.report.drawing import CURVE, drawn, envelope, image, legend
from par4_sim.tracking.case import Case
from par4_sim.tracking.comparison import MILLI
from par4_sim.tracking.metrics import errors_of, longest_axis

COLOURS = ('#c8102e', '#1a56a8', '#2a7a4b', '#d9822b', '#7a3e9d', '#008b9a', '#8a6d3b', '#d0559b')
SHOWN = 0.1
"""Seconds after the end of the motion that are drawn."""
BEFORE, AFTER = 0.03, 0.06
"""Seconds of the enlarged picture, before and after the far end is to be reached."""
LEAST = 1.0
"""mm: the enlarged picture shows at least that much on either side of the far end."""
SMALLEST = 1e-2
"""mm: where the axis of errors begins."""


def colours_of(cases: Sequence[Case]) -> list[str]:
    """Return a colour for each case; they repeat after `COLOURS`."""
    return [COLOURS[index % len(COLOURS)] for index in range(len(cases))]


def desired_and_obtained(cases: Sequence[Case]) -> str:
    """Return desired and obtained position over time, the paper's Fig. 4, of all runs.

    Along the longest of x, y and z; at the right enlarged around the instant at which the far end
    is to be reached, beneath the distance of D from where it should be.
    """
    motion, axis = cases[0].run.motion, longest_axis(cases[0].run)
    wanted = MILLI * motion.x[:, axis]
    far = motion.t[int(np.argmax(np.abs(wanted - wanted[0])))]
    with drawn(5.6) as figure:
        axes = figure.subplot_mosaic([['whole', 'part'], ['error', 'error']],
                                     gridspec_kw={'width_ratios': (1.7, 1.0),
                                                  'height_ratios': (1.6, 1.0)})
        end = motion.duration + SHOWN
        for axis_of, (first, last) in ((axes['whole'], (0.0, end)),
                                       (axes['part'], (max(far - BEFORE, 0.0), far + AFTER))):
            for case, colour in zip(cases, colours_of(cases), strict=True):
                rows = (case.run.t >= first) & (case.run.t <= last)
                envelope(axis_of, case.run.t[rows], MILLI * case.run.pose[rows, axis], colour, 1.1)
            t = np.append(motion.t, end)
            rows = (t >= first) & (t <= last)
            axis_of.plot(t[rows], np.append(wanted, wanted[-1])[rows], color=CURVE, linewidth=1.3,
                         linestyle=(0, (4, 2)))
            axis_of.set_xlim(first, min(last, end))
            axis_of.set_ylabel(f'{"xyz"[axis]}, mm')
        reached = float(wanted[np.searchsorted(motion.t, far)])
        beyond = max(LEAST, *(1.3 * MILLI * case.tracking.excursion for case in cases))
        axes['part'].set_ylim(reached - beyond, reached + beyond)
        axes['whole'].set_title('desired and obtained')
        axes['part'].set_title('around the far end')
        for case, colour in zip(cases, colours_of(cases), strict=True):
            distance = MILLI * np.linalg.norm(errors_of(case.run), axis=1)
            envelope(axes['error'], motion.t, np.maximum(distance, SMALLEST), colour, 1.1)
        axes['error'].set_yscale('log')
        axes['error'].set_title('distance from where D should be at the same time')
        axes['error'].set_ylabel('error, mm')
        for axis_of in axes.values():
            axis_of.set_xlabel('time, s')
        axes['error'].set_xlim(0.0, motion.duration)
        legend(figure, (('desired', CURVE), *((case.label, colour) for case, colour in
                                              zip(cases, colours_of(cases), strict=True))))
        return image(figure)


def torques(cases: Sequence[Case], joints: Sequence[str]) -> str:
    """Return the torque that each joint's motor delivered over time, of all runs."""
    end = cases[0].run.motion.duration + SHOWN
    with drawn(4.6) as figure:
        axes = figure.subplots(2, 2, sharex=True, sharey=True)
        for joint, (axis_of, label) in enumerate(zip(axes.flat, joints, strict=True)):
            for case, colour in zip(cases, colours_of(cases), strict=True):
                rows = (case.run.t >= 0.0) & (case.run.t <= end)
                envelope(axis_of, case.run.t[rows], case.run.torque[rows, joint], colour, 0.9)
            axis_of.set_title(label)
            axis_of.set_xlim(0.0, end)
        for axis_of in axes[:, 0]:
            axis_of.set_ylabel('torque, N m')
        for axis_of in axes[-1]:
            axis_of.set_xlabel('time, s')
        legend(figure, tuple((case.label, colour) for case, colour in
                             zip(cases, colours_of(cases), strict=True)))
        return image(figure)


def errors_by_cycle(cases: Sequence[Case]) -> str:
    """Return the rms error of D in each cycle of the cases that learned, and of the others."""
    with drawn(2.6) as figure:
        axis_of = figure.subplots()
        for case, colour in zip(cases, colours_of(cases), strict=True):
            if case.learned:
                axis_of.plot(range(1, len(case.learned) + 1),
                             [MILLI * cycle.rms for cycle in case.learned], 'o-', color=colour,
                             markersize=4.0)
            else:
                axis_of.axhline(MILLI * case.tracking.rms, color=colour, linewidth=0.9)
        axis_of.set_yscale('log')
        axis_of.set_xlabel('cycle')
        axis_of.set_ylabel('rms error of D, mm')
        legend(figure, tuple((case.label, colour) for case, colour in
                             zip(cases, colours_of(cases), strict=True)))
        return image(figure)
