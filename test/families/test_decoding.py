"""One dynamic program over word and cover, on evidence that is written down."""

from dataclasses import replace

import numpy as np
import pytest

from ahf_ros.families.ring.decoding import Words, bits_at, decode
from ahf_ros.families.ring.likelihood import SURPRISES, Evidence
from ahf_ros.prints.ring import FAMILY_NAMES, RingPrint, canonical, family

CODE = family('metashape12')
PER_SECTOR = 10
ANGLES = CODE.bits * PER_SECTOR
FOR, AGAINST = 1.9, -5.0  # of a reading, for what is there and for what is not


def seen(marked: np.ndarray, weight: float = 1.0) -> Evidence:
    """Return the evidence of bands that show marks at some angles, shape (k, m)."""
    there, absent = (np.float32(weight * of / 2) for of in (FOR, AGAINST))  # of either half
    count, halves = len(marked), np.stack([marked, marked], axis=1)
    return Evidence(
        looks=np.stack([np.where(halves ^ ink, there, absent) for ink in (True, False)], axis=2),
        typical=np.zeros((count, 2, 2, marked.shape[1]), np.float32),
        weight=np.full(count, weight, np.float32),
        dot=np.zeros(count, np.float32),
        lit=np.full(count, SURPRISES[0], np.float32),
        covered=np.zeros(halves.shape, bool),
        blur=np.full(count, 0.2),
    )


def of_word(word: int, phase: int = 0, code: RingPrint = CODE) -> np.ndarray:
    """Return where a band shows marks, shape (1, m)."""
    return bits_at(np.array([word]), np.array([phase]), PER_SECTOR, code)


def hidden_at(clear: Evidence, covered: slice | np.ndarray) -> Evidence:
    """Return evidence against paper and ink at some angles."""
    looks = clear.looks.copy()
    looks[..., covered] = -2.0
    return replace(clear, looks=looks)


def read(evidence: Evidence, overhang: float = 0.0, code: RingPrint = CODE) -> Words:
    return decode(evidence, np.full(len(evidence.weight), overhang), code)


WORD = of_word(CODE.word(30))


@pytest.mark.parametrize('name', FAMILY_NAMES)
@pytest.mark.parametrize('phase', [0, 7])
def test_clear_evidence_is_the_word_and_no_other_thing(name: str, phase: int) -> None:
    code = family(name)
    word = code.word(23)
    found = read(seen(of_word(word, phase, code)), 0.0, code)
    assert canonical(found.words, code)[1].tolist() == [23]
    turn = found.starts - 2 * np.pi * phase / (code.bits * PER_SECTOR)
    assert np.cos(turn * code.bits) == pytest.approx(1)  # in any rotation
    assert found.seen == pytest.approx(FOR * code.bits * PER_SECTOR, rel=0.06)
    # The nearest other word differs in two sectors, which something would have to cover.
    assert 15 < found.margin[0] < 20 * (FOR - AGAINST)
    assert found.marked[0] > found.seen[0] / 4
    assert found.coded[0] > -6  # arcs of any length are the same ones, but for a border
    assert not found.hidden.any()


def test_what_is_covered_is_found_and_says_nothing_about_the_word() -> None:
    covered = slice(43, 58)
    clear = seen(WORD)
    evidence = hidden_at(clear, covered)
    found, whole = read(evidence), read(clear)
    assert (found.words, found.starts) == (whole.words, whole.starts)
    assert np.flatnonzero(found.hidden[0]).tolist() == list(range(120))[covered]
    # What is not seen, and the price of a cover, but not what lies on the band.
    lost = whole.seen[0] - found.seen[0] - whole.seen[0] / ANGLES * 15
    assert 4 < lost < 10
    assert found.margin[0] < whole.margin[0]


@pytest.mark.parametrize('start', range(0, ANGLES, 17))
def test_a_cover_may_lie_across_the_first_angle(start: int) -> None:
    clear = seen(WORD)
    borders = np.any([np.roll(WORD, step) != WORD for step in range(-2, 3)], axis=0)
    covered = (np.arange(12) + start) % ANGLES
    evidence = hidden_at(clear, covered)
    found = read(evidence)
    assert canonical(found.words, CODE)[1].tolist() == [30]
    # What may be a border of a sector is neither paper nor ink in any case.
    hidden, at_borders = (set(np.flatnonzero(of).tolist()) for of in (found.hidden[0], borders))
    assert set(covered.tolist()) - at_borders <= hidden <= set(covered.tolist())


