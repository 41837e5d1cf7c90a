# SPDX-License-Identifier: Apache-2.0
"""All that is changed of MuJoCo Studio, and all of its private names that are used."""

from collections.abc import Callable
import functools
import logging
import socket
from typing import Any

from mujoco.studio import endpoints, messages, viewer_protocol, web_viewer
from mujoco.studio.web import web_server
from wasd_core.network import LOOPBACK

from mujoco_sim.viewer.drawing import PacedUi

# A page that is silent for so long [s] loses control to a page that waits for it, or comes new.
SILENT_CONTROLLER = 5.0


class _WithoutGoneBrowsers(logging.Filter):
    """
    Leaves out what asyncio says of a browser that has gone while it was sent something.

    Studio does not ask how such a sending ended, and a tab that is closed is nothing to report.
    """

    def filter(self, record: logging.LogRecord) -> bool:
        """Whether a record is of anything else."""
        error = record.exc_info[1] if record.exc_info else None
        return not isinstance(error, web_server.ConnectionClosed)


_WITHOUT_GONE_BROWSERS = _WithoutGoneBrowsers()


def patch_server(serve: Callable[..., Any]) -> None:
    """Let `serve` take the place of the server of websockets that Studio starts next."""
    # The module's own names are all that Studio leaves to set.
    web_server.serve = serve
    web_server._CONTROLLER_SILENT_KICK_SEC = SILENT_CONTROLLER
    web_viewer._print_url_banner = lambda host, port: None  # we say where it is ourselves
    logging.getLogger('asyncio').addFilter(_WITHOUT_GONE_BROWSERS)


def session_of(connection: Any) -> str:
    """Return what Studio calls the browser of a connection."""
    return str(web_server._session_id(connection))


def port_of(viewer: Any) -> int:
    """Return the port of a viewer."""
    port: int = viewer._http_port
    return port


def drop_viewer_events(handle: Any) -> None:
    """Forget what the page wants done to the world: events would gather."""
    handle._sim_endpoint.get_viewer_events()


class LocalWebViewer(web_viewer.WebViewer):  # type: ignore[misc]  # MuJoCo has no types
    """Studio's viewer, which would listen on all interfaces, made to listen on one."""

    _http_sock: socket.socket
    _http_port: int
    # The base class sets '::' before it binds; a constant in its place keeps the page private.
    _host = property(lambda self: LOOPBACK, lambda self, _: None)

    def __init__(
        self,
        config: viewer_protocol.ViewerConfig,
        endpoint: endpoints.ViewerEndpoint,
        page: Any,
    ) -> None:
        """Show a page: a plugin of Studio's with `input` and `pace`."""
        self._asked_port = config.http_port
        super().__init__(config, endpoint, plugins=[page])
        self._headless_ui: Any = PacedUi(self._headless_ui, page.input, page.pace)

    def _start_server(self) -> None:
        """
        Start the server after a first frame: in that one Studio has no fonts yet.

        A browser that connects meanwhile makes it use one, and that crashes Python.
        """
        self._headless_ui.new_frame()
        self._headless_ui.end_frame()
        self._claim_port()
        super()._start_server()

    def _claim_port(self) -> None:
        """
        Listen at once: until somebody does, two runs that start together may bind one port.

        Raises:
            OSError: the port that was asked for has gone to another.
        """
        while True:
            try:
                self._http_sock.listen()
            except OSError:
                if self._asked_port:
                    raise
                self._http_sock.close()
                self._http_sock = web_server.bind_public_socket(LOOPBACK, 0)
                self._http_port = self._http_sock.getsockname()[1]
            else:
                return

    @property
    def is_drawing(self) -> bool:
        """Whether panels are drawn in this frame; the scene is sent in any."""
        return isinstance(self._headless_ui, PacedUi) and self._headless_ui.is_drawing

    @functools.partial(messages.handler, priority=messages.Priority.INTERNAL)
    def _on_post_model(self, event: messages.PostModelEvent) -> None:
        """Serve the new model without the base class's line on stdout."""
        self._update_model()
