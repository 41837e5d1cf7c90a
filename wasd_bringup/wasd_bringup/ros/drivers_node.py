# SPDX-License-Identifier: Apache-2.0
"""The node for drivers: the topic `driver`, and an e-stop by topic or service."""

from collections.abc import Callable

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from rclpy.node import Node
from std_msgs.msg import Bool
from wasd_core.services import offer
from wasd_core.topics import LATCHED, RELIABLE

from wasd_bringup.run.drivers import DriverState


class DriversNode(Node):
    """
    Publishes on `driver` who drives one robot, and passes an e-stop on.

    `on_stop(by)` is called for true on the topic `e_stop` and by the service `~/e_stop`,
    `on_release` by the service `~/release_e_stop`: false on a topic releases nothing.
    """

    def __init__(self, namespace: str = '') -> None:
        super().__init__('drivers', namespace=namespace)
        self.on_stop: Callable[[str], None] = lambda by: None
        self.on_release: Callable[[], bool] = lambda: False
        self._told: DriverState | None = None
        self._publisher = self.create_publisher(DiagnosticStatus, 'driver', LATCHED)
        self.create_subscription(Bool, 'e_stop', self._on_topic, RELIABLE)
        offer(self, '~/e_stop', self._on_stop)
        offer(self, '~/release_e_stop', self._on_release)

    def tell(self, state: DriverState) -> None:
        """Publish who drives, where it has changed."""
        if state != self._told:
            self._told = state
            self._publisher.publish(to_status(state, self.get_namespace()))

    def _on_topic(self, message: Bool) -> None:
        if message.data:
            self.on_stop('topic e_stop')

    def _on_stop(self) -> tuple[bool, str]:
        self.on_stop('service e_stop')
        return True, 'stopped'

    def _on_release(self) -> tuple[bool, str]:
        return True, 'released: drive again' if self.on_release() else 'no stop holds'


def to_status(state: DriverState, name: str) -> DiagnosticStatus:
    """Return the message: who drives, an error while an e-stop holds; the rest as values."""
    message = DiagnosticStatus(name=f'{name}/driver'.replace('//', '/'), message=state.driver)
    message.level = DiagnosticStatus.ERROR if state.stopped_by else DiagnosticStatus.OK
    values = {
        'since': f'{state.since:.3f}' if state.driver else '',
        'right': state.right,
        'asks': ' '.join(name.replace(' ', '_') for name in state.asks),
        'stopped_by': state.stopped_by,
        'guard': state.guard,
        'last_stop_by': state.last_stop_by,
    }
    message.values = [KeyValue(key=key, value=value) for key, value in values.items()]
    return message
