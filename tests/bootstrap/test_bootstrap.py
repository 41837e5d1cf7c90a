# SPDX-License-Identifier: Apache-2.0
"""What `./wasd` does before the command runs; the real installation is what `.ci/run` does."""

import os
from pathlib import Path
import pty
import re
import select
import shutil
import signal
import subprocess

import pytest
from terminals import PATIENCE

pytestmark = pytest.mark.slow

SHELLS = [shell for shell in ('sh', 'dash', 'bash', 'busybox') if shutil.which(shell)]
OLD = 'sys.version_info = (3, 9, 2)\n'
WITHOUT_VENV = "sys.modules['ensurepip'] = None\n"
BROKEN = 'sys.exit(127)\n'


@pytest.mark.parametrize('shell', SHELLS)
def test_every_shell_here_can_read_the_script(shell, checkout):
    command = [shell, 'sh'] if shell == 'busybox' else [shell]
    for path in (checkout.script, checkout.folder / 'wasd_bringup/install.sh'):
        subprocess.run([*command, '-n', str(path)], check=True)


def test_the_first_start_installs_and_then_runs_the_command_with_all_arguments(checkout):
    result = checkout.run('mbot', '--play', 'a file', '')
    assert result.returncode == 0, result.stderr
    # Standard output is the command's alone: reports and tables can be piped.
    assert result.stdout.splitlines()[:4] == [
        'argument: mbot',
        'argument: --play',
        'argument: a file',
        'argument: ',
    ]
    assert 'argument:' not in result.stderr
    assert 'wasd: making ' in result.stderr
    # A newcomer reads a few lines; all that pip does is in its log.
    assert len(result.stderr.splitlines()) <= 6
    assert 'Collecting' not in result.stderr
    assert 'Getting' not in result.stderr + result.stdout
    needed, project = checkout.calls('-m pip')
    assert needed.endswith(f'--require-hashes -r {checkout.folder}/requirements/run.txt')
    # All that is built or fetched has a hash: nothing else comes, not even what builds.
    assert project.endswith(f'--no-deps --no-build-isolation -e {checkout.folder}')
    assert '--quiet --progress-bar off' in needed  # with a log, quiet alone leaves the bars


def test_on_a_terminal_one_line_says_where_the_install_is(checkout):
    (checkout.fake / 'slow').touch()
    master, slave = pty.openpty()
    process = checkout.start('mbot', terminal=slave)
    os.close(slave)
    text = read_until(master, ' s, something', times=2)
    (checkout.fake / 'slow').unlink()
    text += read_until(master, 'argument: mbot')
    process.wait(PATIENCE)
    os.close(master)
    before, after = re.split(r'wasd: \d+ s, something', text, maxsplit=1)
    # It is written over, and gone when the next line comes.
    assert '\n' not in after.partition('wasd: compiling')[0]
    assert before.endswith('\r\x1b[K')
    assert text.partition('wasd: compiling')[0].endswith('\r\x1b[K')


def read_until(master: int, words: str, times: int = 1) -> str:
    """Return what is written on a terminal until `words` have come, so many times."""
    text = ''
    while text.count(words) < times:
        assert select.select([master], [], [], PATIENCE)[0], text
        text += os.read(master, 4096).decode()
    return text


def test_the_tests_bring_what_they_need_once(checkout):
    checkout.run()
    checkout.calls()
    result = checkout.run('test', '--quick')
    assert 'what the tests need' in result.stderr
    assert result.stdout.splitlines()[:2] == ['argument: test', 'argument: --quick']
    (pip,) = checkout.calls('-m pip')
    assert pip.endswith(f'-r {checkout.folder}/requirements/test.txt')
    again = checkout.run('test')
    assert (again.stderr, checkout.calls('-m pip')) == ('', [])
    assert checkout.run('go2').stderr == ''


def test_a_first_start_that_tests_installs_all_of_it(checkout):
    result = checkout.run('test')
    assert (result.returncode, result.stdout.splitlines()[0]) == (0, 'argument: test')
    needed, _ = checkout.calls('-m pip')
    run, test = (f'-r {checkout.folder}/requirements/{name}.txt' for name in ('run', 'test'))
    assert needed.endswith(f'--require-hashes {run} {test}')
    assert checkout.run('test').stderr == ''


