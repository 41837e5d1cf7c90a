# SPDX-License-Identifier: Apache-2.0
"""No browser comes to a page before its first frame is over, nor to a port that is another's."""

import socket

from mujoco.studio import web_viewer
from mujoco_sim.viewer import studio
import pytest
from wasd_core.network import LOOPBACK


class Ui:
    """Studio's panels, which have no fonts before a frame is over."""

    def __init__(self, seen):
        self._seen = seen

    def new_frame(self):
        self._seen.append('frame begins')

    def end_frame(self):
        self._seen.append('frame is over')


def bound(port=0):
    """Return a socket on a port that another may be bound to as long as nobody listens."""
    sock = socket.socket()
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    sock.bind((LOOPBACK, port))
    return sock


@pytest.fixture
def viewer(monkeypatch):
    """Return a viewer that has yet to begin, and what happens then."""
    seen = []
    monkeypatch.setattr(
        web_viewer.WebViewer, '_start_server', lambda _: seen.append('browsers may come')
    )
    viewer = studio.LocalWebViewer.__new__(studio.LocalWebViewer)
    viewer._headless_ui = Ui(seen)
    viewer._http_sock, viewer._asked_port = bound(), 0
    yield viewer, seen
    viewer._http_sock.close()


def test_the_first_frame_is_over_before_a_browser_can_come(viewer):
    begins, seen = viewer
    begins._start_server()
    assert seen == ['frame begins', 'frame is over', 'browsers may come']


@pytest.mark.parametrize('is_asked', [False, True])
def test_a_port_that_another_run_was_faster_to_listen_on(viewer, is_asked):
    begins, seen = viewer
    port = begins._http_sock.getsockname()[1]
    with bound(port) as other:
        other.listen()
        begins._asked_port = port if is_asked else 0
        if is_asked:
            with pytest.raises(OSError, match='in use'):
                begins._start_server()
            assert 'browsers may come' not in seen
        else:
            begins._start_server()
            assert begins._http_port not in (0, port)
            assert begins._http_sock.getsockname() == (LOOPBACK, begins._http_port)
