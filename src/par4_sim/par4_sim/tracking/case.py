"""One run of a comparison: a controller with a model on a motion, and what came of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from par4_dynamics.model import Model
from par4_dynamics.model_from_file import read_model
from par4_kinematics.errors import InputError
from par4_kinematics.motion import Motion
from par4_kinematics.robot import Robot
from par4_sim.choices import BAND, CYCLES, LEARNING, NO_FEEDFORWARD, STEP
from par4_sim.drives.computed_torque import mean_inertia
from par4_sim.drives.laws import KNOWING
from par4_sim.machines.machine_effects import machine_of_model
from par4_sim.report.words import in_words, listed
from par4_sim.tracking.learning import Cycle, learn
from par4_sim.tracking.metrics import Tracking, tracking_of
from par4_sim.tracking.run import TrackedRun, feedforward_of, record_run
from par4_sim.tracking.stability import (
    Margin,
    gains_of_computed_torque,
    gains_of_loops,
    inertias_of_workspace,
    lags_of,
    margin_over,
)

NEED_MODEL = (*KNOWING, 'torque', LEARNING)
"""Controllers that make no sense without a model."""


@dataclass(frozen=True)
class Case:
    """One run of a comparison.

    Attributes:
        controller: of CONTROLLERS.
        feedforward: name of the model whose torques the drives got, or `NO_FEEDFORWARD`.
        run: the record; of the best cycle where a motion was learned.
        tracking: its figures.
        learned: the cycles of a motion that was learned.
        margin: of its feedback over the workspace; None where it has none, the transmissions are
            not rigid or nobody asked.
    """

    controller: str
    feedforward: str
    run: TrackedRun
    tracking: Tracking
    learned: tuple[Cycle, ...] = ()
    margin: Margin | None = None

    @property
    def label(self) -> str:
        """What it is called in tables and pictures."""
        if self.feedforward == NO_FEEDFORWARD:
            return f'{in_words(self.controller)} alone'
        return f'{in_words(self.controller)}, {self.feedforward}'


@dataclass(frozen=True)
class Plan:
    """What is compared, and on what.

    Attributes:
        robot: geometry, drives, limits.
        machine: as it truly is.
        motion: asked of it.
        cycles: how often the motion repeats itself.
        band: half width of the limit band of overshoot and settling, m.
        fidelity: of the plant.
        learning_cycles: how often a learning controller does the motion.
    """

    robot: Robot
    machine: Model
    motion: Motion
    cycles: int = 1
    band: float = BAND
    fidelity: str = 'exact'
    learning_cycles: int = CYCLES

    def case(self, controller: str, name: str, model: Model | None) -> Case:
        """Return the case of a controller with the model of that name, or none.

        Raises:
            InputError: as `record_run`, or a controller without the model it needs.
            UnreachableError: the machine was driven out of its workspace.
        """
        if controller == LEARNING:
            return self._learned(name, _needed(controller, model))
        if controller in NEED_MODEL:
            model = _needed(controller, model)
        torque = None if model is None else feedforward_of(self.robot, model, self.motion)
        run = record_run(self.robot, self.machine, self.motion, torque, self.fidelity, controller,
                         model)
        return Case(controller, name, run, self._tracking(run))

    def _learned(self, name: str, model: Model) -> Case:
        learning = learn(self.robot, self.machine, self.motion,
                         feedforward_of(self.robot, model, self.motion), model,
                         self.learning_cycles, self.fidelity)
        return Case(LEARNING, name, learning.run, self._tracking(learning.run), learning.cycles)

    def _tracking(self, run: TrackedRun) -> Tracking:
        return tracking_of(run, self.cycles, self.band, self.robot.limits.workspace)

    def margin(self, controller: str, model: Model | None) -> Margin | None:
        """Return the margin of a controller's feedback over the workspace, where no limit acts.

        None where it has none, and where springs or gaps are between motors and arms.
        """
        machine = machine_of_model(self.robot, self.machine)
        if controller == 'torque' or not machine.transmission.is_rigid:
            return None
        known: Model | None
        if controller in KNOWING:
            known = _needed(controller, model)
            gains = gains_of_computed_torque(self.robot, known)
        else:
            known = None
            gains = gains_of_loops(self.robot.drives)
        return margin_over(gains, inertias_of_workspace(self.robot, machine, known), STEP,
                           *lags_of(self.robot, machine))


def _needed(controller: str, model: Model | None) -> Model:
    if model is None:
        raise InputError(f'controller {controller}: it needs a model, found none; give one')
    return model


def model_name(name_or_path: str) -> str:
    """Return what to call a model: its built-in name, or that of its file without the ending.

    A file model.yaml is called after its folder, as `par4_identify` writes one into each.
    """
    path = Path(name_or_path)
    return path.parent.name if path.stem == 'model' and path.parent.name else path.stem


def models_named(names: Sequence[str], robot: Robot) -> dict[str, Model | None]:
    """Return the models of built-in names or files by what to call them; None for none.

    Raises:
        InputError: a model that cannot be read, or two of one name.
    """
    models: dict[str, Model | None] = {}
    for name in names:
        called = model_name(name)
        if called in models:
            raise InputError(f'--feedforward {name}: another model is called {called} already; '
                             f'rename one of the files')
        models[called] = None if name == NO_FEEDFORWARD else read_model(name, robot)
    return models


def pairs_of(robot: Robot, controllers: Sequence[str], models: Mapping[str, Model | None]
             ) -> list[tuple[str, str, Model | None]]:
    """Return each controller with the name and the model of each that it can work with.

    What needs a model is left out where there is none.

    Args:
        robot: that is controlled.
        controllers: of CONTROLLERS.
        models: name -> model, None for none.

    Raises:
        InputError: no pair is left, or a model whose joints feel no inertia for a law that
            divides by it.
    """
    pairs = [(controller, name, model) for controller in controllers
             for name, model in models.items()
             if model is not None or controller not in NEED_MODEL]
    if not pairs:
        raise InputError(f'controller {listed(list(controllers))}: needs a model, found '
                         f'--feedforward {NO_FEEDFORWARD}; give a model.yaml or table1')
    for controller, name, model in pairs:
        if controller in KNOWING and model is not None:
            try:
                mean_inertia(robot, model)
            except InputError as error:
                raise InputError(f'--feedforward {name}: {error}') from None
    return pairs


def compared(plan: Plan, controllers: Sequence[str], models: Mapping[str, Model | None],
             progress: Callable[[str], None] = lambda _: None) -> list[Case]:
    """Return the cases of every controller with every model.

    Args:
        plan: what is compared on.
        controllers, models: as `pairs_of`.
        progress: told what is being simulated.

    Raises:
        InputError: as `pairs_of` and `Plan.case`.
    """
    cases = []
    for controller, name, model in pairs_of(plan.robot, controllers, models):
        progress(f'simulating {in_words(controller)} with feedforward {name}')
        cases.append(replace(plan.case(controller, name, model),
                             margin=plan.margin(controller, model)))
    return cases
