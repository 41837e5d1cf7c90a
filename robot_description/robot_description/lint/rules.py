# SPDX-License-Identifier: Apache-2.0
"""The rules: each code, how bad it is, what it means and what to do about it."""

from enum import StrEnum
from typing import NamedTuple

from wasd_core.safe_files import Place


class Severity(StrEnum):
    """How bad a finding is."""

    ERROR = 'error'  # some usual tool refuses the robot, or it does not move as it should
    WARNING = 'warning'  # it loads, but is not what was meant
    INFO = 'info'  # worth knowing


class Rule(NamedTuple):
    """A rule; `cure` is one line, in general words."""

    code: str
    severity: Severity
    meaning: str
    cure: str


ERROR, WARNING, INFO = Severity.ERROR, Severity.WARNING, Severity.INFO

# fmt: off
RULES = {
    rule.code: rule
    for rule in (
        Rule('not-readable', ERROR, 'the file is not XML, does not expand, or may not be read',
             'follow the message'),
        Rule('xacro-warning', WARNING, 'xacro expands the file, but warns',
             'follow the message'),
        Rule('unprefixed-macro', ERROR,
             'a macro or a tag of xacro lacks its `xacro:`, so xacro copies it instead',
             'write `<xacro:NAME>`; `describe fix` does it, also in included files'),
        Rule('no-links', ERROR,
             'the robot has no links; MuJoCo loads it as an empty world without a warning',
             'call the macro that makes the links'),
        Rule('missing-name', ERROR, 'a robot, link or joint has no name', 'give it a name'),
        Rule('duplicate-name', ERROR, 'two links or two joints have the same name',
             'rename one, or include the file once'),
        Rule('unknown-link', ERROR, 'a joint names a parent or child link that is not there',
             'define the link, or correct the name'),
        Rule('two-parents', ERROR, 'a link is the child of two joints',
             'remove one of the joints'),
        Rule('several-roots', ERROR, 'the links are not one tree',
             'connect each of the named links by a joint'),
        Rule('orphan-link', ERROR, 'no joint mentions this link',
             'connect it by a joint, or remove it'),
        Rule('cycle', ERROR, 'joints run in a circle', 'remove one of its joints'),
        Rule('bad-joint', ERROR,
             'a joint has no type that URDF knows, no parent or child, or an axis of zero',
             'complete the joint'),
        Rule('bad-number', ERROR,
             'a number is missing, not a number, not finite, or too small, as a size of 0',
             'write a finite number; sizes are above 0'),
        Rule('missing-limit', ERROR,
             'a revolute or prismatic joint has no limit, or one without effort or velocity',
             'add `<limit lower upper effort velocity>`'),
        Rule('no-axis', WARNING, 'a joint that moves names no axis, so it is x (1 0 0)',
             'write the axis: `<axis xyz="0 0 1"/>`'),
        Rule('reversed-limit', ERROR, 'lower is above upper', 'exchange the two'),
        Rule('unknown-joint', ERROR,
             'a joint is named that is not there: by a transmission, a mimic, a plugin, or '
             'what a controller expects (`--expect`)',
             'rename one of the two: `describe fix --rename OLD:=NEW`'),
        Rule('mimic-circle', ERROR, 'joints mimic each other in a circle',
             'let one of them move by itself: remove its `<mimic>`'),
        Rule('floating-joint', ERROR,
             'a joint floats within the robot; only one alone on an empty root may',
             'make it fixed, or let its child be a robot of its own'),
        Rule('arbotix-joint-name', INFO, "wheel joints have arbotix's names",
             '`describe fix --rename base_l_wheel_joint:=left_wheel_joint`'),
        Rule('unknown-reference', WARNING,
             'a `<gazebo reference>` names nothing in this robot, and has no effect',
             'correct the name, or remove the tag'),
        Rule('unknown-material', WARNING, 'a material is used but not defined',
             'define it once under `<robot>`, with a colour'),
        Rule('repeated-material', ERROR, 'a visual has several materials; MuJoCo refuses the file',
             'keep the first; `describe fix` does it'),
        Rule('illegal-child', WARNING,
             'a tag of URDF stands where URDF does not look, and has no effect',
             'move it to where it belongs, or remove it'),
        Rule('unknown-tag', WARNING, 'a tag that neither URDF nor any common tool knows',
             'correct its name, or remove it'),
        Rule('unknown-attribute', INFO, 'an attribute that URDF does not know', 'remove it'),
        Rule('robot-name', WARNING,
             'the robot has the name of neither its file nor its package: is it a copy?',
             'give the robot its own name'),
        Rule('missing-mesh', ERROR, 'a mesh file is missing, and there is no replacement',
             'correct the path, or add the folder by --package-path'),
        Rule('unusable-mesh', ERROR,
             'a mesh is empty, cut off, packed, a Git LFS pointer, scaled to nothing or no mesh',
             'follow the message'),
        Rule('mesh-size', WARNING,
             'a mesh is far larger or smaller than the robot: URDF is in metres',
             'write the scale that the message says, or export the mesh in metres'),
        Rule('wrong-mesh-path', WARNING,
             'a mesh was found, but not where the path says, or only on this machine',
             'write the path that was found; `describe fix` does it'),
        Rule('foreign-mesh', WARNING,
             'a mesh belongs to another robot, in a package that package.xml does not name',
             "use the robot's own mesh, or declare the dependency"),
        Rule('no-inertials', ERROR,
             'no link has a mass: you can view the robot, but not simulate it',
             'add `<inertial>` to the links; without, `wasd mbot --mode fake` drives wheels'),
        Rule('no-mass', ERROR, 'a moving link and all links on it have no mass',
             'add `<inertial>` with mass and inertia'),
        Rule('no-inertial', WARNING,
             'a moving link has no mass, but links on it have; other programs refuse it',
             'add `<inertial>` with mass and inertia'),
        Rule('bad-mass', ERROR, 'a mass is negative, or zero on a link that moves', 'weigh it'),
        Rule('absurd-mass', WARNING, 'a link is denser than any metal, or has a million kilograms',
             'check units: kilograms and metres'),
        Rule('absurd-size', WARNING, 'a robot of less than a centimetre, or more than 30 metres',
             'check units: URDF is in metres'),
        Rule('bad-inertia', ERROR, 'an impossible inertia: not positive definite',
             'compute it from mass and shape'),
        Rule('inertia-triangle', ERROR,
             'an impossible inertia: one moment is larger than the two others together',
             'compute it from mass and shape'),
        Rule('inertia-scale', WARNING,
             'an inertia is more than 10 times off that of the shape with this mass',
             'compute it from mass and shape; check units'),
        Rule('inertia-axis', WARNING, 'a cylinder lies on one axis, its inertia on another',
             'turn the inertial, too: `<origin rpy>` as the shape has'),
        Rule('swapped-sides', WARNING,
             'left is on the right (x forward, y left: REP 103); the robot turns the wrong way',
             'exchange the signs of y; `describe fix` does it'),
        Rule('swapped-ends', WARNING, 'front is at the back (x forward: REP 103)',
             'exchange the signs of x; `describe fix` does it'),
        Rule('different-wheels', WARNING,
             'left and right wheel differ in radius, or in how far they are from the middle',
             'make them equal, or calibrate the odometry'),
        Rule('unbalanced-wheel', WARNING,
             'the centre of mass of a wheel is not on its axle: it rocks instead of rolling',
             'move `<origin>` of its `<inertial>` to the middle of the wheel'),
        Rule('blocked-wheel', WARNING,
             'a link, such as one of an arm, overlaps a driven wheel where the joints rest, and '
             'brakes it if links of one robot touch each other (in wasd only with `self_collide`)',
             'let its joint rest elsewhere: by limits that leave out 0, or by another `<origin>`'),
        Rule('bad-sensor', WARNING,
             'a lidar or camera is left out, or has its limits exchanged: the robot loads',
             'follow the message'),
        Rule('missing-footprint', WARNING,
             'two wheels drive a robot whose root is not on the ground, and no base_footprint is',
             'put one on the ground; `describe fix` does it'),
    )
}
# fmt: on


class Finding(NamedTuple):
    """A rule that a description breaks, the line, and in particular what and how to cure it."""

    rule: Rule
    place: Place
    message: str
    cure: str

    @property
    def is_error(self) -> bool:
        """Whether it is an error."""
        return self.rule.severity is Severity.ERROR

    def line(self) -> str:
        """Return it in one line, as compilers print it."""
        rule = self.rule
        return f'{self.place}: {rule.severity}: {self.message} [{rule.code}]; cure: {self.cure}'

    def record(self) -> dict[str, object]:
        """Return it as JSON has it."""
        return {
            'code': self.rule.code,
            'severity': str(self.rule.severity),
            'file': str(self.place.file),
            'line': self.place.line,
            'message': self.message,
            'cure': self.cure,
        }


def finding(code: str, place: Place, message: str, cure: str | None = None) -> Finding:
    """Return a finding of a rule; `cure` is the rule's unless something better is known."""
    rule = RULES[code]
    return Finding(rule, place, ' '.join(message.split()), cure or rule.cure)
