"""Identifications as JSON; every line that cannot be used is named."""

import io
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ahf_ros import SceneSettings, identify
from ahf_ros.base.target import (
    DottedTarget,
    FilterState,
    Identification,
    SearchTrace,
    SquareMarker,
    Target,
    UndecodedTarget,
)
from ahf_ros.families.ring.hypotheses import CERTAIN
from ahf_ros.files.target_json import read_results, targets_from_json, to_json
from ahf_ros.prints.families import prints_in
from support.scenes import rendered

CLOCKWISE = np.array([(np.cos(it), np.sin(it)) for it in np.radians(np.arange(0, 360, 30))])
NONE = (0.0, 0.0, 0.0, 0.0)


def test_what_becomes_json_is_read_again() -> None:
    covariance = (0.1, 0.01, 0.01, 0.2)
    target = Target(7, 19, 1.25, 2.5, 20.0, 18.0, 0.3, 0.9, covariance, 'aicon14', edge_shift=-0.5)
    state = FilterState(True, 2.0, 0.5, 80.0, 1.5, 9, 1, 0.25)
    found = Identification((target,), 4, state, True, edge_shift=-0.6)
    printed = json.loads(json.dumps(to_json(found, 'in/a.png', (30, 20), 'ring12', 'ring')))
    assert targets_from_json(printed, 'record') == [target]
    assert (printed['width'], printed['height']) == (20, 30)
    assert (printed['family'], printed['mirrored']) == ('ring12', False)
    assert (printed['edge_shift'], printed['targets'][0]['edge_shift']) == (-0.6, -0.5)
    assert (printed['elapsed_s'], printed['filter']['evaluations']) == (0.25, 9)
    assert (printed['expected_ids'], printed['search'], printed['upright']) == ([], None, False)


def test_codes_say_how_they_are_read_and_are_read_without_that() -> None:
    """As printed: what is inked of `bits`, clockwise, is the code of the rendering."""
    scene = rendered(SceneSettings(width=640, height=480, targets=4, dot_radius=12, seed=3))
    found = identify(scene.image, family='metashape12')
    record = to_json(found, 'a.png', (480, 640), 'metashape12', 'ring')
    reading = {'bits': 12, 'first_bit': 'lowest', 'direction': 'counter-clockwise'}
    assert record['codes'] == {'metashape12': reading}
    assert record['reach'] == {'metashape12': 3.5}
    for item, target in zip(record['targets'], found, strict=True):
        assert (len(item['bits']), int(item['bits'], 2)) == (12, target.code)
        band = ''.join(
            '01'[int(scene.image[round(target.y + down), round(target.x + across)] < 100)]
            for across, down in 2.9 * target.semi_major * CLOCKWISE
        )
        assert item['bits'] in {band[turn:] + band[:turn] for turn in range(12)}
        del item['bits']
    del record['codes'], record['reach']
    assert targets_from_json(record, 'an older file') == list(found)


def test_codes_of_other_families_say_what_they_are() -> None:
    targets = [
        Target(4, 4, 1.0, 2.0, 3.0, 3.0, family='apriltag_36h11'),
        Target(2, 1 << 7 | 1 << 17, 1.0, 2.0, 3.0, 3.0, family='gsi'),
        Target(2, 513, 1.0, 2.0, 3.0, 3.0, family='dots'),
        Target(-1, 0, 1.0, 2.0, 3.0, 3.0),
    ]
    found = Identification(tuple(targets), prints=prints_in('auto'))
    record = to_json(found, 'a.png', (30, 20), 'auto', 'auto')
    assert {name: of['direction'] for name, of in record['codes'].items()} == {
        'gsi': 'by position',
        'dots': 'either',
    }
    assert [len(item.get('bits', '')) for item in record['targets']] == [0, 29, 10, 0]


def test_low_confidences_are_explained() -> None:
    low, high = (Target(7, 71, 1.0, 2.0, 3.0, 3.0, confidence=it) for it in (0.8, 0.99))
    found = Identification((UndecodedTarget(-1, 0, 5.0, 6.0, 2.0, 1.0, confidence=0.4), low, high))
    items = to_json(found, 'a.png', (30, 20), 'metashape12', 'ring')['targets']
    why = f'probabilities are reported from {CERTAIN} on'
    assert [item.get('doubt', '') for item in items] == ['', why, '']
    items = to_json(found, 'a.png', (30, 20), 'mine', 'mine')['targets']
    assert items[1]['doubt'] == 'mine sets a lower limit of its own'