def test_a_python_that_nobody_has_tried_takes_what_the_ranges_allow(checkout):
    checkout.set_locked('3.9', '3.10')
    assert checkout.run('test').returncode == 0
    asked = checkout.calls()
    (ranges,) = (call for call in asked if 'lock.py' in call)
    assert ranges.endswith('/requirements/lock.py --ranges test --without')
    pip = [call for call in asked if '-m pip' in call]
    assert (len(pip), 'hash' in pip[0]) == (2, False)
    assert pip[0].endswith(f'-r {checkout.venv}/needed.txt')
    assert (checkout.venv / 'needed.txt').read_text().startswith('range==1 ')


def test_an_installation_compiles_libraries_messages_legs_and_navigator(checkout):
    checkout.run()
    asked = ' '.join(checkout.calls())
    for what in ('compileall', 'build_interfaces', 'quadruped_sim', 'wasd_navigation'):
        assert f'-m {what}' in asked.replace('robot_description.', '')


def test_ctrl_c_ends_what_compiles_in_the_background(checkout):
    stopped = checkout.stop_while_compiling(signal.SIGINT)
    assert stopped.returncode == 130
    assert stopped.stderr.splitlines()[-1] == 'wasd: interrupted; the next start goes on'
    compiling = int((checkout.fake / 'compiling').read_text())
    with pytest.raises(ProcessLookupError):
        os.kill(compiling, 0)


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGKILL])
def test_what_was_stopped_while_compiling_compiles_again_and_keeps_what_pip_did(number, checkout):
    checkout.stop_while_compiling(number)
    checkout.calls()
    result = checkout.run('go')
    assert result.stdout.splitlines()[0] == 'argument: go'
    assert 'compiling' in result.stderr
    asked = checkout.calls()
    for what in ('compileall', 'build_interfaces', 'quadruped_sim', 'wasd_navigation'):
        assert [call for call in asked if what in call]
    assert not [call for call in asked if '-m pip' in call or '-m venv' in call]
    assert checkout.run().stderr == ''


def test_a_project_that_changed_while_it_compiled_is_installed_again(checkout):
    checkout.stop_while_compiling(signal.SIGINT)
    checkout.calls()
    (checkout.folder / 'pyproject.toml').write_text('[new]\n')
    assert 'the project has changed' in checkout.run().stderr
    assert checkout.calls('-m pip')
    assert checkout.run().stderr == ''


def test_libraries_that_cannot_be_compiled_are_one_line_and_the_log_says_why(checkout):
    (checkout.fake / 'unwritable').touch()
    result = checkout.run('go')
    assert (result.returncode, result.stdout.splitlines()[0]) == (0, 'argument: go')
    assert result.stderr.count(f"libraries not compiled, '{checkout.venv}/install.log'") == 1
    assert (checkout.venv / 'install.log').read_text().splitlines()[-1] == 'no room'


def test_the_running_command_keeps_no_later_start_from_installing(checkout):
    (checkout.fake / 'command').write_text("""#!/bin/sh
if (: >&9) 2>/dev/null; then echo locked; else echo free; fi
""")
    assert checkout.run().stdout == 'free\n'


def test_the_command_knows_what_was_typed(checkout):
    (checkout.fake / 'command').write_text('#!/bin/sh\necho "$WASD_CALLED"\n')
    assert checkout.run().stdout.strip().endswith('/wasd')


def test_without_a_compiler_everything_but_tf_is_installed(checkout):
    (checkout.fake / 'no-compiler').touch()
    result = checkout.run('mbot')
    assert (result.returncode, result.stdout.splitlines()[0]) == (0, 'argument: mbot')
    assert 'error: no compiler' in result.stderr.splitlines()
    assert checkout.run().stderr == ''


def test_help_is_the_command_s_own(checkout):
    assert 'argument: --help' in checkout.run('--help').stdout


def test_a_later_start_says_nothing_and_starts_no_other_python(checkout):
    checkout.run()
    checkout.calls()
    result = checkout.run()
    assert (result.returncode, result.stderr, checkout.calls()) == (0, '', [])


