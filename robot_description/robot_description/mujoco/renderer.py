# SPDX-License-Identifier: Apache-2.0
"""A robot as a MuJoCo model: tree, masses, shapes, contacts; and what renders it."""

import ctypes.util
import importlib.util
import os
from pathlib import Path

from wasd_core.errors import UserError

NO_RENDERER = 'no EGL or OSMesa library (Debian, Ubuntu: apt install libegl1 libosmesa6)'
# MUJOCO_GL's word for each library, the faster one first.
_LIBRARIES = {'EGL': 'egl', 'OSMesa': 'osmesa'}
# X11 or Wayland, where the user says which.
_GLFW_VARIANT = 'PYGLFW_LIBRARY_VARIANT'
_OFF = ('disable', 'disabled', 'off', 'false', '0')
_WINDOW = ('enable', 'enabled', 'on', 'true', '1', 'glfw', 'glx', 'cgl', 'wgl', '')
# The process that has drawn; a fork of it inherits this.
_drawn_in: list[int] = []


def _use_own_window_library() -> None:
    """
    Let mujoco import the glfw that came with it, unless the user has chosen another.

    It would start a Python to ask each that this machine has for its version.
    """
    glfw = importlib.util.find_spec('glfw')
    if glfw is not None and glfw.origin is not None:
        is_wayland = os.environ.get('XDG_SESSION_TYPE') == 'wayland'
        system = os.environ.get(_GLFW_VARIANT, '') or ('wayland' if is_wayland else 'x11')
        library = Path(glfw.origin).parent / system.lower() / 'libglfw.so'
        if library.is_file():
            os.environ.setdefault('PYGLFW_LIBRARY', str(library))


_use_own_window_library()


def find_renderer() -> str | None:
    """
    Return `egl` or `osmesa`, whichever this machine has, or None.

    MUJOCO_GL decides where the user has set it to one of them, or to off.
    """
    wanted = os.environ.get('MUJOCO_GL', '').lower()
    if wanted in _OFF:
        return None
    if wanted in _LIBRARIES.values():
        return wanted
    return next((n for lib, n in _LIBRARIES.items() if ctypes.util.find_library(lib)), None)


def why_no_renderer() -> str:
    """Return why `find_renderer` finds none."""
    wanted = os.environ.get('MUJOCO_GL', '')
    return f'MUJOCO_GL={wanted}: nothing draws' if wanted.lower() in _OFF else NO_RENDERER


def check_renderer() -> None:
    """
    Refuse a MUJOCO_GL that mujoco does not know: nothing could import it.

    Raises:
        UserError: what it is, and what is wanted.
    """
    wanted = os.environ.get('MUJOCO_GL', '').lower().strip()
    if wanted not in (*_OFF, *_WINDOW, *_LIBRARIES.values()):
        raise UserError(f'MUJOCO_GL: got {wanted!r}, wanted egl, osmesa, glfw or off')


def choose_renderer() -> bool:
    """
    Set MUJOCO_GL to what this machine has, unless the user has set it; return whether it has any.

    mujoco.Renderer needs it; mujoco reads the variable once, when it is imported for the first
    time.

    Raises:
        UserError: it does not know what the user has set.
    """
    check_renderer()
    if 'MUJOCO_GL' in os.environ:
        return os.environ['MUJOCO_GL'].lower() not in _OFF
    name = find_renderer()
    if name is not None:
        os.environ['MUJOCO_GL'] = name
    return name is not None


def begin_drawing() -> None:
    """
    Refuse to draw in a fork of a process that has drawn: EGL would wait for threads it left there.

    Raises:
        UserError: it is one; says how to start another. Or MUJOCO_GL is off.
    """
    if os.environ.get('MUJOCO_GL', '').lower() in _OFF:
        raise UserError(why_no_renderer())
    if _drawn_in and _drawn_in[0] != os.getpid():
        raise UserError(
            'a process forked from one that has drawn cannot draw: start it by the method spawn'
        )
    if not _drawn_in:
        # OSMesa joins its threads at exit, which a fork has not: it leaves before that.
        libc = ctypes.CDLL(None)
        os.register_at_fork(after_in_child=lambda: libc.on_exit(libc._exit, None))
    _drawn_in[:] = [os.getpid()]


def has_graphics_card() -> bool:
    """Whether this machine has a card that draws; those that look at its page likely have, too."""
    return any(Path('/dev').glob('dri/renderD*')) or Path('/dev/nvidia0').exists()
