import pytest

from ahf_ros.base.settings.nested import flat_parameters
from ahf_ros.nodes import start
from ahf_ros.nodes.interfaces import NODES


@pytest.fixture(autouse=True)
def no_signals(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave the signals of this process alone."""
    monkeypatch.setattr(start, 'signalled', lambda: 0)


@pytest.mark.parametrize('node', NODES)
def test_help_names_topics_services_and_parameters(
    node: str, capsys: pytest.CaptureFixture
) -> None:
    about = NODES[node]
    assert start.start(node, ['--help']) == 0
    text = capsys.readouterr().out
    assert about.purpose in text
    assert f'/{node}' in text
    words = text.split()
    for it in about.interfaces:
        assert it.name in words
        assert it.kind in text
    parameters = {item.name for item in flat_parameters(about.settings)}
    assert set(about.usual) <= parameters & set(words)
    assert max(map(len, text.splitlines())) < 100


def test_every_node_has_help() -> None:
    assert set(NODES) == set(start.NODES)


def test_help_is_asked_for_before_the_arguments_of_ros(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(start.NODES, 'detector', 'json:Node')  # is not there
    with pytest.raises(AttributeError):
        start.start('detector', ['--ros-args', '-r', 'image:=x', '-h'])