@pytest.mark.parametrize(
    'changed',
    [
        'pyproject.toml',
        'requirements/run.txt',
        'package/package.xml',
        'package/setup.cfg',
        'package/package/build_interfaces.py',
    ],
)
def test_a_changed_project_is_installed_again_into_the_same_environment(changed, checkout):
    (checkout.folder / 'package/package').mkdir()
    (checkout.folder / 'package/package/build_interfaces.py').touch()
    checkout.run()
    checkout.calls()
    with open(checkout.folder / changed, 'a') as file:
        file.write('# new\n')
    assert 'the project has changed' in checkout.run().stderr
    asked = checkout.calls()
    assert [call for call in asked if '-m pip install' in call]
    assert not [call for call in asked if '-m venv' in call]
    assert checkout.run().stderr == ''


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGKILL])
def test_an_interrupted_install_is_made_anew_by_the_next_start(number, checkout):
    first = checkout.stop_while_installing(number)
    assert first.returncode == (130 if number == signal.SIGINT else -number)
    assert first.stdout == ''
    assert (number == signal.SIGKILL) != ('the next start begins anew' in first.stderr)
    (checkout.venv / 'half a package').touch()
    second = checkout.run('go')
    assert (second.returncode, second.stdout.splitlines()[0]) == (0, 'argument: go')
    assert not (checkout.venv / 'half a package').exists()


def test_an_interrupted_reinstall_is_made_anew_too(checkout):
    checkout.run()
    (checkout.fake / 'pip-started').unlink()
    (checkout.folder / 'pyproject.toml').write_text('[new]\n')
    checkout.stop_while_installing(signal.SIGKILL)
    checkout.calls()
    assert checkout.run().returncode == 0
    assert checkout.calls('-m venv')


def test_of_two_first_starts_one_installs_and_the_other_waits_for_it(checkout):
    (checkout.fake / 'slow').touch()
    first = checkout.start('first')
    checkout.wait_for(checkout.fake / 'pip-started')
    second = checkout.start('second')
    assert 'waiting' in second.stderr.readline()
    (checkout.fake / 'slow').unlink()
    for process, name in ((first, 'first'), (second, 'second')):
        result = checkout.finish(process)
        assert (result.returncode, result.stdout.splitlines()[0]) == (0, f'argument: {name}')
    assert len(checkout.calls('-m venv')) == 1


def test_a_moved_checkout_gets_a_new_environment(checkout):
    checkout.run()
    checkout.calls()
    moved = checkout.folder.rename(checkout.folder.parent / 'moved')
    result = checkout.run(script=str(moved / 'wasd'))
    assert result.returncode == 0
    assert f'prefix={moved}/.venv ' in result.stdout
    assert checkout.calls('-m venv')


def test_an_environment_whose_python_is_gone_is_made_anew(checkout):
    checkout.run()
    (checkout.tools / 'python3').unlink()
    checkout.add_python('python3.12')
    assert checkout.run().returncode == 0
    assert (checkout.venv / 'bin/python').readlink().name == 'python3.12'


@pytest.mark.parametrize(
    ('looks', 'reason'),
    [
        (None, 'python3 is not there'),
        (OLD, 'python3 is 3.9'),
        (WITHOUT_VENV, 'python3 has no venv'),
        (BROKEN, 'python3 does not start'),
    ],
)
def test_without_a_fit_python_one_line_says_what_was_found_and_what_helps(looks, reason, checkout):
    (checkout.tools / 'python3').unlink()
    if looks is not None:
        checkout.add_python('python3', looks)
    result = checkout.run()
    assert (result.returncode, result.stdout) == (1, '')
    (line,) = result.stderr.splitlines()
    assert reason in line
    assert 'apt install python3 python3-venv' in line
    assert not checkout.venv.exists()


def test_an_unfit_python_is_passed_over_for_a_fit_one(checkout):
    checkout.add_python('python3', OLD)
    checkout.add_python('python3.13', BROKEN)
    checkout.add_python('python3.12')
    assert checkout.run().returncode == 0
    assert checkout.calls('-m venv')[0].startswith('python3.12 ')


