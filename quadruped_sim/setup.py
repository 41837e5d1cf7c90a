# SPDX-License-Identifier: Apache-2.0
"""colcon build of quadruped_sim; name, version and licence come from package.xml."""

import glob
import os
import xml.etree.ElementTree as ElementTree

from setuptools import find_packages, setup

MANIFEST = ElementTree.parse('package.xml').getroot()
NAME = MANIFEST.findtext('name')

setup(
    name=NAME,
    version=MANIFEST.findtext('version'),
    description=MANIFEST.findtext('description'),
    license=MANIFEST.findtext('license'),
    packages=find_packages(include=[NAME, NAME + '.*']),
    package_data={NAME: ['**/*.xacro', '**/*.yaml', '**/*.keys', 'py.typed']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + NAME]),
        ('share/' + NAME, ['package.xml']),
        *(
            (os.path.join('share', NAME, os.path.dirname(path)), [path])
            for folder in ('config', 'launch', 'rviz')
            for path in glob.glob(folder + '/*.*')
        ),
    ],
    install_requires=['setuptools'],
    extras_require={'test': ['pytest']},
    zip_safe=False,
)
