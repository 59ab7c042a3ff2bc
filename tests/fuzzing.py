"""What outside data may look like at its worst, for hypothesis; sizes are bounded."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hypothesis import strategies as st

from par4_kinematics.errors import LONGEST_LINE, Par4Error

ODD_NUMBERS = ('0', '-0', '-1', '1e-320', '1e308', '-1e308', '1e999', '.nan', '.inf', '-.inf',
               'nan', 'inf', '1' * 5000, '0x7fffffffffffffffffff', '9223372036854775808', '1_0',
               '1,5', '0o17', '\uff11', '\u0661', '1e', '--1', 'true', '~', '')
ODD_TEXTS = ('', ' ', '\x00', '\ufeff', '\u2028', '🤖', 'x' * 3000, '../../etc/passwd', '/', '[]',
             '{}', '[[]]', '!!python/object:os.system x', '!!binary aGk=', '2001-99-99',
             '2001-01-01', '? x', '*a', '&a', '- ', '|', '>', "'", '"', '%', '\t', '\\', '# x',
             '<<: *a', '{[1]: 2}', '{1: 2}', '[1, [2]]', '{a: {b: [c, {d: e}]}}', '\udcff')
odd = st.one_of(st.sampled_from(ODD_NUMBERS + ODD_TEXTS),
                st.floats().map(repr), st.integers().map(str), st.text(max_size=20))

@st.composite
def damaged(draw: st.DrawFn, content: bytes) -> bytes:
    """Draw what a fault of disk or transport makes of some bytes."""
    data = bytearray(content)
    for _ in range(draw(st.integers(1, 6))):
        at = draw(st.integers(0, len(data)))
        kind = draw(st.sampled_from(('write', 'flip', 'cut', 'insert', 'end', 'repeat', 'large')))
        size = draw(st.integers(1, 64))
        if kind == 'write':
            data[at:at + size] = draw(st.binary(min_size=1, max_size=8))
        elif kind == 'flip' and at < len(data):
            data[at] ^= 1 << draw(st.integers(0, 7))
        elif kind == 'cut':
            del data[at:at + size]
        elif kind == 'insert':
            data[at:at] = draw(st.binary(max_size=64))
        elif kind == 'repeat':
            data[at:at] = data[at:at + 8 * size]
        elif kind == 'large':  # where a size or a count may stand
            data[at:at + 4] = draw(st.sampled_from((b'\xff' * 4, b'\xff\xff\xff\x7f',
                                                    b'\x00\x00\x00\x80', b'\x00' * 4)))
        elif kind == 'end':
            del data[at:]
    return bytes(data)

@st.composite
def bent(draw: st.DrawFn, text: str) -> bytes:
    """Draw what a careless or malicious hand makes of a text of lines and values."""
    kind = draw(st.sampled_from(('value', 'line', 'bytes', 'nested', 'aliases', 'any')))
    if kind == 'bytes':
        return draw(damaged(text.encode()))
    if kind == 'nested':
        depth, mark = draw(st.integers(1, 1200)), draw(st.sampled_from(('[', '{a: ', '- ', '(')))
        return (text + '\nx: ' + depth * mark).encode()
    if kind == 'aliases':
        return (text + aliases(draw(st.integers(1, 12)), draw(st.integers(1, 12)))).encode()
    if kind == 'any':
        return draw(st.one_of(st.text(max_size=200).map(lambda part: part.encode(
            errors='surrogatepass')), st.binary(max_size=200)))
    lines = text.splitlines()
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, len(lines) - 1))
        if kind == 'line':
            lines[at:at + draw(st.integers(0, 2))] = [draw(odd)]
            if not lines:
                break
        else:
            places = [index for index, mark in enumerate(lines[at]) if mark in ':,[ =;']
            if places:
                place = draw(st.sampled_from(places)) + 1
                end = min((index for index, mark in enumerate(lines[at])
                           if index > place and mark in ',]}'), default=len(lines[at]))
                lines[at] = f'{lines[at][:place]} {draw(odd)}{lines[at][end:]}'
    return '\n'.join(lines).encode(errors='surrogatepass')

def aliases(levels: int, width: int) -> str:
    """Return YAML of few bytes that stands for `width` to the power of `levels` values."""
    lines = ['\nlevel_0: &level_0 [x, x]']
    for level in range(1, levels):
        parts = ', '.join(width * [f'*level_{level - 1}'])
        lines.append(f'level_{level}: &level_{level} [{parts}]')
    return '\n'.join([*lines, f'bomb: *level_{levels - 1}', ''])

def refused_in_a_line(read: Callable[[], Any]) -> Any:
    """Return what is read, None where it is refused; every refusal must be one line of words."""
    try:
        return read()
    except Par4Error as error:
        said = str(error)
        assert said
        assert len(said) <= LONGEST_LINE
        assert said.isprintable(), repr(said)
        return None