def test_the_oldest_python_that_will_do_is_the_projects(checkout):
    (checkout.folder / 'pyproject.toml').write_text('requires-python = ">=3.99"\n')
    (line,) = checkout.run().stderr.splitlines()
    assert 'needs Python >= 3.99 with venv' in line
    assert 'python3 is 3.' in line


def test_a_python_asked_for_by_name_is_taken_or_nothing_is(checkout):
    checkout.add_python('python3.11')
    assert checkout.run(WASD_PYTHON='python3.11').returncode == 0
    assert checkout.calls('-m venv')[0].startswith('python3.11 ')
    shutil.rmtree(checkout.venv)
    result = checkout.run(WASD_PYTHON='/no such/python')
    assert result.returncode == 1
    assert '/no such/python is not there' in result.stderr


def test_a_machine_without_wheels_is_told_so(checkout):
    checkout.add_tool('uname', '#!/bin/sh\necho Linux aarch64\n')
    result = checkout.run()
    assert (result.returncode, len(result.stderr.splitlines())) == (1, 1)
    assert 'this is Linux aarch64: install ROS 2 Jazzy' in result.stderr


def test_another_ros_is_refused_by_its_name(checkout):
    result = checkout.run(ROS_DISTRO='humble')
    assert (result.returncode, len(result.stderr.splitlines())) == (1, 1)
    assert "ROS 'humble' is sourced" in result.stderr


def test_a_sourced_jazzy_brings_its_own_rclpy(checkout):
    checkout.add_tool('uname', '#!/bin/sh\necho Linux aarch64\n')
    (checkout.fake / 'rclpy').touch()
    ros = {'ROS_DISTRO': 'jazzy', 'PYTHONPATH': '/ros/python', 'AMENT_PREFIX_PATH': '/ros'}
    result = checkout.run('go2', **ros)
    assert result.returncode == 0, result.stderr
    assert 'path=/ros/python' in result.stdout
    assert f'prefix={checkout.folder}/.venv.jazzy:/ros' in result.stdout
    asked = checkout.calls()
    assert any('-m venv --system-site-packages' in call for call in asked)
    # That there are versions which fit is what tests/jazzy tries with a real pip.
    (ranges,) = (call for call in asked if 'lock.py' in call)
    assert ranges.endswith('--ranges --without ros-jazzy')
    assert not any('--require-hashes' in call for call in asked)


def test_a_sourced_pinocchio_is_used_with_the_numpy_beside_it(checkout):
    (checkout.fake / 'rclpy').touch()
    ros = checkout.folder.parent / 'ros'
    sourced = {'ROS_DISTRO': 'jazzy', 'AMENT_PREFIX_PATH': f'/overlay:{ros}'}
    assert checkout.run(**sourced).returncode == 0
    index = ros / 'share/ament_index/resource_index/packages'
    index.mkdir(parents=True)
    (index / 'pinocchio').touch()
    checkout.calls()
    # Installed later: pip's own, and the numpy that came with it, have to go.
    result = checkout.run(**sourced)
    assert (result.returncode, '0.9 GB' in result.stderr) == (0, True), result.stderr
    asked = checkout.calls()
    assert [call for call in asked if '-m venv' in call]
    (ranges,) = (call for call in asked if 'lock.py' in call)
    assert ranges.endswith('--without ros-jazzy pin')
    assert (checkout.folder / '.venv.jazzy/needed.txt').read_text().endswith('numpy==1.26.4\n')
    assert checkout.run(**sourced).stderr == ''


def test_a_jazzy_without_rclpy_is_told_what_to_install(checkout):
    result = checkout.run(ROS_DISTRO='jazzy')
    assert (result.returncode, len(result.stderr.splitlines())) == (1, 1)
    assert 'python3 cannot import rclpy' in result.stderr
    assert 'apt install ros-jazzy-rclpy' in result.stderr


