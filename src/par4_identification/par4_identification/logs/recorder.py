"""Recording without ROS: raw messages go in, a bag comes out."""

from __future__ import annotations

import struct
from collections import Counter, defaultdict
from dataclasses import dataclass
from pathlib import Path

from par4_identification.logs.stamps import Losses
from par4_kinematics.interface import JOINT_STATES
from par4_kinematics.stamps import SECOND
from par4_sim.bags.bag_writer import BagWriter


@dataclass(frozen=True)
class Recording:
    """What a recording holds.

    Attributes:
        path: of the bag.
        messages: number written, by topic.
        lost: samples that gaps in the header stamps would have held, by topic of joint states.
    """

    path: Path
    messages: dict[str, int]
    lost: dict[str, int]


class Recorder:
    """One recording, from construction to `close`.

    The bag grows at its final path, so that a kill leaves something to repair there; only `close`
    completes it. Call everything from one thread, and `flush` every second or so: then no kill
    loses more than that.
    """

    def __init__(self, output: str | Path, storage: str = 'mcap') -> None:
        """Start the bag `output`.

        Raises:
            InputError: it exists or cannot be created, or the storage is unknown.
        """
        self._bag = BagWriter(output, storage)
        self._messages: Counter[str] = Counter()
        self._losses: defaultdict[str, Losses] = defaultdict(Losses)

    def write(self, topic: str, type_name: str, received: int, data: bytes) -> None:
        """Write a message as it came, serialised.

        Args:
            topic: name with its namespace.
            type_name: such as sensor_msgs/msg/JointState.
            received: system time, ns; simulated time may jump back and would shuffle the bag.
            data: the message.

        Raises:
            InputError: a type without definition, or the disk refuses.
        """
        self._bag.write_raw(topic, type_name, received, data)
        self._messages[topic] += 1
        if type_name == JOINT_STATES.type:
            self._losses[topic].take(_header_stamp(data))

    def flush(self) -> None:
        """Put what was written so far out of reach of a kill.

        Raises:
            InputError: the disk refuses.
        """
        self._bag.flush()

    @property
    def failed(self) -> bool:
        """Whether the disk refused something: the bag is to be repaired, `close` does nothing."""
        return self._bag.failed

    @property
    def recording(self) -> Recording:
        """What was written so far."""
        return Recording(self._bag.path, dict(self._messages), {
            topic: losses.count for topic, losses in self._losses.items()})

    def close(self) -> Recording:
        """Complete the bag and return what it holds.

        Raises:
            InputError: the disk refuses.
        """
        self._bag.close()
        return self.recording


def _header_stamp(data: bytes) -> int:
    """Return the stamp, ns, of a serialised message that begins with a header."""
    seconds, nanoseconds = struct.unpack_from('<iI' if data[1] else '>iI', data, 4)
    return seconds * SECOND + nanoseconds
