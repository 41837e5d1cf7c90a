# SPDX-License-Identifier: Apache-2.0
"""colcon build: setup.cfg says what is installed, package.xml how it is called."""

import xml.etree.ElementTree as ElementTree

from setuptools import setup

FACTS = ('name', 'version', 'description', 'license')
MANIFEST = ElementTree.parse('package.xml').getroot()

setup(**{fact: MANIFEST.findtext(fact) for fact in FACTS})
