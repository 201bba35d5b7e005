"""When silence on a topic is worth a warning, by a clock that is given its times."""

import os
import random
import subprocess
import sys

from ahf_ros.nodes.patience import CONTINUOUS, SECONDS, TRIGGERED, UNKNOWN, Patience
from ahf_ros.nodes.processes import Processes

DRIVER = frozenset({'driver'})
OTHER = frozenset({'other'})
NOBODY: frozenset[str] = frozenset()


class Watched:
    """A topic that is looked at every second, from a start that is not 0."""

    def __init__(self, acquisition: str, fit: bool = True) -> None:
        self._acquisition, self._fit = acquisition, fit
        self.now = self._arrived = 500.0
        self._patience = Patience(self.now)

    def warned(
        self,
        seconds: float,
        publishers: frozenset[str] = DRIVER,
        arrives: bool = False,
        busy: bool = False,
    ) -> int:
        """Return at how many looks in this time there is a warning; a message comes at its end."""
        count = 0
        for number in range(round(seconds)):
            self.now += 1.0
            if arrives and number == round(seconds) - 1:
                self._arrived = self.now - 0.5
            self._patience.look(self.now, publishers, self._arrived, busy)
            count += self._patience.ended(SECONDS, self._acquisition, self._fit)
        return count


def test_a_triggered_scanner_is_silent_for_an_hour_without_a_warning() -> None:
    random.seed(48)
    for acquisition in (UNKNOWN, TRIGGERED):
        topic = Watched(acquisition)
        assert topic.warned(8, NOBODY) == 0
        assert topic.warned(9, arrives=True) == 0
        while topic.now < 4200:
            assert topic.warned(random.uniform(11, 600), arrives=True) == 0
            assert topic.warned(random.uniform(1, 60), busy=True) == 0
    assert Watched(TRIGGERED).warned(3600) == 0


def test_a_publisher_that_never_sends_or_ends_is_told_in_time() -> None:
    assert Watched(UNKNOWN).warned(15) == 5 - 1  # the first look discovers it
    for acquisition in (UNKNOWN, TRIGGERED, CONTINUOUS):
        topic = Watched(acquisition)
        assert topic.warned(30, NOBODY) == 20
        assert topic.warned(5, arrives=True) == 0
        assert topic.warned(11, NOBODY) == 0
        assert topic.warned(4, NOBODY) == 4
    assert Watched(TRIGGERED, fit=False).warned(15) == 4


def test_a_camera_that_takes_images_all_the_time_and_stops_is_told() -> None:
    topic = Watched(CONTINUOUS)
    assert topic.warned(5, arrives=True) == 0
    assert topic.warned(15) == 5


def test_the_clock_starts_with_a_publisher_and_stands_still_during_work() -> None:
    topic = Watched(UNKNOWN)
    assert topic.warned(9, NOBODY) == 0
    assert topic.warned(11) == 0
    topic = Watched(CONTINUOUS)
    assert topic.warned(8, arrives=True) == 0
    assert topic.warned(300, busy=True) == 0
    assert topic.warned(10) == 0
    assert topic.warned(3) == 3


def test_a_publisher_that_takes_the_place_of_another_has_to_send() -> None:
    topic = Watched(UNKNOWN)
    assert topic.warned(5, arrives=True) == 0
    assert topic.warned(40) == 0
    assert topic.warned(40, DRIVER | OTHER) == 0
    assert topic.warned(20, OTHER) == 20


def test_without_a_time_silence_is_no_warning() -> None:
    patience = Patience(0.0)
    patience.look(100.0, NOBODY, 0.0, False)
    assert patience.waited == 100.0
    assert not patience.ended(0.0, CONTINUOUS)


def identifier(process: int, vendor: bytes = b'\1\x0f', host: bytes = b'\7\7') -> list[int]:
    """Return the identifier of a publisher as Fast DDS makes it."""
    return list(vendor + host + (process % 2**16).to_bytes(2, 'little') + bytes(10))


def test_processes_that_have_ended_are_known_on_this_machine_only() -> None:
    known = Processes([identifier(1), identifier(os.getpid())])
    command = sys.executable, '-c', 'input()'
    with subprocess.Popen(command, stdin=subprocess.PIPE) as process:
        ours = identifier(process.pid)
        others = [
            identifier(process.pid, host=b'\7\6'),
            identifier(process.pid, vendor=b'\1\x10'),
            [],
        ]
        assert not known.ended(ours)
        assert not any(map(known.ended, others))
        without = Processes([identifier(1)])
        assert not without.ended(ours)
        process.kill()
        os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)
        assert known.ended(ours)  # though nobody has waited for it
    assert known.ended(ours)
    assert not any(map(known.ended, others))
    assert not without.ended(ours)
