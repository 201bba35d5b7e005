"""Hostile input of every kind: what fails is a traceback, a death, or a loss that is not named.

Every area tries as many inputs as its option says, always the same ones, and counts as failed
whatever does neither succeed nor name what is wrong. At the end, the tests run that concern kills,
signals, programs, limits and foreign files. The whole takes half an hour.

    python -m benchmarks.attack [--bags 10000] [--results 10000] [--messages 10000]
                                [--images 10000] [--no-tests]
"""

from __future__ import annotations

import argparse
import json
import re
import struct
import subprocess
import sys
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from hypothesis import strategies as st

from ahf_ros.bag.definitions import CODED_TARGETS, message_types, typestore
from ahf_ros.drawing.overlay import draw
from ahf_ros.edge_shift import median_edge_shift
from ahf_ros.interchange.image_files import decode_bytes
from ahf_ros.interchange.target_json import to_json
from ahf_ros.interchange.target_messages import coded_target_array
from ahf_ros.target import Identification, Target
from ahf_ros.target_check import checked_targets
from benchmarks import fuzz
from benchmarks.attack_bags import GRAY, hostile_bags, mutated
from support import bags

TESTS = (
    'test/bag/test_bag_damage.py',
    'test/cli/test_cli_ending.py',
    'test/detectors/test_command.py',
    'test/detectors/test_registry.py',
    'test/interchange/test_image_headers.py',
    'test/interchange/test_target_json.py',
    'test/interchange/test_truth_files.py',
    'test/nodes/test_nodes_ending.py',
    'test/nodes/test_nodes_robust.py',
    'test/nodes/test_security.py',
    'test/test_target_check.py',
)


@dataclass(frozen=True, slots=True)
class Tally:
    """What became of the inputs of an area.

    Attributes
    ----------
    area : str
    tried, accepted, failed : int
    reasons : tuple of str
        The first failures.
    """

    area: str
    tried: int
    accepted: int
    failed: int
    reasons: tuple[str, ...] = ()


class Hostile:
    """Raises whatever is asked of it."""

    def _refuse(self) -> str:
        raise RuntimeError('no')

    __repr__ = __str__ = __float__ = _refuse  # type: ignore[assignment]


NUMBERS = st.one_of(
    st.integers(-(2**70), 2**70),
    st.floats(),
    st.floats(width=32).map(np.float32),
    st.integers(-(2**31), 2**31 - 1).map(np.int32),
    st.booleans(),
    st.none(),
    st.text(),
    st.complex_numbers(),
    st.decimals(),
    st.fractions(),
    st.just(Hostile()),
)
_VARIANCES = st.floats(0, 100)
_GOOD = {
    'id': st.one_of(st.integers(-1, 2**31 - 1), st.integers(0, 99).map(np.int16)),
    'code': st.one_of(st.integers(0, 2**32 - 1), st.integers(0, 99).map(np.uint8)),
    'x': st.floats(-1e6, 65536),
    'y': st.one_of(st.integers(-99, 99), st.floats(0, 1, width=32).map(np.float32)),
    'semi_major': st.floats(0, 65536),
    'semi_minor': st.floats(0, 65536),
    'angle': st.floats(-6, 6),
    'confidence': st.floats(0, 1),
    'covariance': st.tuples(_VARIANCES, st.just(0), st.just(0.0), _VARIANCES),
    'family': st.sampled_from(('', 'metashape12')),
    'edge_shift': st.one_of(st.none(), st.floats(-9, 9)),
}
_BAD = st.one_of(
    NUMBERS,
    st.lists(NUMBERS, max_size=5),
    st.lists(st.floats(), min_size=4, max_size=4).map(np.array),
)


@st.composite
def targets(draw: st.DrawFn) -> Target:
    """Draw a target; none, one or two of its fields may be anything."""
    bad = draw(st.lists(st.sampled_from(list(_GOOD)), max_size=2))
    return Target(**{name: draw(_BAD if name in bad else it) for name, it in _GOOD.items()})


RESULTS = st.one_of(
    st.lists(targets(), max_size=3),
    st.lists(targets(), max_size=1),
    st.lists(NUMBERS, max_size=2),
    NUMBERS,
)
"""What detectors may return."""

_STORE = typestore()


