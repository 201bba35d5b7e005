"""Textured images without targets: grain, bricks, foliage, pebbles, text, grids of dots, rings."""

import string

import cv2
import numpy as np

SIZE = (640, 480)
"""Width and height of an image, px."""


def textured_image(seed: int) -> np.ndarray:
    """Return a textured image without targets, ndarray of uint8, shape (480, 640).

    Kinds alternate with the seed. Every other image is lit by stripes, spots or a gradient; each
    is seen obliquely, blurred and noisy.
    """
    generator = np.random.default_rng(seed)
    kinds = (_grain, _bricks, _foliage, _pebbles, _text, _dot_grid, _blots)
    return _photograph(kinds[seed % len(kinds)](generator), generator)


def lookalikes(seed: int) -> np.ndarray:
    """Return an image of rings in rings with dots, as of dials, like `textured_image`."""
    generator = np.random.default_rng(seed)
    return _photograph(_rings(generator), generator)


def rough_image(seed: int) -> np.ndarray:
    """Return 1600 x 1200 px of noise of all wavelengths, with edges of any strength."""
    generator = np.random.default_rng(seed)
    image = np.zeros((1200, 1600))
    for width in (1, 2, 4, 8, 16):
        noise = cv2.GaussianBlur(generator.normal(size=image.shape), (0, 0), width)
        image += np.where(noise > noise.std(), 1.0, 0.0) * generator.uniform(0.3, 1)
    return (40 + 200 * image / image.max()).astype(np.uint8)


def text_page(seed: int) -> np.ndarray:
    """Return a page of print, 1600 x 1200 px, line upon line, many of whose letters are round."""
    generator = np.random.default_rng(seed)
    page = np.full((1200, 1600), 235, np.uint8)
    font = int(generator.choice([cv2.FONT_HERSHEY_SIMPLEX, cv2.FONT_HERSHEY_COMPLEX]))
    scale, weight = float(generator.uniform(0.5, 1.2)), int(generator.integers(1, 3))
    letters = list('aabcddeeghmnooooprstu' + ' ' * 4 + 'OOQ0068')
    height = cv2.getTextSize('og', font, scale, weight)[0][1]
    bottom = 2 * height
    while bottom < len(page):
        line = ''.join(generator.choice(letters, 300))
        cv2.putText(page, line, (4, bottom), font, scale, 30, weight, cv2.LINE_AA)
        bottom += round(height * generator.uniform(1.3, 1.7)) + 4
    blurred = cv2.GaussianBlur(page, (0, 0), generator.uniform(0.4, 1.2))
    return _clipped(blurred + generator.normal(0, 2, page.shape))


def weave(seed: int) -> np.ndarray:
    """Return 1600 x 1200 px of woven carbon fibre in a flash, with threads like small dots."""
    generator = np.random.default_rng(seed)
    height, width = 1200, 1600
    period, lean = generator.uniform(6, 12), generator.uniform(0.3, 0.9)
    rows, columns = np.mgrid[: int(3 * height / period), : int(3 * width / period)]
    places = np.stack([columns + lean * rows, rows * generator.uniform(0.7, 1.3)], axis=-1)
    turn = generator.uniform(0, np.pi)
    turned = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    places = period * (places - places.mean(axis=(0, 1))).reshape(-1, 2) @ turned
    places += generator.normal((width / 2, height / 2), 0.06 * period, places.shape)
    inside = ((places > 0) & (places < (width - 1, height - 1))).all(axis=1)
    x, y = np.rint(places[inside]).astype(int).T
    points = np.zeros((height, width))
    points[y, x] = generator.gamma(4, 0.25, len(x))
    narrow, long = period * generator.uniform(0.1, 0.2), period * generator.uniform(0.2, 0.35)
    lying = cv2.getRotationMatrix2D((16, 16), float(generator.uniform(0, 180)), 1)
    along, across = (np.exp(-0.5 * ((np.arange(33) - 16) / of) ** 2) for of in (long, narrow))
    thread = cv2.warpAffine(np.outer(across, along), lying, (33, 33))
    cloth = cv2.filter2D(points, -1, thread)
    down, right = np.mgrid[:height, :width]
    flash = np.hypot(right - generator.uniform(0, width), down - generator.uniform(0, height))
    light = generator.uniform(10, 60) + generator.uniform(0, 600) * np.exp(-flash / 250)
    return _clipped(3 + light * (0.08 + cloth) + generator.normal(0, 1, cloth.shape))


