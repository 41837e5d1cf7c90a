# SPDX-License-Identifier: Apache-2.0
"""
Benchmark of both robots in one world, and of recordings.

Each robot must be commanded as it is when it runs alone with its own keys: then no command
crossed. What is recorded must be what the report says.
"""

from collections.abc import Callable
import json
from pathlib import Path
import random
import subprocess
import tempfile
from typing import Any

from environment import alone
from mbot_accuracy import run_quietly, WASD
from table import Row
from wasd_bringup.tools.recording.reader import BagReader

DURATION = 60.0
# After a turn of this long [s] the other robot is driven.
SHORTEST, LONGEST = 0.5, 1.5
GO2_KEYS = ('w*4', 's*4', 'a*3', 'd*3', 'j*3', 'l*3')
MBOT_KEYS = ('i*15', ',*15', 'j*10', 'l*10', 'u*15', 'o*15', 'k')


def interleaved(seed: int) -> tuple[str, str, str]:
    """Return a key script that takes turns, and the parts of it for the Go2 and for mbot."""
    chance = random.Random(seed)
    alone = {'go2': ['0.2 2', '3.2 4'], 'mbot': []}
    together = [*alone['go2'], '5 TAB']
    time, name = 5.0, 'mbot'
    while time < DURATION - 4.0:
        end = time + chance.uniform(SHORTEST, LONGEST)
        keys = chance.choice(MBOT_KEYS if name == 'mbot' else GO2_KEYS)
        lines = [f'{time + 0.02:.3f} {keys}']
        if name == 'go2':
            # It would go on for ever: its sticks stay where they are.
            lines.append(f'{end - 0.05:.3f} SPACE')
        alone[name] += lines
        together += [*lines, f'{end:.3f} TAB']
        time, name = end, 'go2' if name == 'mbot' else 'mbot'
    return '\n'.join(together), '\n'.join(alone['go2']), '\n'.join(alone['mbot'])


def run(folder: Path, command: str, keys: str, *words: str) -> dict[str, Any]:
    """Run a command on a key script at full speed and return its report."""
    (folder / 'keys').write_text(keys)
    report = folder / 'report.json'
    fixed = ['--play', str(folder / 'keys'), '--duration', str(DURATION), '--speed', '0']
    run_quietly([command, *fixed, '--report', str(report), *words])
    loaded: dict[str, Any] = json.loads(report.read_text())
    return loaded


def crossings(folder: Path, seed: int) -> tuple[dict[str, Any], float]:
    """Return how many samples of a command differ from those alone, and the real-time factor."""
    script, *parts = interleaved(seed)
    both = run(folder, 'both', script)
    trial: dict[str, Any] = {'seed': seed, 'falls': both['robots']['go2']['falls']}
    for name, keys in zip(('go2', 'mbot'), parts, strict=True):
        alone = run(folder, name, keys)['samples']
        together = both['robots'][name]['samples']
        pairs = zip(
            zip(alone['command'], alone['state'], strict=True),
            zip(together['command'], together['state'], strict=True),
            strict=True,
        )
        trial[name] = sum(one != other for one, other in pairs)
        trial[f'{name}_moving'] = sum(any(command) for command in together['command'])
    return trial, both['real_time_factor']


def recording(folder: Path) -> list[Row]:
    """Record a walking Go2; compare the recording with the report, and drive it again."""
    path = folder / 'run.mcap'
    _, keys, _ = interleaved(1)
    report = run(folder, 'go2', keys, '--record', str(path))
    counts = {topic.name: topic.messages for topic in BagReader(path).topics}
    samples = len(report['samples']['t'])
    names = ('/ground_truth/odom', '/odom', '/joint_states', '/imu/data', '/foot_contacts')
    lost = sum(abs(samples - counts.get(name, 0)) for name in names)
    again = subprocess.run(
        [*WASD, 'replay', str(path), '--drive'],
        env=alone(),
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
    )
    factor = report['real_time_factor']
    return [
        Row(
            what='Go2 recorded for 60 s, messages lost',
            measured=f'{lost} of {len(names) * samples}',
            must='0',
            passed=lost == 0,
            trials=[counts],
        ),
        Row(
            what='... its real-time factor, --speed 0',
            measured=f'{factor:.1f}',
            must='>= 1',
            passed=factor >= 1.0,
            trials=[{'value': factor}],
        ),
        Row(
            what='... driven again, poses identical',
            measured=again.stdout.partition(' recorded')[0] or 'it broke',
            must='all',
            passed=again.returncode == 0,
            trials=[{'said': again.stdout.strip()}],
        ),
    ]


def measure(quick: bool, note: Callable[[str], None]) -> list[Row]:
    """Return the rows of both robots and of recordings."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        trials, factors = [], []
        for seed in range(1 if quick else 3):
            note(f'both: seed {seed}')
            trial, factor = crossings(folder, seed)
            trials.append(trial)
            factors.append(factor)
        note('recording')
        rows = recording(folder)
    crossed = sum(trial['go2'] + trial['mbot'] for trial in trials)
    checked = round(2 * len(trials) * DURATION * 50)
    slowest = min(factors)
    return [
        Row(
            what='both, 60 s by turns: samples of commands that crossed',
            measured=f'{crossed} of {checked}',
            must='0',
            passed=crossed == 0,
            trials=trials,
        ),
        Row(
            what='... real-time factor, --speed 0',
            measured=f'{slowest:.1f}',
            must='>= 1',
            passed=slowest >= 1.0,
            trials=[{'value': factor} for factor in factors],
        ),
        *rows,
    ]
