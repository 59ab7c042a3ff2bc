"""What the simplifications of (20) cost: the paper's experiment with imposed displacement (Fig. 6).

(20) puts half of the mass of every rod and bar at either end. Here the whole mechanism is moved in
pybullet along a given motion, and the torque that it needs is held against that of (20) with
exactly the same base parameters: once with everything that (20) leaves out, once with each part of
it alone, and once with nothing of it, where both must agree: that is the noise of the experiment.
Friction and effects take no part; they would be the same on both sides.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from par4_dynamics.base_terms import FRICTION
from par4_dynamics.model import Model
from par4_dynamics.model_file import ModelFile
from par4_dynamics.model_from_file import build_model
from par4_dynamics.state import State, state_of_joints, state_of_platform
from par4_kinematics.adept import adept_motion
from par4_kinematics.errors import InputError, Par4Error
from par4_kinematics.motion import Motion, check_limits
from par4_kinematics.robot import Robot
from par4_sim.choices import STEP
from par4_sim.closed_loop.imposed import ImposedRun, imposed_run
from par4_sim.description.chains import Fidelity, engine_bodies

PARTS = {'rods': 'rod_mass', 'bars': 'bar_mass', 'theta inertia': 'theta_inertia'}
"""What (20) leaves out -> its entry in `bodies` of the robot file."""
ALL, NOTHING = 'all', 'nothing'
"""Variants of the mechanism with every part and with none; the others are named as in `PARTS`."""
JERK = 30_000.0
"""m/s3, of each segment of the Adept motion: 15 G are reached within 5 ms."""
DIRECTIONS = {'x': 0.0, 'y': 0.5 * math.pi, 'diagonal': 0.25 * math.pi}
"""Name -> azimuth of the way across, rad."""
THETA_SHARES = (0.0, 0.5, 1.0)
"""Of the robot's range of theta, in the table."""
ROD_SHARES = (0.0, 0.5, 1.0, 2.0)
"""Of the robot's rod mass, in the table."""


@dataclass(frozen=True)
class Difference:
    """How far two torques are apart over a motion.

    Attributes:
        rms, largest: of each joint, (4,), N m.
        of_rms: rms over that of the joint's torque, (4,).
        of_peak: largest over the joint's peak torque, (4,).
        overall_of_rms, overall_of_peak: the same over all joints together.
    """

    rms: np.ndarray
    largest: np.ndarray
    of_rms: np.ndarray
    of_peak: np.ndarray
    overall_of_rms: float
    overall_of_peak: float


def difference_of(difference: np.ndarray, torque: np.ndarray) -> Difference:
    """Return the size of a difference (n, 4) of torques, N m, over the torque (n, 4) itself."""
    rms, power = (np.sqrt(np.mean(part ** 2, axis=0)) for part in (difference, torque))
    largest, peak = (np.abs(part).max(axis=0) for part in (difference, torque))
    return Difference(rms, largest, rms / power, largest / peak,
                      float(np.linalg.norm(rms) / np.linalg.norm(power)),
                      float(largest.max() / peak.max()))


@dataclass(frozen=True)
class Cell:
    """The error of (20) on one Adept motion with one rod mass.

    Attributes:
        direction: of the way across, see `DIRECTIONS`.
        theta_range: of theta to either side, rad.
        rod_mass: of one rod, kg.
        of_rms, of_peak: as in `Difference`, over all joints; NaN where the robot's limits forbid
            the motion.
    """

    direction: str
    theta_range: float
    rod_mass: float
    of_rms: float
    of_peak: float


