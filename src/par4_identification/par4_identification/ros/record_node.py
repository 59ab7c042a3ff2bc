"""Node `par4_record`: the topics of the contract -> a bag; `--repair` mends one cut off."""

from __future__ import annotations

import itertools
import math
import shutil
import sys
import time
from collections import Counter, defaultdict
from dataclasses import replace
from pathlib import Path
from typing import Any

from rclpy.subscription import Subscription

from par4_identification.ros.record_parameters import RecordParameters, asked_to_mend
from par4_kinematics.errors import InputError, Par4Error
from par4_kinematics.interface import (
    AMPLIFIER_VOLTAGE,
    DIAGNOSTICS,
    JOINT_STATES,
    RECORDED_TOPICS,
    SHOWN_TOPICS,
    Topic,
)
from par4_kinematics.ros.arrivals import SILENCE
from par4_kinematics.ros.diagnostics import ERROR, OK, NodeState
from par4_kinematics.ros.node import Par4Node
from par4_kinematics.ros.numbering import Numbering
from par4_kinematics.ros.process import run
from par4_kinematics.stamps import SECOND
from par4_sim.bags.bag_writer import BagWriter

BUFFER = 20000
"""Messages of a topic that wait while this process is held up."""
TICK = 0.02
"""Seconds of wall time between looks at the clock."""


