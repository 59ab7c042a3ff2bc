"""par4_trend: base parameters and effects of dated bags over time, and when they changed."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import Progress

from par4_dynamics.model_file import ModelFile
from par4_dynamics.model_from_file import read_file_and_model
from par4_identification.reports.outcome.trend import lines_of_refused, outcome_of_life, trend_json
from par4_identification.trend.bag_values import BagValues, outcome_of_bag
from par4_identification.trend.kept import Kept
from par4_identification.trend.life import life_of
from par4_identification.trend.tasks import results_of
from par4_kinematics.errors import InputError
from par4_kinematics.paths import refuse_unwritable
from par4_kinematics.robot import Axis, Robot, read_machine
from par4_sim.report.outcome import Outcome, Remark
from par4_sim.report.results import origin, write_results
from par4_sim.report.terminal import say


def trend_of_bags(bags: tuple[str, ...], robot: str, output: Path, scheduler: str | None,
                  model: str | None, namespace: str | None) -> None:
    """Follow a machine over its life through dated bags."""
    machine = read_machine(robot)
    # refuses a model of another machine before any long work
    model_file = None if model is None else read_file_and_model(model, machine)[0]
    refuse_unwritable(output)
    once, twice = _each_once(bags)
    results = _results([str(Path(bag).absolute()) for bag in once], machine, model_file,
                       namespace, output, scheduler)
    named = dict(zip(results, once))
    told = [BagValues.from_json(result, named[bag]) for bag, result in results.items()
            if 'error' not in result]
    refused = {named[bag]: result['error'].replace(bag, named[bag])
               for bag, result in results.items() if 'error' in result}
    refused |= _same_dates(told)
    told = [item for item in told if item.bag not in refused]
    refused |= _other_parameters(told)
    told = [item for item in told if item.bag not in refused]
    for bag, why in twice.items():  # under one name, what else is wrong with it goes first
        refused.setdefault(bag, why)
    if not told:
        raise InputError(f'none of {len(bags)} bags can be used; the first: '
                         f'{next(iter(refused.values()))}')
    life = life_of(told)
    outcome = outcome_of_life(life, refused, machine)
    outcome = Outcome(outcome.sentence, outcome.standing,
                      (*outcome.remarks, *_setup_remarks(told)))
    provenance = origin('par4_trend', machine, {
        'bags': len(bags), 'model': model, 'namespace': namespace})
    # the plot library is slow to load, and some homes make it talk on stderr
    from par4_identification.reports.trend_report import report_of_life
    write_results(output, {
        'trend.json': trend_json(life, refused, machine, outcome.sentence),
        'report.html': report_of_life(life, outcome, refused, machine, provenance)})
    say(*lines_of_refused(refused), outcome.sentence)
    say(f'results and report: {output}', whole=True)


def _results(bags: Sequence[str], machine: Robot | Axis, model_file: ModelFile | None,
             namespace: str | None, output: Path, scheduler: str | None
             ) -> dict[str, Mapping[str, Any]]:
    """Return what each bag says or why it says nothing, in the order given."""
    kept = Kept(output, machine, model_file, namespace)
    found: dict[str, Mapping[str, Any]] = {}
    keys: dict[str, str] = {}
    terminal = Console(stderr=True)
    with Progress(console=terminal, transient=True, disable=not terminal.is_terminal) as progress:
        bar = progress.add_task('bags', total=len(bags))
        for bag in bags:
            try:
                keys[bag] = kept.key(bag)
            except OSError as error:
                found[bag] = {'error': f'{bag}: {error.strerror or error}; check the path'}
            else:
                known = kept.read(keys[bag])
                if known is not None:
                    found[bag] = known
            if bag in found:
                progress.advance(bar)
        work = partial(outcome_of_bag, machine=machine, model_file=model_file, namespace=namespace)
        for bag, result in results_of(work, [bag for bag in bags if bag not in found], scheduler):
            if 'error' not in result:
                kept.write(keys[bag], result)
            found[bag] = result
            progress.advance(bar)
    return {bag: found[bag] for bag in bags}


def _each_once(bags: Sequence[str]) -> tuple[list[str], dict[str, str]]:
    """Return the bags without those given before, and what is said of those."""
    first: dict[str, str] = {}
    again = {}
    for bag in bags:
        path = os.path.realpath(bag)
        if path in first:
            as_given = '' if first[path] == bag else f', as {first[path]} before'
            again[bag] = f'{bag}: given twice{as_given}; it counts once'
        first.setdefault(path, bag)
    return list(first.values()), again


def _same_dates(bags: Sequence[BagValues]) -> dict[str, str]:
    """Return bags that begin when another one does: a copy would count twice."""
    first: dict[int, str] = {}
    again = {}
    for item in bags:
        if item.stamp in first:
            again[item.bag] = (f'{item.bag}: begins at the same time as {first[item.stamp]}; give '
                               f'every recording once')
        first.setdefault(item.stamp, item.bag)
    return again


def _other_parameters(bags: Sequence[BagValues]) -> dict[str, str]:
    """Return bags that tell other base parameters than most: steady speeds show no inertia."""
    found = Counter(item.terms for item in bags).most_common(1)
    return {item.bag: f'{item.bag}: tells {", ".join(item.terms)}, most bags tell '
                      f'{", ".join(found[0][0])}; give bags of one kind of motion'
            for item in bags if item.terms != found[0][0]}


def _setup_remarks(bags: Sequence[BagValues]) -> list[Remark]:
    """Return what was wrong with the setup of bags and was mended."""
    return [Remark(False, f'{item.bag}: {item.findings[0]}. It was mended.',
                   'Run par4_identify on such a bag: it says what to do.')
            for item in bags if item.findings]
