"""Reading checked YAML and writing results so that nothing is ever half written."""

from __future__ import annotations

import fcntl
import io
import os
import shutil
import signal
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from copy import deepcopy
from errno import EDQUOT, EFBIG, ENOSPC, ENOTDIR
from functools import lru_cache
from importlib import resources
from itertools import takewhile
from pathlib import Path
from typing import Annotated, Any, ClassVar, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from par4_kinematics.errors import InputError, quoted
from par4_kinematics.held_signals import held_back
from par4_kinematics.paths import instead_of_file, refuse_loop
from par4_kinematics.schema_words import faults_in_words
from par4_kinematics.yaml_words import problem_in_words


class FileModel(BaseModel):
    """Base of everything read from YAML: immutable, finite numbers, unknown keys refused.

    Attributes:
        page: of the documentation that has the keys of the file.
    """

    page: ClassVar[str] = 'docs/interface.md'
    model_config = ConfigDict(frozen=True, extra='forbid', allow_inf_nan=False)


def _no_word(value: object) -> object:
    """Refuse `true` and quoted text, which would count as numbers."""
    if isinstance(value, bool | str):
        raise ValueError('expected a whole number, without quotes')
    return value


Whole = Annotated[int, BeforeValidator(_no_word)]
"""A whole number; 1e5 is one. Of numbers that need not be whole pydantic has `StrictFloat`."""
NO_ROOM = (ENOSPC, EDQUOT, EFBIG)
"""Errors of a disk, a quota or a limit that is full."""
FileType = TypeVar('FileType', bound=FileModel)