class RecordNode(Par4Node):
    """The node `par4_record`; `RecordParameters` says what it does."""

    AWAITS = (JOINT_STATES,)
    PARAMETERS = RecordParameters
    parameters: RecordParameters
    REST = 0.005  # a turn of the executor costs more than a message: take them by the dozen

    def __init__(self) -> None:
        super().__init__()
        self._begun_bags = 0
        self._bag: BagWriter | None = None
        self._path = Path(self.parameters.output)
        self._received: Counter[str] = Counter()
        self._numbering: defaultdict[str, Numbering] = defaultdict(Numbering)
        self._newest: dict[str, float] = {}
        self._latched: dict[Topic, bytes] = {}
        self._began_ns, self._told_of_runs = 0, False
        self._start()
        self._recorded = {topic: self._record(topic)
                          for topic in (*RECORDED_TOPICS, *SHOWN_TOPICS)}
        self.serve('~/start', self._start)
        self.serve('~/stop', self._stop)
        self.create_timer(TICK, self._stop_in_time, clock=self.wall_clock)
        self.create_timer(1.0, self._flush, clock=self.wall_clock)

    def _record(self, topic: Topic) -> Subscription:
        def take(data: bytes, info: dict[str, Any]) -> None:
            self._write(topic, data, info)
            self._write_waiting()

        return self.subscribe_raw(replace(topic, depth=BUFFER), take)

    def _write_waiting(self) -> None:
        for topic, subscription in self._recorded.items():
            with subscription.handle:
                for _ in range(BUFFER):
                    waiting = subscription.handle.take_message(subscription.msg_type, True)
                    if waiting is None:
                        break
                    self._write(topic, *waiting)

    def _write(self, topic: Topic, data: bytes, info: dict[str, Any]) -> None:
        if topic.transient_local:  # it comes once, and belongs into every bag that begins later
            self._latched[topic] = data
        if self._bag is None:
            return
        if topic != DIAGNOSTICS:  # numbered by all nodes: holes say nothing, as in `faults`
            self._numbering[topic.name].take(info['publication_sequence_number'])
        if topic in RECORDED_TOPICS:
            self._newest[topic.name] = time.monotonic()
            if not self._began_ns:  # simulated time is 0 until the first clock message
                self._began_ns = self.get_clock().now().nanoseconds
        self._put(self._bag, topic, info['received_timestamp'], data)

    def _put(self, bag: BagWriter, topic: Topic, received: int, data: bytes) -> None:
        self._received[topic.name] += 1
        bag.write_raw(self._recorded[topic].topic_name, topic.type, received, data)

    def _start(self) -> str:
        if self._bag is not None:
            return f'recording {self._path} already'
        if self._begun_bags > 0:
            first = Path(self.parameters.output)  # which drops a slash at the end
            self._path = next(path for number in itertools.count(self._begun_bags + 1) if not (
                path := first.with_name(f'{first.name}_{number}')).exists())
        bag = BagWriter(self._path, self.parameters.storage)
        self._received.clear()
        self._numbering.clear()
        self._newest.clear()
        self._began_ns, self._told_of_runs = 0, False
        for topic, data in self._latched.items():
            self._put(bag, topic, time.time_ns(), data)
        self._bag = bag
        self._begun_bags += 1
        return f'recording {self._path}'

    def _stop(self) -> str:
        if self._bag is None:
            raise InputError('nothing is being recorded; call ~/start first')
        self._write_waiting()
        bag, self._bag = self._bag, None
        try:
            bag.close()
        except Par4Error as error:
            self.failure = error  # told until the node ends, and by its exit code
            raise
        topics = ', '.join(f'{name} {count}' for name, count in sorted(self._received.items()))
        line = f'{self._path}: {self._received.total()} messages ({topics}), {self._lost()} lost'
        if not self._newest:  # what has failed to start is started again, to the same path
            line = f'{self._path}: no message of the robot came, so no bag is left'
            try:
                shutil.rmtree(self._path)
            except OSError as error:
                line = (f'{self._path}: no message of the robot came, and the bag cannot be '
                        f'removed: {error.strerror}')
        print(line, flush=True)
        return line

    def _lost(self) -> int:
        return sum(numbering.missing for numbering in self._numbering.values())

    def _stop_in_time(self) -> None:
        duration_ns, began_ns = self.parameters.duration * SECOND, self._began_ns
        if duration_ns > 0.0 and began_ns and self._bag is not None and (
                self.get_clock().now().nanoseconds - began_ns >= duration_ns):
            self.finished = True

    def _flush(self) -> None:
        if self._bag is None:
            return
        if not self._path.is_dir():
            self._bag.failed = True
            self.failure, self.finished = InputError(
                f'{self._path}: removed while it was recorded; nothing of it is left'), True
            return
        self._bag.flush()

    def has_come(self, topic: Topic) -> bool:
        """Return whether a message of a topic has come; none is awaited where nothing records."""
        return self._bag is None or topic.name in self._newest

    def clock_jumped_back(self) -> None:
        """Count the duration from here; the bag goes on and holds two runs."""
        if self._bag is not None and self._began_ns:
            self._began_ns = self.get_clock().now().nanoseconds
            if not self._told_of_runs:
                self._told_of_runs = True
                self.get_logger().warning(f'{self._path} holds more than one run: record each by '
                                          f'its own to identify from them')

    def dead_inputs(self) -> list[str]:
        """Return which topics of the robot, or the clock, came and come no more."""
        if self._bag is None:
            return []
        return [name for name in (JOINT_STATES.name, AMPLIFIER_VOLTAGE.name)
                if time.monotonic() - self._newest.get(name, math.inf) > SILENCE
                ] + super().dead_inputs()

    def state(self) -> NodeState:
        """Return whether the node records, and whether what it records still comes."""
        state = super().state()
        if state.level != OK:
            return state
        if self.failure is not None:
            return NodeState(ERROR, f'a bag is not complete: {self.failure}')
        if self._bag is None:
            return NodeState(OK, 'stopped')
        if JOINT_STATES.name not in self._newest:
            return NodeState(OK, f'waiting for {JOINT_STATES.name}')
        return NodeState(OK, f'recording {self._path}')

    def faults(self) -> dict[str, int]:
        """Return the messages lost on the way, with what every node counts."""
        return {**super().faults(), 'lost_messages': self._lost()}

    def traffic(self) -> dict[str, int]:
        """Return how many messages were received, by topic."""
        return dict(self._received)

    def measures(self) -> dict[str, str]:
        """Return the age of what is recorded."""
        return {f'{name}_age': f'{time.monotonic() - newest:.2f} s'
                for name, newest in self._newest.items()}

    def close(self) -> None:
        """Complete the bag."""
        if self._bag is not None and not self._bag.failed:
            self._stop()


def main() -> int:
    """Run the node, or mend a bag with `--repair BAG [--output OUT]`; return the exit code."""
    if asked_to_mend(sys.argv[1:]):
        from par4_identification.commands import repair  # the node needs no command line
        repair.main()
    return run(RecordNode)


if __name__ == '__main__':
    sys.exit(main())
