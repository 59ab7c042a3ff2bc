"""par4_diagnose: what a model gets wrong about the machine that made the bags, and why."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from par4_identification.commands.conditioning import conditioning_options
from par4_identification.commands.report_option import report_option
from par4_sim.commands.entry import loading, run

GREEDY = ('--holdout', '--before')


class GreedyBags(click.Command):
    """A command in which `--holdout A B` means `--holdout A --holdout B`: up to the next option."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Return what is left of `args` once the options are taken out.

        Raises:
            click.UsageError: among others where such an option took all the bags.
        """
        spread, following, valued = [], '', False
        taken: dict[str, list[str]] = {}
        for word in args:
            if word.startswith('-'):
                name, equals, value = word.partition('=')
                following, valued = name if name in GREEDY else '', bool(equals)
                if following and valued:
                    taken.setdefault(following, []).append(value)
            elif following:
                if valued:
                    spread.append(following)
                valued = True
                taken.setdefault(following, []).append(word)
            spread.append(word)
        try:
            return super().parse_args(ctx, spread)
        except click.MissingParameter as error:
            if not isinstance(error.param, click.Argument) or not taken:
                raise
            option, words = taken.popitem()
            raise click.UsageError(
                f'BAG... is missing: {option} took {" ".join(words)}, as it takes all up to the '
                f'next option; give the bags to diagnose first, as in par4_diagnose {words[-1]} '
                f'{option} {" ".join(words[:-1]) or "OTHER_BAG"}', ctx) from error


@click.command('par4_diagnose', cls=GreedyBags, epilog='\b\nExample:\n'
    '  par4_diagnose my_bag --holdout other_bag --robot reference \\\n'
    '      --output diagnosed')
@click.argument('bags', nargs=-1, required=True, metavar='BAG...')
@click.option('--holdout', multiple=True, metavar='BAG...',
              help='bags to confirm on; without them the last bag, or the last third of one')
@click.option('--before', multiple=True, metavar='BAG...',
              help='bags of the machine as it was, to say what has changed since; in place of a '
                   'model that was right')
@click.option('--robot', required=True, help='robot.yaml or built-in name')
@click.option('--model', default=None,
              help='model.yaml or built-in name that was believed until now: its rigid body and '
                   'effects are taken as known, and what differs from its parameters is told')
@click.option('--output', required=True, type=click.Path(path_type=Path),
              help='folder for diagnosis.json, extended_model.yaml, report.html and, where names '
                   'could not be told apart, motion.yaml')
@click.option('--namespace', default=None, help='that the topics sit under')
@conditioning_options
@click.option('--simulate/--no-simulate', default=True, show_default=True,
              help='run the motion held out through the pybullet plant, the model before and after')
@report_option
def diagnose_bags(**options: Any) -> None:
    """Name what a model gets wrong about the machine that made the bags."""
    with loading():
        from par4_identification.jobs import diagnose
        from par4_identification.jobs.diagnosis_request import DiagnosisRequest
    diagnose.diagnose_bags(DiagnosisRequest(**options))


def main() -> None:
    """Run the executable."""
    run(diagnose_bags)


if __name__ == '__main__':
    main()