def dot_grid(seed: int) -> np.ndarray:
    """Return an image of a regular grid of 2,000 dots, slightly turned and foreshortened."""
    generator = np.random.default_rng(seed)
    width, height = 3984, 2656
    image = np.full((height, width), 215, np.uint8)
    turn = np.sin(np.deg2rad(generator.uniform(0, 5)))
    for column in range(50):
        for row in range(40):
            x, y = 300 + 64 * column, 100 + 60 * row
            centre = (x - 0.3 * turn * y, y + 0.02 * turn * x)
            place = tuple(round(16 * float(value)) for value in centre)
            cv2.circle(image, place, 16 * 8, 40, -1, cv2.LINE_AA, shift=4)
    noise = generator.normal(0, 2, image.shape)
    return np.clip(cv2.GaussianBlur(image, (0, 0), 0.8) + noise, 0, 255).astype(np.uint8)


def _photograph(texture: np.ndarray, generator: np.random.Generator) -> np.ndarray:
    reflectance = _seen(texture, generator)
    image = 225 / 255 * np.maximum(reflectance, 10) * _light(generator)
    image = cv2.GaussianBlur(image, (0, 0), generator.uniform(0.5, 1.2))
    noise = generator.uniform(0.5, 4) * generator.standard_normal(image.shape)
    return _clipped(image + noise)


def _seen(texture: np.ndarray, generator: np.random.Generator) -> np.ndarray:
    """Return a texture in a random perspective."""
    width, height = SIZE
    corners = np.array([(0, 0), (width, 0), (width, height), (0, height)], np.float32)
    moved = corners + generator.uniform(-90, 90, (4, 2)).astype(np.float32)
    view = cv2.getPerspectiveTransform(corners, moved)
    return cv2.warpPerspective(texture, view, SIZE, borderMode=cv2.BORDER_REFLECT)


def _light(generator: np.random.Generator) -> np.ndarray:
    """Return even light, a gradient, stripes or spots."""
    x, y = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    angle, period = generator.uniform(0, np.pi), generator.uniform(8, 60)
    along = (x * np.cos(angle) + y * np.sin(angle)) / period
    across = (y * np.cos(angle) - x * np.sin(angle)) / period
    ambient = generator.choice([0.3, 0.1])
    lights = (
        np.ones_like(along),
        np.clip(0.5 + (along - along.mean()) / np.ptp(along), 0.1, 1),
        ambient + (1 - ambient) * (along % 1 < 0.5),
        ambient + (1 - ambient) * ((along % 1 - 0.5) ** 2 + (across % 1 - 0.5) ** 2 < 0.1),
    )
    choice = generator.choice(len(lights), p=[0.5, 0.1, 0.2, 0.2])
    return cv2.GaussianBlur(lights[choice].astype(np.float32), (0, 0), 1.0)


def _clipped(values: np.ndarray) -> np.ndarray:
    return np.rint(np.clip(values, 0, 255)).astype(np.uint8)


