"""Former places of modules: each leads to a module, with the same objects, and says so."""

import sys
import warnings
from importlib import import_module
from importlib.util import find_spec

import pytest

from ahf_ros.base.former import FORMER, present_place
from support.command_line import python
from support.networks import solution


@pytest.mark.parametrize('former', FORMER)
def test_a_former_module_leads_to_one_that_is_there(former: str) -> None:
    assert find_spec(f'ahf_ros.{FORMER[former]}') is not None
    spec = find_spec(f'ahf_ros.{former}')
    assert spec is not None and spec.origin is None, 'a module of this name is there again'


def test_names_of_a_former_module_are_the_same_objects_and_warn_where_they_are_taken() -> None:
    from ahf_ros.network.datum import Datum

    with pytest.warns(
        DeprecationWarning, match=r'orientation\.datum is ahf_ros\.network\.d'
    ) as it:
        from ahf_ros.orientation.datum import Datum as former  # type: ignore[import-not-found]
    assert former is Datum
    assert [warning.filename for warning in it] == [__file__]


def test_a_module_below_a_former_room_is_not_loaded_twice() -> None:
    module = import_module('ahf_ros.interchange.network_results')
    with pytest.warns(DeprecationWarning):
        read = module.read_network
    assert read is sys.modules['ahf_ros.network.files.network_results'].read_network


def test_what_never_was_is_not_there() -> None:
    with pytest.raises(ModuleNotFoundError, match=r'network\.nothing'):
        import_module('ahf_ros.orientation.nothing')
    with pytest.raises(ModuleNotFoundError, match='nothing'):
        import_module('ahf_ros.nothing')
    assert present_place('other.orientation') is None
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        with pytest.raises(ImportError, match='nothing'):
            from ahf_ros.orientation.datum import nothing  # noqa: F401


def test_nothing_is_loaded_for_former_names_before_they_are_used() -> None:
    program = "import sys, ahf_ros; assert 'ahf_ros.base.target' not in sys.modules"
    assert python('-c', program).returncode == 0


def test_former_names_of_a_solution_lead_to_the_present_ones_and_warn() -> None:
    made = solution()
    with pytest.warns(DeprecationWarning, match='Solution calls start state now') as it:
        assert made.start is made.state
    with pytest.warns(DeprecationWarning, match='calls Start NetworkState now') as also:
        from ahf_ros.network.solution import Start
    assert Start is type(made.state)
    assert {warning.filename for warning in (*it, *also)} == {__file__}
