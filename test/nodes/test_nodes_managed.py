"""The node `detector` with a lifecycle, over DDS."""

from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
from sensor_msgs.msg import Image
from std_msgs.msg import Header

from ahf_ros.msg import CodedTargetArray
from ahf_ros.nodes.messages import image_message
from ahf_ros.scenes.scene import SceneSettings, render
from support.detector import DetectorProcess, overrides

TARGETS = 2
WAITING = 3
SEARCH = ('expected_targets', 50), ('max_evaluations', 5)


def state(graph: Any, node: str) -> int:
    return graph.call(GetState, f'{node}/get_state', GetState.Request()).current_state.id


def change(graph: Any, node: str, transition: int) -> bool:
    request = ChangeState.Request(transition=Transition(id=transition))
    return graph.call(ChangeState, f'{node}/change_state', request).success


@pytest.mark.lasting
def test_a_managed_node_goes_through_its_states(graph: Any) -> None:
    node, topic = '/managed/detector', '/managed/image'
    graph.start(
        'detector',
        '-r',
        '__ns:=/auto',
        *overrides(managed='true', autostart='true', always='true'),
    )
    wrong = {'min_radius': 70, 'max_radius': 60}
    given = overrides(managed='true', queue='lossless', family='metashape12', **wrong)
    detector = DetectorProcess(graph, '/managed', *given, subscribed=False)
    diagnostics = detector.diagnostics
    images = graph.node.create_publisher(Image, topic, 2 * WAITING)
    image = render(SceneSettings(width=600, height=400, targets=TARGETS)).image
    sent: list[Header] = []

    def send() -> None:
        sent.append(Header(frame_id=str(len(sent))))
        images.publish(image_message(image, sent[-1]))

    def until_answered() -> list[CodedTargetArray]:
        graph.until(lambda: len(detector.targets) == len(sent))
        assert [it.header for it in detector.targets] == sent
        return detector.targets

    assert state(graph, node) == State.PRIMARY_STATE_UNCONFIGURED
    assert not change(graph, node, Transition.TRANSITION_ACTIVATE)
    assert not change(graph, node, Transition.TRANSITION_CONFIGURE)
    assert state(graph, node) == State.PRIMARY_STATE_UNCONFIGURED
    assert detector.set(('min_radius', 0.0)) == (True, '')
    assert change(graph, node, Transition.TRANSITION_CONFIGURE)
    assert state(graph, node) == State.PRIMARY_STATE_INACTIVE
    assert graph.node.count_subscribers(topic) == 0
    refused = detector.identify(image_message(image, Header()))
    assert (refused.success, refused.message) == (
        False,
        'the node is inactive, accepted is active',
    )
    graph.until(
        lambda: diagnostics and diagnostics[-1].status[0].message == 'the node is inactive'
    )

    assert change(graph, node, Transition.TRANSITION_ACTIVATE)
    graph.until(images.get_subscription_count)
    send()
    assert len(until_answered()[0].targets) == TARGETS

    assert detector.set(*SEARCH) == (True, '')
    for _ in range(WAITING):
        send()
    received = str(len(sent))
    graph.until(lambda: detector.told('received') == received)
    assert change(graph, node, Transition.TRANSITION_DEACTIVATE)
    assert state(graph, node) == State.PRIMARY_STATE_INACTIVE
    graph.until(lambda: not images.get_subscription_count())
    assert change(graph, node, Transition.TRANSITION_ACTIVATE)
    until_answered()

    graph.until(images.get_subscription_count)
    assert change(graph, node, Transition.TRANSITION_DEACTIVATE)
    graph.until(lambda: not images.get_subscription_count())
    assert change(graph, node, Transition.TRANSITION_CLEANUP)
    assert state(graph, node) == State.PRIMARY_STATE_UNCONFIGURED
    assert detector.set(('expected_targets', 0)) == (True, '')
    assert change(graph, node, Transition.TRANSITION_CONFIGURE)
    assert change(graph, node, Transition.TRANSITION_ACTIVATE)
    graph.until(images.get_subscription_count)
    send()
    assert len(until_answered()[-1].targets) == TARGETS
    assert change(graph, node, Transition.TRANSITION_ACTIVE_SHUTDOWN)
    assert state(graph, node) == State.PRIMARY_STATE_FINALIZED
    status, errors = detector.process.end()
    assert status == 0
    assert 'Traceback' not in errors
    assert 'transition 3 ' in errors
    assert 'configure fails: min_radius is 70.0, accepted is' in errors

    assert state(graph, '/auto/detector') == State.PRIMARY_STATE_ACTIVE
    assert graph.node.count_subscribers('/auto/image') == 1
