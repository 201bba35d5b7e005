"""Nodes that may be managed: others configure, activate, deactivate and clean them up.

The states and their services follow ROS 2 (design.ros2.org/articles/node_lifecycle.html).
"""

from __future__ import annotations

import traceback
from collections.abc import Callable
from typing import Any

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.lifecycle.node import LifecycleNodeMixin

from ahf_ros.nodes.process import ProcessNode
from ahf_ros.text import printable

ACTIVE = 'active'
"""State of a node that works."""


class ManagedNode(ProcessNode, LifecycleNodeMixin):
    """A node with the steps of a lifecycle, which begins at once unless it is managed.

    Subclasses override `configure`, `activate`, `deactivate` and `cleanup`, and call `begin` when
    they are ready for the first step. A ValueError of a step is logged, and the step fails.
    """

    def __init__(self, name: str) -> None:
        # Not the mixin's, which makes the services of a managed node.
        ProcessNode.__init__(self, name)
        self._managed = False

    def begin(self, managed: bool, autostart: bool) -> None:
        """Configure and activate, or let others do it.

        Parameters
        ----------
        managed : bool
            Whether the node has the services of a managed node.
        autostart : bool
            Whether a managed node takes the first two steps itself.

        Raises
        ------
        ValueError
            If a node that is not managed cannot begin.
        """
        if not managed:
            self.configure()
            self.activate()
            return
        LifecycleNodeMixin.__init__(self, callback_group=MutuallyExclusiveCallbackGroup())
        self._managed = True
        service = self._service_change_state
        service.callback = self._without_errors(service.callback)
        if autostart and self.trigger_configure() == TransitionCallbackReturn.SUCCESS:
            self.trigger_activate()

    @property
    def state(self) -> str:
        """State of a managed node; one that is not managed is always active."""
        return self._state_machine.current_state[1] if self._managed else ACTIVE

    def configure(self) -> None:
        """Check everything and prepare to work."""

    def activate(self) -> None:
        """Begin or resume the work."""

    def deactivate(self) -> None:
        """Stop the work without losing what waits."""

    def cleanup(self) -> None:
        """Give up what was prepared, and what waits; after a failure, not all of it is there."""

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Take the step `configure`."""
        result = self._step('configure', self.configure)
        if result == TransitionCallbackReturn.FAILURE:
            self.cleanup()
        return result

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Take the step `activate`."""
        return self._step('activate', self.activate)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Take the step `deactivate`."""
        return self._step('deactivate', self.deactivate)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Take the step `cleanup`."""
        return self._step('cleanup', self.cleanup)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop the work and clean up."""
        if state.label == ACTIVE:
            self.deactivate()
        return self._step('shutdown', self.cleanup)

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Clean up after a step that failed unexpectedly; the node may be configured again."""
        if state.label == ACTIVE:
            self.deactivate()
        return self._step('error', self.cleanup)

    def _step(self, name: str, work: Callable[[], None]) -> TransitionCallbackReturn:
        try:
            work()
        except ValueError as error:
            self.get_logger().error(f'{name} fails: {printable(str(error))}')
            return TransitionCallbackReturn.FAILURE
        except Exception:
            # rclpy would say nothing.
            lines = traceback.format_exc().splitlines()
            self.get_logger().error('\n'.join(map(printable, lines)))
            return TransitionCallbackReturn.ERROR
        return TransitionCallbackReturn.SUCCESS

    def _without_errors(self, callback: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
        """Return a callback that refuses a transition instead of ending the node with an error."""

        def change(request: Any, response: Any) -> Any:
            before = self.state
            try:
                return callback(request, response)
            except RuntimeError:  # of rcl
                what = printable(request.transition.label or str(request.transition.id))
                self.get_logger().error(f'transition {what} is not possible: state is {before}')
                response.success = False
                return response

        return change