@dataclass(frozen=True)
class Simplification:
    """The experiment.

    Attributes:
        t: s, (n,).
        simplified: torque of (20), (n, 4), N m.
        torques: of the mechanism in pybullet: variant -> (n, 4), N m. `ALL`, each of `parts`,
            `NOTHING`.
        parts: what the robot has of `PARTS`: name -> mass or inertia, kg or kg m2.
        formula_error: largest difference between the formula of the whole mechanism and pybullet
            over the peak torque, over all variants and the table's worst cell.
        position_error: largest distance of a joint from the imposed position, rad.
        opening: largest opening of a loop at the end of a run, m.
        table: Adept motions, by the formula of the whole mechanism.
    """

    t: np.ndarray
    simplified: np.ndarray
    torques: dict[str, np.ndarray]
    parts: dict[str, float]
    formula_error: float
    position_error: float
    opening: float
    table: tuple[Cell, ...]

    def difference(self, variant: str) -> Difference:
        """Return the size of mechanism - (20) of a variant over the torque of that mechanism."""
        torque = self.torques[variant]
        return difference_of(torque - self.simplified, torque)

    def contribution(self, variant: str) -> np.ndarray:
        """Return what a variant changes in pybullet, (n, 4), N m; its time step cancels out."""
        return self.torques[variant] - self.torques[NOTHING]

    def share(self, part: str) -> float:
        """Return the share of a part in the whole contribution.

        Its projection on the whole: the shares of all parts add up to 1 as far as the contributions
        do, and what cancels another part counts negative.
        """
        whole = self.contribution(ALL)
        return float(np.sum(self.contribution(part) * whole) / np.sum(whole ** 2))

    @property
    def additivity_error(self) -> float:
        """|sum of the parts alone - all at once| / |all at once|, 2-norms."""
        whole = self.contribution(ALL)
        gap = sum(self.contribution(part) for part in self.parts) - whole
        return float(np.linalg.norm(gap) / np.linalg.norm(whole))


def rigid_model(robot: Robot, model_file: ModelFile) -> Model:
    """Return the model of the whole mechanism, without friction and effects.

    Raises:
        InputError: a robot without anything that (20) leaves out, or masses that make a body
            negative.
    """
    if not any(getattr(robot.bodies, entry) for entry in PARTS.values()):
        raise InputError(
            f'robot {robot.name}: {", ".join(PARTS.values())} are all 0, so (20) leaves nothing '
            f'out; give the mass of one rod and of one bar under bodies in its file')
    model = build_model(robot, model_file.model_copy(update={'rigid_body': 'full', 'effects': ()}))
    still = {name: np.zeros(4) for name in FRICTION}
    return replace(model, values=model.values | still)


def adept_of(robot: Robot, theta_range: float, azimuth: float = 0.0, period: float = STEP
             ) -> Motion:
    """Return the paper's Adept cycle (15 G, 0.25 s), jerk-limited, within the robot's limits.

    Args:
        robot: the machine.
        theta_range: theta goes from -theta_range to theta_range and back, rad.
        azimuth: direction of the way across, rad.
        period: seconds between samples.

    Raises:
        InputError: limits of the robot not kept.
        UnreachableError: a sample that a leg cannot reach.
    """
    motion = adept_motion(robot, jerk=JERK, theta_swing=2.0 * theta_range, azimuth=azimuth,
                          period=period)
    check_limits(motion, robot)
    return motion