def test_searches_and_the_reasons_of_undecoded_targets_become_json() -> None:
    dots = ((1.0, 2.0, 3.0, 2.5, 0.1), (9.0, 2.0, 3.0, 2.5, 0.1))
    targets = (
        UndecodedTarget(-1, 0, 5.0, 6.0, 2.0, 1.0, 0.0, 0.4, NONE, '', 'uncertain', 17, 'aicon14'),
        DottedTarget(7, 19, 1.25, 2.5, 20.0, 18.0, dots=dots, template_dots=1, polarity=-1),
        SquareMarker(8, 8, 1.0, 2.5, 20.0, 18.0, corners=((0.0, 1.0),) * 4, border=2),
    )
    trace = SearchTrace('found', (2, 0), (2.0, 3.0), (0.5, 0.8), (90.0, 80.0), (1.5, 2.2), (2,))
    found = Identification(targets, 2, expected_ids=(7, 17), search=trace)
    record = to_json(found, 'a.png', (30, 20), 'gsi', 'gsi', mapping={'log_offset': 0.01})
    printed = json.loads(json.dumps(record))
    assert targets_from_json(printed, 'record') == list(targets)
    assert printed['search']['discrepancies'] == [2, 0]
    assert printed['search']['reason'] == 'found'
    assert printed['expected_ids'] == [7, 17]
    assert printed['filter']['log_offset'] == 0.01


@pytest.mark.parametrize(
    ('change', 'message'),
    [
        ({'reason': 'lost'}, "reason is 'lost', accepted is one of unread, uncertain, contested"),
        ({'reason': 'unread', 'likely_id': -2}, 'target 0: likely_id is -2'),
        ({'dots': 3}, 'dots is 3'),
        ({'edge_shift': math.inf}, 'target 0: edge_shift is inf, accepted is a number'),
        ({'dots': [[1, 2, 3]]}, 'dots has .1, 2, 3., accepted are rows of 5 numbers'),
        ({'dots': [[1, 2, 3, 4, math.inf]]}, 'dots is inf'),
        ({'corners': [[1, 2, 3]]}, 'corners has .1, 2, 3., accepted are rows of 2 numbers'),
        ({'corners': [[1, 2]], 'border': 3}, 'target 0: border is 3'),
        ({'dots': [[1, 2, 3, 4, 5]], 'template_dots': 2}, 'template_dots is 2'),
    ],
)
def test_a_damaged_kind_of_target_is_named(change: Any, message: str) -> None:
    item = {'id': 1, 'x': 2.0, 'y': 3.0, **change}
    with pytest.raises(ValueError, match=message):
        targets_from_json({'targets': [item]}, 'record')


def test_results_need_only_ids_and_places(tmp_path: Path) -> None:
    lines = [
        json.dumps({'image': 'in/a.png', 'targets': [{'id': 4, 'x': 1.5, 'y': 2}]}),
        '',
        json.dumps({'image': 'b.png', 'targets': [], 'more': 1}),
    ]
    (tmp_path / 'results.jsonl').write_text('\n'.join(lines))
    results = read_results(tmp_path / 'results.jsonl')
    assert list(results) == ['a.png', 'b.png']
    (target,) = results['a.png']
    assert (target.id, target.x, target.y) == (4, 1.5, 2.0)
    assert target.family == ''


def test_results_from_standard_input(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('sys.stdin', io.StringIO('{"image": "a.png", "targets": []}\n'))
    assert read_results('-') == {'a.png': ()}


@pytest.mark.parametrize('given', [None, io.TextIOWrapper(io.BytesIO(b'\xff'), 'utf-8')])
def test_standard_input_that_is_closed_or_no_text_is_named(
    monkeypatch: pytest.MonkeyPatch, given: Any
) -> None:
    monkeypatch.setattr('sys.stdin', given)
    with pytest.raises(ValueError, match=r'^- cannot be read: '):
        read_results('-')


def result(*targets: str) -> str:
    return f'{{"image": "a", "targets": [{", ".join(targets)}]}}'


@pytest.mark.parametrize(
    ('text', 'message'),
    [
        ('{"image": ', 'line 1 is not JSON'),
        ('[' * 100_000, 'line 1 is not JSON: it is nested too deep'),
        (result(f'{{"id": {"9" * 5000}}}'), 'line 1: target 0: id is inf'),
        ('[]', 'line 1 is not an object with a list of targets'),
        ('{"image": "a", "targets": {}}', 'line 1 is not an object with a list of targets'),
        ('{"targets": []}', 'line 1: image is None, accepted is the name of a file'),
        (result('3'), 'line 1: target is 3, accepted is an object'),
        (result(f'{{"id": 1, "x": {"9" * 400}, "y": 3}}'), 'line 1: target 0: x is'),
        (result('{"id": 1, "x": 2}'), 'line 1: target 0: y is None'),
        (result('{"id": 1.5, "x": 2, "y": 3}'), 'line 1: target 0: id is 1.5'),
        (result('{"id": 1, "x": NaN, "y": 3}'), 'line 1: target 0: x is nan'),
        (
            result('{"id": 1, "x": 2, "y": 3, "family": 4}'),
            'line 1: target 0: family is 4, accepted is a printable text',
        ),
        (f'{result()}\n{{"image": "b/a", "targets": []}}', 'line 2: a was on'),
    ],
)
def test_results_that_cannot_be_used_are_named(tmp_path: Path, text: Any, message: str) -> None:
    (tmp_path / 'results.jsonl').write_text(text)
    with pytest.raises(ValueError, match=message) as caught:
        read_results(tmp_path / 'results.jsonl')
    assert str(tmp_path / 'results.jsonl') in str(caught.value)
