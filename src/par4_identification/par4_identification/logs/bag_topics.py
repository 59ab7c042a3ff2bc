"""Which topics of a bag are those of the contract, whatever namespace they sit under."""

from __future__ import annotations

from pathlib import Path

from par4_kinematics.errors import InputError
from par4_kinematics.interface import JOINT_STATES, RECORDED_TOPICS, Topic


def choose_topics(path: Path, types: dict[str, str], filled: set[str],
                  namespace: str | None) -> dict[str, str]:
    """Return the full name of each recorded topic of the contract that has messages.

    Args:
        path: of the bag, for what is refused.
        types: message type of every topic of the bag, by its full name.
        filled: the topics that have messages.
        namespace: that the topics sit under, or None to find it.

    Raises:
        InputError: no message, no `joint_states`, or a topic under several namespaces.
    """
    if not filled:
        raise InputError(f'{path}: the bag holds no message; record it again')
    spaces = {topic.name: _namespaces(topic, types, filled) for topic in RECORDED_TOPICS}
    asked = None if namespace is None else '/' + namespace.strip('/')
    home = _choose_namespace(path, JOINT_STATES.name, spaces[JOINT_STATES.name], asked)
    if home is None:
        where = '' if asked is None else f' under {asked}'
        held = ', '.join(f'{name} ({types[name]})' for name in sorted(filled))
        raise InputError(f'{path}: no {JOINT_STATES.name} ({JOINT_STATES.type}) with messages'
                         f'{where}; the bag holds {held}; give --namespace or remap when recording')
    chosen = {}
    for name, found in spaces.items():
        space = home if home in found else _choose_namespace(path, name, found, asked)
        if space is not None:
            chosen[name] = f'{space.rstrip("/")}/{name}'
    return chosen


def _namespaces(topic: Topic, types: dict[str, str], filled: set[str]) -> list[str]:
    return sorted(name[:-len(topic.name) - 1] or '/' for name in filled
                  if name.endswith(f'/{topic.name}') and types[name] == topic.type)


def _choose_namespace(path: Path, name: str, found: list[str], asked: str | None) -> str | None:
    if asked is not None:
        return asked if asked in found else None
    if len(found) > 1:
        raise InputError(f'{path}: {name} is there under {", ".join(found)}; give one of them as '
                         '--namespace')
    return found[0] if found else None
