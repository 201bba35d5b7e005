"""Messages of any content: each is an image or refused with a reason; no byte too far is read.

Without ROS, `decode_image` and `decode_compressed` are called, and what they return is looked at
as a detector would; with `--node`, as many messages as it says go through a real node, which has
to answer or reject each.

    python -m benchmarks.fuzz [--examples 10000] [--node 2000]
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st

from ahf_ros.imaging.image import as_gray, check_image
from ahf_ros.interchange.image_messages import ENCODINGS, decode_compressed, decode_image
from support import live

Fields = dict[str, Any]
"""The fields of a message by their names."""

NAMES = ('encoding', 'width', 'height', 'step', 'data', 'image')
"""What a reason for a refusal begins with."""

UNKNOWN = ('8SC1', '16SC1', '32SC1', 'MONO8', 'compressedDepth', '8UC5', '')
SPECIAL = (np.nan, np.inf, -np.inf, 0.0, -1.0, 1e-45, 3.4e38, 1.0)
ANY_SIZE = st.one_of(st.integers(0, 9), st.integers(0, 2**32 - 1))
SIDES = st.sampled_from([*range(12, 50), 1, 15, 16])
"""Pixels along a side of an image that is whole."""


@st.composite
def wild_images(draw: st.DrawFn) -> Fields:
    """Draw an Image whose fields know nothing of each other."""
    return {
        'encoding': draw(st.one_of(st.sampled_from([*ENCODINGS, *UNKNOWN]), st.text(max_size=9))),
        'height': draw(ANY_SIZE),
        'width': draw(ANY_SIZE),
        'step': draw(st.one_of(st.integers(0, 80), ANY_SIZE)),
        'is_bigendian': draw(st.integers(0, 255)),
        'data': draw(st.binary(max_size=400)),
    }


@st.composite
def whole_images(draw: st.DrawFn) -> Fields:
    """Draw an Image that is one, or that lacks or has a few bytes of it."""
    name = draw(st.sampled_from(list(ENCODINGS)))
    kind = np.dtype(ENCODINGS[name].kind)
    height, width = draw(SIDES), draw(SIDES)
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    row = width * ENCODINGS[name].size
    step = row + draw(st.integers(0, 9))
    data = bytearray(random.bytes(step * height + draw(st.sampled_from([0, 0, 0, 7, 20, -1]))))
    if kind.kind == 'f' and draw(st.booleans()):
        values = random.random(len(data) // kind.itemsize).astype(kind)
        places = random.random(len(values)) < draw(st.sampled_from([0.01, 0.5, 1.0]))
        values[places] = random.choice(np.array(SPECIAL, kind), places.sum())
        data[: values.nbytes] = values.tobytes()
    return {
        'encoding': name,
        'height': height,
        'width': width,
        'step': draw(st.sampled_from([*[step] * 8, row - 1, 0])),
        'is_bigendian': draw(st.integers(0, 1)),
        'data': bytes(data),
    }


@st.composite
def compressed_images(draw: st.DrawFn) -> Fields:
    """Draw a CompressedImage: a file that is whole, damaged or cut, or anything."""
    suffix = draw(st.sampled_from(['.png', '.jpg', '.tiff', '.bmp']))
    pixels = np.random.default_rng(0).integers(0, 255, (draw(SIDES), 40), np.uint8)
    data = bytearray(cv2.imencode(suffix, pixels)[1].tobytes())
    for _ in range(draw(st.integers(0, 3))):
        data[draw(st.integers(0, min(len(data) - 1, 99)))] = draw(st.integers(0, 255))
    end = draw(st.one_of(st.none(), st.integers(0, len(data))))
    whole = st.just(bytes(data[:end]))
    return {
        'format': draw(st.one_of(st.just(suffix[1:]), st.text(max_size=9))),
        'data': draw(st.one_of(whole, whole, whole, st.binary(max_size=200))),
    }


def images() -> st.SearchStrategy[Fields]:
    """Return the strategy for messages of type Image."""
    return st.one_of(wild_images(), whole_images())


def attempt(decode: Callable[[Any], np.ndarray], fields: Fields) -> np.ndarray | None:
    """Return the image that a message is taken for; None where it is refused with a reason.

    Raises
    ------
    AssertionError
        If the reason names no field.
    Exception
        Whatever else is raised.
    """
    try:
        image = decode(SimpleNamespace(**fields))
        check_image(image)
    except ValueError as error:
        assert str(error).split()[0] in NAMES, error
        return None
    gray = as_gray(image)
    assert gray.shape == image.shape
    assert np.isfinite(gray).all()
    return image


def check(fields: Fields) -> bool:
    """Check one Image, and return whether it is accepted."""
    image = attempt(decode_image, fields)
    if image is None:
        return False
    assert image.shape == (fields['height'], fields['width'])
    # Neither what lies behind the rows nor what lies behind the image is looked at.
    row = fields['width'] * ENCODINGS[fields['encoding']].size
    size = fields['step'] * fields['height']
    rows = np.frombuffer(fields['data'][:size], np.uint8).reshape(-1, fields['step']).copy()
    rows[:, row:] ^= 255
    for more in (b'', b'\xff' * 99):
        other = attempt(decode_image, {**fields, 'data': rows.tobytes() + more})
        assert other is not None
        assert np.array_equal(image, other)
    return True


def check_compressed(fields: Fields) -> bool:
    """Check one CompressedImage, and return whether it is accepted."""
    return attempt(decode_compressed, fields) is not None


def run(checked: Callable[[Fields], bool], strategy: st.SearchStrategy, examples: int) -> Counter:
    """Check so many messages, always the same ones, and return how many are accepted or not."""
    counted: Counter[bool] = Counter()

    @seed(0)
    @settings(
        max_examples=examples,
        deadline=None,
        database=None,
        phases=[Phase.generate, Phase.shrink],
        suppress_health_check=list(HealthCheck),
    )
    @given(strategy)
    def each(fields: Fields) -> None:
        counted[checked(fields)] += 1

    each()
    return counted


def through_node(graph: live.Graph, count: int) -> dict[str, int]:
    """Send so many messages of type Image to a node; return what became of them.

    Parameters
    ----------
    graph : live.Graph
    count : int

    Returns
    -------
    dict of int
        Messages that were sent, those that were answered and those that were rejected, the
        one kind as messages that came in, the other as the node counts them.
    """
    from diagnostic_msgs.msg import DiagnosticArray
    from sensor_msgs.msg import Image
    from std_msgs.msg import Header

    from ahf_ros.msg import CodedTargetArray

    drawn: list[Fields] = []
    run(lambda fields: drawn.append(fields) is None, images(), count)
    node = graph.start(
        'detector',
        *('-r', '__ns:=/fuzz', '-r', '/diagnostics:=/fuzz/diagnostics', '-p', 'queue:=lossless'),
    )
    answers = graph.listen(CodedTargetArray, '/fuzz/coded_targets', len(drawn) + 2)
    diagnostics = graph.listen(DiagnosticArray, '/fuzz/diagnostics')
    image = graph.node.create_publisher(Image, '/fuzz/image', len(drawn))
    graph.until(image.get_subscription_count)

    def told() -> dict[str, int]:
        values = {item.key: item.value for item in diagnostics[-1].status[0].values}
        return {name: int(values[name]) for name in ('received', 'answered', 'rejected')}

    graph.until(lambda: diagnostics)
    for sent, fields in enumerate(drawn, start=1):
        header = Header()
        header.stamp.sec = sent
        image.publish(Image(header=header, **fields))
    graph.until(lambda: (it := told())['answered'] + it['rejected'] == len(drawn))
    rejected = told()['rejected']
    graph.until(lambda: len(answers) == len(drawn) - rejected)
    status, log = node.end()
    assert (status, 'Traceback' in log) == (0, False), log
    return {'sent': len(drawn), 'answered': len(answers), 'rejected': rejected}


def main() -> int:
    """Check everything and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--examples', type=int, default=10000, help='messages of each type')
    parser.add_argument('--node', type=int, default=0, help='messages through a real node')
    options = parser.parse_args()
    rows = []
    for name, checked, strategy in (
        ('Image', check, images()),
        ('CompressedImage', check_compressed, compressed_images()),
    ):
        counted = run(checked, strategy, options.examples)
        rows.append((name, counted.total(), counted[True], counted[False]))
    if options.node:
        with live.opened() as graph:
            figures = through_node(graph, options.node)
        rows.append(('Image, through the node', *figures.values()))
    print('| | messages | images | refused with a reason |\n|---|---|---|---|')
    for row in rows:
        print(f'| {" | ".join(map(str, row))} |')
    return 0


if __name__ == '__main__':
    sys.exit(main())