def _grain(generator: np.random.Generator) -> np.ndarray:
    """Return noise of several scales, as of plaster and rock."""
    width, height = SIZE
    total = np.zeros((height, width), np.float32)
    for octave in range(2, 8):
        side = 2**octave
        shape = (height // side + 2, width // side + 2)
        coarse = generator.standard_normal(shape).astype(np.float32)
        total += side**0.5 * cv2.resize(coarse, SIZE, interpolation=cv2.INTER_CUBIC)
    return _clipped(127 + 50 * total / total.std())


def _blots(generator: np.random.Generator) -> np.ndarray:
    """Return black and white blots, as of marble and of camouflage."""
    grain = _grain(generator)
    smooth = cv2.GaussianBlur(grain, (0, 0), generator.uniform(1, 6))
    return np.where(smooth > np.median(smooth), np.uint8(255), np.uint8(12))


def _bricks(generator: np.random.Generator) -> np.ndarray:
    wall = np.full(SIZE[::-1], 200, np.uint8)
    height, width = generator.integers(14, 50), generator.integers(20, 90)
    for row, top in enumerate(range(0, SIZE[1], int(height))):
        for left in range(-(row % 2) * int(width) // 2, SIZE[0], int(width)):
            shade = int(generator.integers(25, 128))
            bottom_right = (left + int(width) - 4, top + int(height) - 4)
            cv2.rectangle(wall, (left, top), bottom_right, shade, -1)
    return wall


def _ellipses(
    generator: np.random.Generator, count: int, aspect: tuple[float, float]
) -> np.ndarray:
    """Return ellipses that cover each other, of all shades."""
    image = np.full(SIZE[::-1], 128, np.uint8)
    for _ in range(count):
        major = 40 * generator.power(0.5) + 3
        axes = (round(major), max(round(major * generator.uniform(*aspect)), 1))
        centre = tuple(generator.integers(0, SIZE).tolist())
        turn, shade = float(generator.uniform(0, 180)), int(generator.integers(12, 256))
        cv2.ellipse(image, centre, axes, turn, 0, 360, shade, -1, cv2.LINE_AA)
    return image


def _foliage(generator: np.random.Generator) -> np.ndarray:
    return _ellipses(generator, 1200, (0.15, 0.4))


def _pebbles(generator: np.random.Generator) -> np.ndarray:
    return _ellipses(generator, 900, (0.7, 1.0))


def _text(generator: np.random.Generator) -> np.ndarray:
    page = np.full(SIZE[::-1], 255, np.uint8)
    letters = np.array(list(string.ascii_letters + string.digits + 'OOoo000888@@'))
    bottom = 10
    while bottom < SIZE[1]:
        scale = float(generator.uniform(0.4, 1.6))
        bottom += round(34 * scale)
        text, weight = ''.join(generator.choice(letters, 70)), int(generator.integers(1, 4))
        font = int(generator.choice([cv2.FONT_HERSHEY_DUPLEX, cv2.FONT_HERSHEY_COMPLEX]))
        cv2.putText(page, text, (4, bottom), font, scale, 12, weight, cv2.LINE_AA)
    return page


def _dot_grid(generator: np.random.Generator) -> np.ndarray:
    """Return a regular grid of dots, some of which are missing."""
    ground, ink = (255, 12) if generator.random() < 0.5 else (12, 255)
    image = np.full(SIZE[::-1], ground, np.uint8)
    pitch = generator.uniform(9, 40)
    radius = pitch * generator.uniform(0.18, 0.42)
    for row, y in enumerate(np.arange(0, SIZE[1], pitch)):
        for x in np.arange((row % 2) * generator.choice([0, pitch / 2]), SIZE[0], pitch):
            if generator.random() < 0.8:
                middle = (round(16 * x), round(16 * y))
                cv2.circle(image, middle, round(16 * radius), ink, -1, cv2.LINE_AA, 4)
    return image


def _rings(generator: np.random.Generator) -> np.ndarray:
    """Return rings in rings, with dots and strokes between them, as dials and tyres have."""
    image = np.full(SIZE[::-1], 255, np.uint8)
    for x in range(60, SIZE[0], 100):
        for y in range(60, SIZE[1], 100):
            radii = np.sort(generator.uniform(4, 48, 2 * generator.integers(1, 4)))[::-1]
            for index, radius in enumerate(radii):
                cv2.circle(image, (x, y), round(radius), 12 + 243 * (index % 2), -1, cv2.LINE_AA)
            count, reach = int(generator.integers(4, 16)), generator.uniform(10, 45)
            for angle in 2 * np.pi * np.arange(count) / count:
                place = (round(x + reach * np.cos(angle)), round(y + reach * np.sin(angle)))
                shade = int(generator.choice([12, 255]))
                cv2.circle(image, place, int(generator.integers(1, 5)), shade, -1, cv2.LINE_AA)
    return image