def check_result(found: object) -> bool:
    """Check a result of a detector, and return whether it is accepted."""
    try:
        targets = checked_targets(found, 'detector')
    except ValueError as error:
        assert str(error).startswith('detector') and str(error).isprintable()
        return False
    shift = median_edge_shift(targets)
    identification = Identification(tuple(targets), edge_shift=shift)
    content = to_json(identification, 'a', GRAY.shape, 'f', 'd')
    assert len(json.loads(json.dumps(content, allow_nan=False))['targets']) == len(targets)
    draw(GRAY, identification)
    types = message_types(_STORE)
    header = bags.header(_STORE, 0)
    message = coded_target_array(identification, 'f', GRAY.shape, header, types)
    sent = bytes(_STORE.serialize_cdr(message, CODED_TARGETS))
    received = _STORE.deserialize_cdr(sent, CODED_TARGETS)
    for one, target in zip(received.targets, targets, strict=True):
        assert (one.id, one.code, one.x, one.y) == (target.id, target.code, target.x, target.y)
        assert one.covariance.tolist() == list(target.covariance)
        for name in ('semi_major', 'semi_minor', 'angle', 'confidence'):
            (single,) = struct.unpack('f', struct.pack('f', getattr(target, name)))
            assert getattr(one, name) == single
    return True


def attack_bags(count: int) -> Tally:
    """Process hostile bags of every kind."""
    with hostile_bags() as attack:
        return _tallied('bags', count, attack)


def attack_images(count: int) -> Tally:
    """Decode mutated image files."""
    random = np.random.default_rng(1)
    whole = [
        cv2.imencode(suffix, image)[1].tobytes()
        for suffix in ('.png', '.jpg', '.tif', '.bmp')
        for image in (GRAY, np.dstack([GRAY] * 3))
    ]

    def one(number: int) -> bool:
        try:
            image = decode_bytes(mutated(whole[number % len(whole)], random), 'image')
        except ValueError as error:
            assert str(error).startswith('image')
            return False
        return image.ndim == 2

    return _tallied('image files', count, one)


def _tallied(area: str, count: int, one: Callable[[int], bool]) -> Tally:
    """Try inputs by their numbers and count what becomes of them."""
    accepted = 0
    reasons: list[str] = []
    for number in range(count):
        try:
            accepted += one(number)
        except Exception:
            reasons.append(f'{number}: {traceback.format_exc()}')
    return Tally(area, count, accepted, len(reasons), tuple(reasons[:5]))


def _fuzzed(area: str, count: int, check: Callable, strategy: st.SearchStrategy) -> Tally:
    """Try what hypothesis draws; it ends with the first failure."""
    try:
        counted = fuzz.run(check, strategy, count)
    except Exception:
        return Tally(area, count, 0, 1, (traceback.format_exc(),))
    return Tally(area, counted.total(), counted[True], 0)


def run_tests(name: str) -> Tally:
    """Run the tests of a file that concern hostile input, kills and signals."""
    command = [sys.executable, '-m', 'pytest', '-q', '-p', 'no:cacheprovider', name]
    done = subprocess.run(command, capture_output=True, text=True)
    counts = {
        word: int(it) for it, word in re.findall(r'(\d+) (passed|failed|error)', done.stdout)
    }
    failed = counts.get('failed', 0) + counts.get('error', 0)
    tried = counts.get('passed', 0) + failed
    reasons = (done.stdout[-3000:],) if done.returncode else ()
    return Tally(name, tried, counts.get('passed', 0), failed or int(done.returncode > 0), reasons)


def tallies(options: argparse.Namespace) -> Iterator[Tally]:
    """Yield what became of each area."""
    if options.bags:
        yield attack_bags(options.bags)
    if options.results:
        yield _fuzzed('results of detectors', options.results, check_result, RESULTS)
    if options.messages:
        yield _fuzzed('Image messages', options.messages, fuzz.check, fuzz.images())
        compressed = fuzz.compressed_images()
        yield _fuzzed('compressed images', options.messages, fuzz.check_compressed, compressed)
    if options.images:
        yield attack_images(options.images)
    for name in TESTS if options.tests else ():
        yield run_tests(name)


def main(arguments: list[str] | None = None) -> int:
    """Attack, print a table, and return 1 if anything failed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for name in ('bags', 'results', 'messages', 'images'):
        parser.add_argument(f'--{name}', type=int, default=10_000, help='inputs; 0: none')
    parser.add_argument(
        '--tests', action=argparse.BooleanOptionalAction, default=True, help='run the tests, too'
    )
    options = parser.parse_args(arguments)
    print('| area | tried | accepted | failed |\n|---|---|---|---|')
    failed = 0
    for tally in tallies(options):
        print(f'| {tally.area} | {tally.tried} | {tally.accepted} | {tally.failed} |', flush=True)
        failed += tally.failed
        for reason in tally.reasons:
            print(reason, file=sys.stderr)
    return int(failed > 0)


if __name__ == '__main__':
    sys.exit(main())
