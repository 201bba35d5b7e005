"""YAML in bounds: plain values with their lines, and nothing that grows or runs."""

import math

import pytest

from ahf_ros.base.parsed_yaml import parsed_yaml

VALUES = {
    'null': None, '~': None, 'true': True, 'False': False, 'yes': 'yes', '017': 17, '-3': -3,
    '0x1F': 31, '0o17': 15, '0b101': 5, '1_000': '1_000', '1e3': 1000.0, '.5': 0.5, '1.': 1.0,
    '.inf': math.inf, '-.inf': -math.inf, "'1'": '1', '"\\u00e9"': 'é', '1.2.3': '1.2.3',
    '-': None,
}  # fmt: skip
"""Scalars and what they are in YAML 1.2."""

REFUSED = {
    'a tag': (
        'a: 1\nb: !!int "1"\n',
        "line 2: the tag 'tag:yaml.org,2002:int', accepted are none",
    ),
    'a tag of Python': ('!!python/object/apply:os.system [ls]', 'line 1: the tag'),
    'an alias': ('a: &x [1]\nb: *x\n', 'line 2: an alias stands'),
    'a merge': ('<<: {a: 1}\n', "line 1: a key is '<<'"),
    'a list as a key': ('? [1]\n: 2\n', r'a key is \[1?\], accepted is a text'),
    'a key twice': ('a: 1\na: 2\n', "line 2: the key 'a' is there twice"),
    'two documents': ('a: 1\n---\nb: 1\n', 'line 2: a second document begins'),
    'depth': ('[' * 10_000, 'line 1: it is nested too deep, accepted are 20 levels'),
    'many values': (f'[{"1, " * 60_000}]', 'there are over 50000 values'),
    'no YAML': ('a: [1, 2\nb: 3\n', r'line \d: .*; accepted is JSON or YAML'),
    'a character': ('a: \x00\n', 'neither JSON nor YAML'),
}


@pytest.mark.parametrize('text', VALUES)
def test_scalars_are_those_of_the_core_schema(text: str) -> None:
    (found,) = parsed_yaml(f'[{text}]' if text != '-' else '-', 'text')
    assert found == VALUES[text]
    assert type(found) is type(VALUES[text])


def test_lines_of_all_values_are_known() -> None:
    found = parsed_yaml('# comment\na: 1\nb:\n  - 2\n\n  - {c: 3}\n', 'text')
    assert found == {'a': 1, 'b': [2, {'c': 3}]}
    assert found.lines == {'a': 2, 'b': 3}
    assert found['b'].lines == [4, 6]
    assert found['b'][1].lines == {'c': 6}
    assert parsed_yaml('', 'text') is None


@pytest.mark.parametrize('name', REFUSED)
def test_what_is_refused_has_its_line(name: str) -> None:
    text, message = REFUSED[name]
    with pytest.raises(ValueError, match=message) as error:
        parsed_yaml(text, 'file.yaml')
    assert str(error.value).startswith('file.yaml')


def test_aliases_count_as_often_as_they_are_there() -> None:
    assert parsed_yaml('a: &x [1, 2]\nb: *x\n', 'text', aliases=True) == {'a': [1, 2], 'b': [1, 2]}
    lines = ['a0: &a0 [1, 2]']
    lines += [f'a{n}: &a{n} [{", ".join([f"*a{n - 1}"] * 9)}]' for n in range(1, 9)]
    with pytest.raises(ValueError, match='there are over 1000 values'):
        parsed_yaml('\n'.join(lines), 'text', 1000, aliases=True)
    with pytest.raises(ValueError, match='an alias stands'):  # for what it is in
        parsed_yaml('a: &a [*a]', 'text', aliases=True)
