"""Hostile input that several tests share: damaged bytes, and image messages of any content.

Tests draw from it with hypothesis: always the same few examples, or many other ones with
`--hypothesis-profile attack`.
"""

import re
from typing import Any

import numpy as np
from hypothesis import strategies as st

from ahf_ros.files.image_messages import ENCODINGS

Fields = dict[str, Any]
"""The fields of a message by their names."""

PAGE = 4096
SIDES = st.sampled_from([*range(12, 50), 1, 15, 16])
"""Pixels along a side of an image that is whole."""

_UNKNOWN = ('8SC1', '16SC1', '32SC1', 'MONO8', 'compressedDepth', '8UC5', '')
_SPECIAL = (np.nan, np.inf, -np.inf, 0.0, -1.0, 1e-45, 3.4e38, 1.0)
_ANY_SIZE = st.one_of(st.integers(0, 9), st.integers(0, 2**32 - 1))


def mutated(content: bytes, random: np.random.Generator) -> bytes:
    """Return content with one to three damages of any kind."""
    changed = bytearray(content)
    for _ in range(random.integers(1, 4)):
        place = int(random.integers(len(changed)))
        size = int(random.integers(1, 64))
        kind = random.integers(7)
        if kind == 0:
            changed[place] ^= 1 << int(random.integers(8))
        elif kind == 1:
            page = place // PAGE * PAGE
            changed[page : page + PAGE] = bytes(len(changed[page : page + PAGE]))
        elif kind == 2:
            del changed[max(place, 1) :]
        elif kind == 3:
            del changed[place : place + size]
        elif kind == 4:
            changed[place:place] = random.bytes(size)
        elif kind == 5:
            changed[place : place + 8] = b'\xff' * len(changed[place : place + 8])
        else:
            other = int(random.integers(len(changed)))
            changed[place : place + size] = changed[other : other + size]
        changed = changed or bytearray(b'\0')
    return bytes(changed)


_TOKENS = re.compile(rb'[\w.+-]+|\s+|[^\w\s]')
_WORDS = (
    *(b'', b'-1', b'0', b'1e400', b'-1e308', b'1e99', b'nan', b'.nan', b'.inf', b'Infinity'),
    *(b'9' * 30, b'9' * 400, b'1,5', b'1.234,5', b'0x1f', b'null', b'true', b'~', b'[', b'{'),
    *(b'"', b"'", b';', b',', b'\t', b'\n', b'#', b'&a ', b'*a', b'!!int x', b'<<', b'\0', b'%'),
    *('\ufeff'.encode(), '\u2028'.encode(), b'\xe9', b'a' * 5000, b'[' * 60, b'{a: ' * 40, b'..'),
)
_ENCODINGS = 'utf-16', 'utf-16-le', 'utf-16-be', 'utf-8-sig', 'utf-32'


def mutated_text(content: bytes, random: np.random.Generator) -> bytes:
    """Return a text with one to three other, missing, further or exchanged words."""
    words = _TOKENS.findall(content) or [b'']
    for _ in range(random.integers(1, 4)):
        place, other = (int(it) for it in random.integers(len(words), size=2))
        kind = random.integers(6)
        if kind < 2:
            words[place] = _WORDS[random.integers(len(_WORDS))]
        elif kind == 2:
            words[place] = b''
        elif kind == 3:
            words[place] *= 2
        elif kind == 4:
            words[place], words[other] = words[other], words[place]
        else:
            words[place:place] = words[other : other + 9]
    text = b''.join(words)
    if random.integers(8) == 0:
        encoding = _ENCODINGS[random.integers(len(_ENCODINGS))]
        return text.decode('utf-8', 'replace').encode(encoding)
    return text


@st.composite
def generators(draw: st.DrawFn) -> np.random.Generator:
    """Draw a generator of random numbers."""
    return np.random.default_rng(draw(st.integers(0, 2**32 - 1)))


@st.composite
def wild_images(draw: st.DrawFn) -> Fields:
    """Draw an Image whose fields know nothing of each other."""
    return {
        'encoding': draw(st.one_of(st.sampled_from([*ENCODINGS, *_UNKNOWN]), st.text(max_size=9))),
        'height': draw(_ANY_SIZE),
        'width': draw(_ANY_SIZE),
        'step': draw(st.one_of(st.integers(0, 80), _ANY_SIZE)),
        'is_bigendian': draw(st.integers(0, 255)),
        'data': draw(st.binary(max_size=400)),
    }


@st.composite
def whole_images(draw: st.DrawFn) -> Fields:
    """Draw an Image that is one, or that lacks or has a few bytes of it."""
    name = draw(st.sampled_from(list(ENCODINGS)))
    kind = np.dtype(ENCODINGS[name].kind)
    height, width = draw(SIDES), draw(SIDES)
    random = draw(generators())
    row = width * ENCODINGS[name].size
    step = row + draw(st.integers(0, 9))
    data = bytearray(random.bytes(step * height + draw(st.sampled_from([0, 0, 0, 7, 20, -1]))))
    if kind.kind == 'f' and draw(st.booleans()):
        values = random.random(len(data) // kind.itemsize).astype(kind)
        places = random.random(len(values)) < draw(st.sampled_from([0.01, 0.5, 1.0]))
        values[places] = random.choice(np.array(_SPECIAL, kind), places.sum())
        data[: values.nbytes] = values.tobytes()
    return {
        'encoding': name,
        'height': height,
        'width': width,
        'step': draw(st.sampled_from([*[step] * 8, row - 1, 0])),
        'is_bigendian': draw(st.integers(0, 1)),
        'data': bytes(data),
    }


IMAGES = st.one_of(wild_images(), whole_images())
"""The fields of messages of type Image."""