def read_yaml(path: str | Path) -> object:
    """Return the content of a YAML 1.2 file (`1e-3` is a number).

    Raises:
        InputError: the file does not exist, cannot be read or is not YAML.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding='utf-8')
    except FileNotFoundError:
        raise InputError(f'{path}: no such file; give the path of an existing file') from None
    except OSError as error:
        raise InputError(f'{path}: cannot be read ({error.strerror or error}); check path and '
                         f'rights') from error
    except UnicodeDecodeError as error:
        raise InputError(f'{path}: expected text in UTF-8, found byte {error.object[error.start]} '
                         f'at {error.start}; save it as UTF-8') from error
    try:
        return deepcopy(_content(text))
    except YAMLError as error:
        raise InputError(f'{path}: {problem_in_words(error, text)}') from error
    except RecursionError:
        raise InputError(f'{path}: nested too deeply; mend the file') from None
    # what its scalars say is understood by Python's own functions, which raise what they like
    except Exception as error:
        raise InputError(f'{path}: a date or a value with a tag (!!) in it is not understood; '
                         f'mend it') from error


@lru_cache(maxsize=8)
def _content(text: str) -> object:
    """Return what a YAML text says; robot and model are read again and again."""
    return YAML(typ='safe', pure=True).load(text)


def parse(content: object, model: type[FileType], source: str) -> FileType:
    """Return `content` as `model`; `source` names it in the error.

    Raises:
        InputError: what breaks the schema, all of it in one line.
    """
    try:
        return model.model_validate(content)
    except ValidationError as error:
        raise InputError(f'{source}: {faults_in_words(error, model)}; see {model.page}') from error


def expect_schema(content: object, schemas: tuple[str, ...], source: str,
                  page: str = FileModel.page) -> str:
    """Return the schema that `content` declares, which must be one of `schemas`.

    Raises:
        InputError: it declares another one or none; `page` tells what such a file has.
    """
    if not isinstance(content, dict):
        raise InputError(f'{source}: expected a mapping with `schema: {schemas[0]}`, found '
                         f'{quoted(content)}; see {page}')
    found = content.get('schema')
    if found not in schemas:
        raise InputError(f'{source}: expected schema {" or ".join(schemas)}, found '
                         f'{quoted(found)}; see {page}')
    return found


def resolve_builtin(name_or_path: str | Path, package: str) -> Path:
    """Return the path of the built-in file of that name in `package`, else the path itself.

    Raises:
        InputError: neither a built-in name nor an existing file.
    """
    folder = Path(str(resources.files(package))) / 'builtin'
    builtin = {file.stem: file for file in sorted(folder.glob('*.yaml'))}
    if str(name_or_path) in builtin:
        return builtin[str(name_or_path)]
    path = Path(name_or_path)
    if not path.is_file():
        raise InputError(f'{name_or_path or "an empty name"}: {instead_of_file(name_or_path)}, and '
                         f'not a built-in name ({", ".join(builtin)}); give one of these or the '
                         f'path of a file')
    return path


def why_no_text(error: Exception) -> str:
    """Return why a file cannot be read as text."""
    if isinstance(error, UnicodeDecodeError):
        return 'it holds bytes that are no text'
    return error.strerror if isinstance(error, OSError) and error.strerror else str(error)


def unwritable(path: str | Path, error: Exception) -> InputError:
    """Return that an output cannot be written, why, and what to do."""
    reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    full = (isinstance(error, OSError) and error.errno in NO_ROOM) or 'full' in reason
    return InputError(f'{path}: cannot be written ({reason.lower()}); '
                      f'{"free space" if full else "give another path"}')


@contextmanager
def written_atomically(path: str | Path, new: bool = False) -> Iterator[Path]:
    """Yield a scratch path beside `path` (a file or a folder to fill) that replaces it on success.

    Links are followed, so that what they lead to is replaced. If the block raises, `path` stays as
    it was, and the scratch is removed with the folders that were made for it. With `new` nothing is
    replaced, not even what another command has put there meanwhile.

    Raises:
        InputError: it cannot be written, or is there though it should be new.
    """
    asked, path = path, Path(os.path.realpath(path))
    missing = _missing(path.parent)
    scratch_folder = None
    try:
        refuse_loop(path)
        if not path.parents[len(missing)].is_dir():
            raise NotADirectoryError(ENOTDIR, os.strerror(ENOTDIR))
        path.parent.mkdir(parents=True, exist_ok=True)
        scratch_folder = Path(tempfile.mkdtemp(prefix=f'.{path.name}.', dir=path.parent))
        scratch = scratch_folder / path.name
        yield scratch
        if new and path.exists():
            raise InputError(f'{asked}: exists already; give another path or remove it')
        if path.is_dir() and scratch.is_dir():
            path.rename(scratch_folder / 'replaced')
        os.replace(scratch, path)
    except OSError as error:
        if _concerns(error, path.parent if scratch_folder is None else scratch_folder):
            raise unwritable(asked, error) from error
        raise
    finally:
        if scratch_folder is not None:
            shutil.rmtree(scratch_folder, ignore_errors=True)
        _remove_empty(missing)


@contextmanager
def alone_in(folder: str | Path) -> Iterator[None]:
    """Let no other command replace files of a folder in this block; wait for one that does.

    For files that belong together: those of two commands are never mixed, and Ctrl-C waits until
    all are there. The operating system locks the folder itself and unlocks it when this process
    ends, however that is; there is no file that could be left behind. Where the folder cannot be
    locked, as on some network drives or because it cannot be made, the block runs all the same:
    what writes there says what is wrong. The block must not begin another one of the same folder.
    """
    place = Path(os.path.realpath(folder))
    missing = _missing(place)
    try:
        with ExitStack() as held:
            with suppress(OSError):
                place.mkdir(parents=True, exist_ok=True)
                number = os.open(place, os.O_RDONLY | os.O_DIRECTORY)
                held.callback(os.close, number)
                fcntl.flock(number, fcntl.LOCK_EX)
            with held_back(signal.SIGINT, signal.SIGTERM):
                yield
    finally:
        _remove_empty(missing)


def _missing(folder: Path) -> list[Path]:
    """Return which of a folder and those above it do not exist, the lowest first."""
    return list(takewhile(lambda path: not path.exists(), (folder, *folder.parents)))


def _remove_empty(folders: list[Path]) -> None:
    """Remove folders that hold nothing, and leave the others."""
    for folder in folders:
        with suppress(OSError):
            folder.rmdir()


def _concerns(error: OSError, folder: Path) -> bool:
    """Return whether an error is of writing below a folder: a full disk tells no name."""
    return error.filename is None or Path(str(error.filename)).is_relative_to(folder) or (
        folder.is_relative_to(str(error.filename)))


def write_text(path: str | Path, text: str) -> None:
    """Write `text` to `path` atomically; see `written_atomically`."""
    with written_atomically(path) as scratch:
        scratch.write_text(text, encoding='utf-8')


def yaml_text(content: object) -> str:
    """Return `content` (plain dicts, lists, numbers and strings) as YAML."""
    yaml: Any = YAML(typ='safe', pure=True)  # its settings are declared as None only
    yaml.default_flow_style = False
    yaml.sort_base_mapping_type_on_output = False
    stream = io.StringIO()
    yaml.dump(content, stream)
    return stream.getvalue()


def write_yaml(path: str | Path, content: object) -> None:
    """Write `content`, as `yaml_text` has it, to `path` atomically; see `written_atomically`."""
    write_text(path, yaml_text(content))