def study_simplification(robot: Robot, model: Model, motion: Motion,
                         fidelity: Fidelity = 'accurate', dt: float = STEP,
                         progress: Callable[[str], None] | None = None) -> Simplification:
    """Return what the simplifications of (20) cost on a motion, and where the cost comes from.

    Args:
        robot: the machine.
        model: of the whole mechanism, see `rigid_model`.
        motion: to impose.
        fidelity: of the pybullet plant.
        dt: its physics step, s.
        progress: called with what is being done.

    Raises:
        InputError: a body without mass, or the robot's limits not kept.
        UnreachableError: a motion that the mechanism cannot follow.
    """
    report = progress or (lambda _: None)
    parts = {name: float(getattr(model.bodies, entry)) for name, entry in PARTS.items()
             if getattr(model.bodies, entry)}
    runs: dict[str, ImposedRun] = {}
    formula_error = 0.0
    for variant, kept in ({ALL: tuple(parts)} | {part: (part,) for part in parts}
                          | {NOTHING: ()}).items():
        report(f'moving the mechanism with {variant} of rods and bars distributed'
               if variant in (ALL, NOTHING) else f'moving the mechanism with {variant} distributed')
        runs[variant], error = _run_and_formula_error(
            robot, _with_parts(model, kept), motion, fidelity, dt)
        formula_error = max(formula_error, error)
    report('calculating the table')
    table = _table(robot, model, dt)
    possible = [cell for cell in table if math.isfinite(cell.of_rms)]
    if possible:  # the formula is shown to hold where the table needs it most
        worst = max(possible, key=lambda cell: cell.of_rms)
        report('moving the mechanism of the worst cell')
        _, error = _run_and_formula_error(
            robot, _with_rod_mass(model, worst.rod_mass),
            adept_of(robot, worst.theta_range, DIRECTIONS[worst.direction], dt), fidelity, dt)
        formula_error = max(formula_error, error)
    whole = runs[ALL]
    return Simplification(
        whole.t, _torque_of_20(model, _state(robot, whole)),
        {variant: run.torque for variant, run in runs.items()}, parts, formula_error,
        max(run.position_error for run in runs.values()),
        max(run.opening for run in runs.values()), table)


def _with_parts(model: Model, kept: tuple[str, ...]) -> Model:
    """Return the model with only the kept parts distributed, at equal base parameters."""
    gone = {entry: 0.0 for part, entry in PARTS.items() if part not in kept}
    return replace(model, bodies=model.bodies.model_copy(update=gone))


def _with_rod_mass(model: Model, rod_mass: float) -> Model:
    return replace(model, bodies=model.bodies.model_copy(update={'rod_mass': rod_mass}))


def _run_and_formula_error(robot: Robot, model: Model, motion: Motion, fidelity: Fidelity,
                           dt: float) -> tuple[ImposedRun, float]:
    """Return a run of the mechanism and how far the formula is from it, over the peak torque."""
    run = imposed_run(robot.geometry, model.lumped_bodies(), motion, fidelity, dt)
    formula = model.torque(_state(robot, run))
    return run, difference_of(formula - run.torque, run.torque).overall_of_peak


def _state(robot: Robot, run: ImposedRun) -> State:
    return state_of_joints(robot.geometry, run.t, run.q, run.qd, run.qdd)


def _torque_of_20(model: Model, state: State) -> np.ndarray:
    return replace(model, rigid_body='paper').torque(state)


def _table(robot: Robot, model: Model, dt: float) -> tuple[Cell, ...]:
    masses = [share * model.bodies.rod_mass for share in ROD_SHARES]
    masses = [mass for mass in sorted(set(masses)) if _possible(robot, model, mass)]
    cells = []
    for direction, azimuth in DIRECTIONS.items():
        for share in THETA_SHARES:
            theta_range = share * robot.limits.workspace.theta
            try:
                motion = adept_of(robot, theta_range, azimuth, dt)
            except Par4Error:  # the robot is not made for this motion
                cells += [Cell(direction, theta_range, mass, math.nan, math.nan)
                          for mass in masses]
                continue
            state = state_of_platform(robot.geometry, motion.t, motion.x, motion.xd, motion.xdd)
            simplified = _torque_of_20(model, state)
            for mass in masses:
                torque = _with_rod_mass(model, mass).torque(state)
                found = difference_of(torque - simplified, torque)
                cells.append(Cell(direction, theta_range, mass, found.overall_of_rms,
                                  found.overall_of_peak))
    return tuple(cells)


def _possible(robot: Robot, model: Model, rod_mass: float) -> bool:
    """Return whether the base parameters leave room for rods of this mass."""
    try:
        engine_bodies(robot.geometry, _with_rod_mass(model, rod_mass).lumped_bodies())
    except InputError:
        return False
    return True