def test_two_ids_that_differ_below_a_cover_are_a_draw() -> None:
    one, other = 0b000001011111, 0b000001011001  # apart in two sectors
    differ = (of_word(one) != of_word(other))[0]
    covered = hidden_at(seen(of_word(one)), differ)
    found = read(covered)
    assert found.hidden[0, differ].mean() > 0.8
    assert found.margin[0] < 1
    # What is expected wins a draw and nothing more.
    expected = frozenset({CODE.number(other)})
    drawn = decode(covered, np.zeros(1), CODE, expected)
    assert canonical(drawn.words, CODE)[1].tolist() == [CODE.number(other)]
    clear = decode(seen(of_word(one)), np.zeros(1), CODE, expected)
    assert canonical(clear.words, CODE)[1].tolist() == [CODE.number(one)]


def test_bare_paper_is_no_target() -> None:
    found = read(seen(np.zeros((1, ANGLES), bool)))
    assert found.marked[0] <= 0
    one_mark = read(seen(of_word(1)))
    assert one_mark.margin[0] < 3  # what looks like paper may cover marks of many words


def test_arcs_of_any_length_are_no_word() -> None:
    angles = np.arange(ANGLES)
    arcs = np.isin(angles, [*range(5, 20), *range(32, 46), *range(57, 73), *range(88, 103)])
    found = read(seen(arcs[None]))
    assert found.coded[0] < -20


def test_the_dot_speaks_for_a_target_and_not_for_a_word() -> None:
    clear = seen(WORD)
    spoken = replace(clear, dot=np.array([7.0], np.float32))
    silent, found = read(clear), read(spoken)
    assert found.marked[0] == pytest.approx(silent.marked[0] + 7)
    assert found.margin == silent.margin
    assert found.coded == silent.coded


def test_one_reading_never_says_more_than_its_share() -> None:
    clear = seen(WORD)
    looks = clear.looks.copy()
    looks[0, :, 0, 3] = -1000.0 if looks[0, 0, 0, 3] > 0 else 1000.0
    found = read(replace(clear, looks=looks))
    assert canonical(found.words, CODE)[1].tolist() == [30]
    assert read(clear).seen[0] - found.seen[0] < 7


def test_readings_that_are_alike_count_less() -> None:
    full, half = read(seen(WORD)), read(seen(WORD, 0.5))
    assert half.words == full.words
    assert half.seen == pytest.approx(full.seen / 2, rel=0.03)


@pytest.mark.parametrize('overhang', [-2.0, 2.0])
def test_ink_that_has_grown_is_longer_along_the_band(overhang: float) -> None:
    turned = [np.roll(WORD, step, axis=1) for step in range(-2, 3)]
    grown = (np.any if overhang > 0 else np.all)(turned, axis=0)
    assert canonical(read(seen(grown), overhang).words, CODE)[1].tolist() == [30]
    assert read(seen(grown), overhang).seen[0] > read(seen(grown)).seen[0] + 10
    assert read(seen(WORD)).seen[0] > read(seen(WORD), overhang).seen[0] + 10


def test_bands_do_not_touch_each_other() -> None:
    marked = [of_word(CODE.word(number), phase) for number, phase in ((5, 0), (90, 8), (161, 3))]
    marked.insert(1, np.zeros((1, ANGLES), bool))
    evidence = seen(np.concatenate(marked))
    together = read(evidence)
    for index in range(len(marked)):
        alone = read(evidence.select([index]))
        for name in ('words', 'starts', 'marked', 'coded', 'seen', 'margin'):
            # Of words at a draw, others compete.
            of_it = pytest.approx(getattr(alone, name)[0], rel=0.1, abs=5)
            assert getattr(together, name)[index] == of_it


def test_no_band_no_word() -> None:
    found = read(seen(np.zeros((0, ANGLES), bool)))
    assert found.words.shape == found.margin.shape == (0,)
    assert found.hidden.shape == (0, ANGLES)


def test_what_is_typical_of_marks_and_of_paper_adds_up_along_a_word() -> None:
    clear = seen(WORD)
    paper, ink = np.full_like(clear.paper, 0.5), np.full_like(clear.ink, 1.0)  # of either half
    found = read(replace(clear, typical=np.stack([paper, ink], axis=2)))
    of_angles = np.where(WORD, 2.0, 1.0)
    assert found.typical == pytest.approx((5 * np.tanh(of_angles / 5)).sum(), rel=0.02)
    assert not read(clear).typical.any()  # where no edges were given