@pytest.mark.parametrize(
    ('log', 'package'),
    [
        (
            'Collecting a\n  ERROR: No matching distribution found for mujoco==4.0.0\n',
            'mujoco==4.0.0',
        ),
        ('Collecting a==1 (from x)\nCollecting b>=2 (from x)\nTimed out.\n', 'b>=2'),
        ('', 'the project'),
    ],
)
def test_a_failing_pip_is_reported_by_the_package_it_failed_at(log, package, checkout):
    (checkout.fake / 'pip-error').write_text(log)
    result = checkout.run()
    assert (result.returncode, result.stdout) == (1, '')
    last = result.stderr.splitlines()[-1]
    assert f'could not install {package}:' in last
    assert f"'{checkout.venv}/install.log'" in last
    (checkout.fake / 'pip-error').unlink()
    assert checkout.run().returncode == 0


def test_a_read_only_checkout_is_told_how_to_go_on(checkout):
    elsewhere = checkout.folder.parent / 'else where'
    refused = checkout.run_read_only()
    assert (refused.returncode, len(refused.stderr.splitlines())) == (1, 1)
    assert f"cannot write to '{checkout.venv}'" in refused.stderr
    assert 'WASD_VENV=DIR' in refused.stderr
    result = checkout.run_read_only(WASD_VENV=str(elsewhere))
    assert (result.returncode, f'prefix={elsewhere} ' in result.stdout) == (0, True)


def test_a_checkout_that_became_read_only_runs_until_it_changes(checkout):
    checkout.run()
    assert checkout.run_read_only().returncode == 0
    (checkout.folder / 'pyproject.toml').write_text('[new]\n')
    refused = checkout.run_read_only()
    assert (refused.returncode, len(refused.stderr.splitlines())) == (1, 1)
    assert 'cannot write to' in refused.stderr


def test_a_folder_that_somebody_else_filled_is_left_alone(checkout):
    checkout.venv.mkdir()
    (checkout.venv / 'precious').touch()
    result = checkout.run()
    assert (result.returncode, len(result.stderr.splitlines())) == (1, 1)
    assert 'was not made by this script' in result.stderr
    assert os.listdir(checkout.venv) == ['precious']


def test_a_path_that_cannot_be_an_environment_is_refused(checkout):
    result = checkout.run(WASD_VENV='a:b')
    assert (result.returncode, len(result.stderr.splitlines())) == (1, 1)
    assert "contains ':'" in result.stderr


def test_a_relative_environment_is_found_again_from_anywhere(checkout):
    assert checkout.run(WASD_VENV='my venv').returncode == 0
    absolute = str(checkout.folder.parent / 'my venv')
    assert checkout.run(WASD_VENV=absolute).stderr == ''
    link = checkout.folder.parent / 'link'
    link.symlink_to(absolute)
    assert checkout.run(WASD_VENV=str(link)).stderr == ''


def test_a_start_through_links_or_the_path_finds_the_checkout(checkout):
    link = checkout.folder.parent / 'a link'
    link.symlink_to(Path('check out') / 'wasd')
    (checkout.tools / 'wasd').symlink_to(link)
    assert checkout.run(script=str(link)).returncode == 0
    result = subprocess.run(
        ['sh', '-c', 'wasd --help'], env=checkout.environment(), capture_output=True, text=True
    )
    assert (result.returncode, result.stderr) == (0, '')


def test_what_conda_or_another_environment_has_set_does_not_get_in(checkout):
    result = checkout.run(
        CONDA_PREFIX='/conda',
        PYTHONHOME='/conda',
        PYTHONPATH='/conda/lib',
        _ROS_WHEELS_BOOTSTRAP_COMPLETE='1',
        LD_LIBRARY_PATH='/other/lib',
    )
    assert 'home= path= guard=\n' in result.stdout
    assert f'libraries= prefix={checkout.venv} usersite=1\n' in result.stdout


def test_libraries_that_the_user_asked_for_stay(checkout):
    assert 'libraries=/my/lib ' in checkout.run(LD_LIBRARY_PATH='/my/lib').stdout


@pytest.mark.parametrize('given', [':/my/lib', '/my/lib:', '/my::/lib', ':', '::'])
def test_no_empty_part_of_a_list_stands_for_the_current_folder(given, checkout):
    kept = ':'.join(filter(None, given.split(':')))
    assert f'libraries={kept} ' in checkout.run(LD_LIBRARY_PATH=given).stdout
