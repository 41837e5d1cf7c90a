# SPDX-License-Identifier: Apache-2.0
"""The panels Robot and World: stop, states, choices, the speed of time; another robot or world."""

from mujoco.studio.dear_imgui import dear_imgui as imgui

from wasd_cockpit import style
from wasd_cockpit.link import Choice, Order, Setting, Snapshot
from wasd_cockpit.panels.page_panel import PageState
from wasd_cockpit.widgets import columns

_ENTER = int(imgui.InputTextFlags.EnterReturnsTrue.value)
_HEIGHT = 24.0
STOP_LABEL = '\uf05e  E-STOP'
RELEASE_LABEL = 'release E-STOP'
# Icons of the font that Studio has.
_PAUSE, _RUN, _STEP, _RESET = '\uf04c', '\uf04b', '\uf051', '\uf0e2'


class Robot:
    """Gives the orders that are not motion."""

    def draw(self, page: PageState, snapshot: Snapshot) -> None:
        """Draw it in the window that is open."""
        self._draw_stop(page, snapshot)
        if len(snapshot.robots) > 1:
            self._draw_robots(page, snapshot)
        if snapshot.choices:
            page.widgets.heading('STATE')
            self._draw_choices(page, snapshot.choices)
        for setting in snapshot.settings:
            self._draw_setting(page, setting)
        self._draw_speed(page, snapshot)
        for fact in snapshot.facts:
            page.widgets.words(fact, style.DIM)

    def _draw_stop(self, page: PageState, snapshot: Snapshot) -> None:
        widgets, order = page.widgets, page.link.order
        width = imgui.GetContentRegionAvail().x
        if widgets.button('e-stop', STOP_LABEL, (width, 30.0), fill=style.ALARM, at_once=True):
            order(Order('e-stop'))
        if snapshot.stopped_by and widgets.button('end e-stop', RELEASE_LABEL, (width, _HEIGHT)):
            order(Order('end e-stop'))
        third = columns(3)
        is_paused = snapshot.is_paused
        label = f'{_RUN}  run' if is_paused else f'{_PAUSE}  pause'
        if widgets.button('pause', label, (third, _HEIGHT)):
            order(Order('pause', value=float(not is_paused)))
        imgui.SameLine()
        refusal = '' if is_paused else 'pause first'
        if widgets.button('step', f'{_STEP}  step', (third, _HEIGHT), refusal=refusal):
            order(Order('step'))
        imgui.SameLine()
        if widgets.button('reset', f'{_RESET}  reset', (third, _HEIGHT)):
            order(Order('reset'))

    def _draw_robots(self, page: PageState, snapshot: Snapshot) -> None:
        width = columns(len(snapshot.robots))
        for index, name in enumerate(snapshot.robots):
            if index:
                imgui.SameLine()
            is_on = index == snapshot.robot
            if page.widgets.toggle(f'robot {name}', name, is_on, (width, _HEIGHT)):
                page.link.order(Order('robot', name))

    def _draw_choices(self, page: PageState, choices: tuple[Choice, ...]) -> None:
        across = 2 if page.layout.is_desk else 3
        width = columns(across)
        for index, choice in enumerate(choices):
            if index % across:
                imgui.SameLine()
            if page.widgets.button(
                choice.name,
                choice.name,
                (width, _HEIGHT),
                fill=style.COMMAND if choice.is_on else None,
                refusal='' if choice.is_on else choice.refusal,
            ):
                page.link.order(choice.order)

    def _draw_setting(self, page: PageState, setting: Setting) -> None:
        page.widgets.heading(setting.name.upper())
        width = columns(min(len(setting.options), 3))
        for index, option in enumerate(setting.options):
            if index % 3:
                imgui.SameLine()
            is_on = option == setting.chosen
            if page.widgets.button(
                f'{setting.name} {option}',
                option,
                (width, _HEIGHT),
                fill=style.COMMAND if is_on else None,
                refusal='' if is_on else setting.refusal,
            ):
                page.link.order(Order('choose', f'{setting.name}={option}'))

    def _draw_speed(self, page: PageState, snapshot: Snapshot) -> None:
        imgui.Spacing()
        width = columns(2)
        imgui.SetNextItemWidth(width)
        changed, speed = imgui.InputFloat('##speed', snapshot.speed, 0.1, 0.5, 'x %.2f', _ENTER)
        page.widgets.note_field('speed')
        if imgui.IsItemHovered():
            imgui.SetTooltip('speed of time; 0 is as fast as possible')
        # The button for slower time does not step to 0; 0 is typed.
        is_step = imgui.IsMouseDown(0) or imgui.IsMouseReleased(0)
        if changed and (speed > 0.0 or not is_step):
            page.link.order(Order('speed', value=speed))
        imgui.SameLine()
        wanted = snapshot.speed or max(snapshot.pace, 1e-9)
        share = min(max(snapshot.pace / wanted, 0.0), 1.0)
        size = imgui.Vec2(width, imgui.GetFrameHeight())
        imgui.ProgressBar(share, size, f'reached x {snapshot.pace:.2f}')


class World:
    """Chooses a robot and a world; only `restart` applies the choice."""

    def __init__(self) -> None:
        self._chosen: dict[str, str] = {}

    def draw(self, page: PageState, snapshot: Snapshot) -> None:
        """Draw it in the window that is open."""
        start = snapshot.start
        now = {'robot': start.robot, 'world': start.world}
        for what, options in (('robot', start.robots), ('world', start.worlds)):
            page.widgets.heading(what.upper())
            self._draw_options(page, what, options, now[what])
        chosen = {**now, **self._chosen}
        same = '' if chosen != now else 'this is the present run: choose another robot or world'
        imgui.Spacing()
        if page.widgets.button(
            'restart',
            'restart',
            (columns(1), 28.0),
            fill=style.COMMAND if chosen != now else None,
            refusal=start.refusal or same,
        ):
            page.link.order(Order('start', f'{chosen["robot"]} {chosen["world"]}'))
        page.widgets.words(start.words(chosen['robot'], chosen['world']), wrapped=True)
        why = start.refusal or 'This run ends; the page comes back by itself.'
        page.widgets.words(why, style.DIM, wrapped=True)

    def _draw_options(
        self, page: PageState, what: str, options: tuple[str, ...], now: str
    ) -> None:
        width = columns(3)
        for index, option in enumerate(options):
            if index % 3:
                imgui.SameLine()
            is_on = option == self._chosen.get(what, now)
            # Of a file its name, which tells most.
            label = option.rpartition('/')[2]
            if page.widgets.toggle(f'next {what} {option}', label, is_on, (width, _HEIGHT)):
                self._chosen[what] = option
