"""How every offline executable starts and ends: one line on bad input, never a traceback."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise
from typing import NoReturn

import click

from par4_kinematics.errors import NO_CACHE, Par4Error, is_without_cache, one_line
from par4_kinematics.paths import at_home
from par4_sim.commands.output import dropping
from par4_start import STOPPED, tool_ends_quietly, tool_is_interrupted

NAMESPACE = '--namespace'
"""The option that may be empty: topics then sit under none."""


@contextmanager
def loading() -> Iterator[None]:
    """Load in this block what a command calls: a second or two in which Ctrl-C ends it quietly.

    From its end on there may be something to tidy up, so that Ctrl-C raises KeyboardInterrupt.
    """
    tool_ends_quietly()
    yield
    tool_is_interrupted()
    signal.signal(signal.SIGTERM, signal.SIG_DFL)


def run(command: click.Command) -> NoReturn:
    """Run a command; exit 0 if it did its work, 2 with `error: ...` on bad input, 130 if stopped.

    An interrupt leaves nothing half written: results are put in place only when complete. A reader
    of what the command says may go away without harm; a disk too full for that is an error, but
    not before the work is done. Every command answers `--version`, and `--help` wherever it stands.
    """
    with dropping() as output:
        code = _run(command)
        print(end='', flush=True)
        if code == 0 and output is not None and output.trouble is not None:
            code = _refuse(f'standard output: {output.trouble.strerror}; the work is done, but '
                           f'what was to be said of it is lost')
    sys.exit(code)


def _run(command: click.Command) -> int:
    """Run a command and return its exit code."""
    if all(parameter.name != 'version' for parameter in command.params):
        command = click.version_option(package_name='par4_sim', prog_name=command.name)(command)
    arguments = [_at_home(argument) for argument in sys.argv[1:]]
    if '--help' in arguments:  # also where it stands in place of the value of an option
        arguments = ['--help']
    try:
        _refuse_missing_values(command, arguments)
        _refuse_repeated(command, arguments)
        command.main(arguments, standalone_mode=False)
    except click.exceptions.Exit as finished:
        return finished.exit_code
    except click.ClickException as error:
        return _refuse(f'{_fault_of_usage(error)}; see {command.name} --help')
    except Par4Error as error:
        return _refuse(str(error))
    except OSError as error:
        return _refuse(_fault_of_system(error))
    except (click.Abort, KeyboardInterrupt):
        print('stopped; nothing is half written', file=sys.stderr)
        return STOPPED
    except RuntimeError as error:
        if not is_without_cache(error):
            raise
        return _refuse(NO_CACHE)
    except MemoryError:
        return _refuse('the memory of this machine does not hold so much data; give shorter bags, '
                       'or fewer at a time')
    return 0


def _fault_of_usage(error: click.ClickException) -> str:
    """Return what click says of a command line, of a value as our types say it."""
    found = error.format_message()
    if type(error) is click.BadParameter and error.param is not None:
        asked = error.param
        name = asked.opts[0] if isinstance(asked, click.Option) else asked.human_readable_name
        found = f'{name}: {error.message}'
    return ' '.join(found.split()).rstrip('.')


def _fault_of_system(error: OSError) -> str:
    """Return what an error of the operating system says of a path, and what to do."""
    try:
        os.getcwd()
    except FileNotFoundError:
        return 'the folder that the shell is in has been removed; change to another one'
    return f'{error.filename or "file"}: {error.strerror or error}; check path and space'


def _refuse_missing_values(command: click.Command, words: Sequence[str]) -> None:
    """Refuse an option in place of another's value, and a text that is empty.

    Both come of shell variables that are not set: the one option would take the other as its value,
    and an empty path is the folder that the shell is in.

    Raises:
        click.UsageError: says where.
    """
    options = [option for option in command.params if isinstance(option, click.Option)]
    names = {name for option in options for name in (*option.opts, *option.secondary_opts)}
    with_value = {name for option in options if not option.is_flag for name in option.opts}
    for before, word in pairwise(('', *words)):
        name, equals, value = word.partition('=')
        if before in with_value and name in names:
            raise click.UsageError(f'{before}: found the option {name} in place of its value')
        if name in with_value and equals and not value:
            before, word = name, ''
        if not word and before != NAMESPACE:
            raise click.UsageError(f'{before if before in with_value else "argument"}: found an '
                                   f'empty text; is a variable of the shell not set?')


def _refuse_repeated(command: click.Command, words: Sequence[str]) -> None:
    """Refuse an option that is given again, of which the last would hold without a word.

    One that may be given several times must have another value each time.

    Raises:
        click.UsageError: names it.
    """
    options = {name: option for option in command.params if isinstance(option, click.Option)
               for name in (*option.opts, *option.secondary_opts)}
    given = set()
    for word, following in pairwise((*words, '')):
        name, equals, value = word.partition('=')
        if word == '--':
            break
        if name in options:
            option = options[name]
            asked = f' {value if equals else following}' if option.multiple else ''
            if (option.name, asked) in given:
                raise click.UsageError(f'{name}{asked}: given twice; give it once')
            given.add((option.name, asked))


def _at_home(argument: str) -> str:
    """Return an argument `--option=path` with its path as `at_home` has it."""
    option, mark, path = argument.partition('=')
    return f'{option}={at_home(path)}' if mark and option.startswith('--') else argument


def _refuse(line: str) -> int:
    print(f'error: {one_line(line)}', file=sys.stderr)
    return 2
