# SPDX-License-Identifier: Apache-2.0
"""A look into the running ROS graph, and a word into it: topics, echo, hz, pub, call, params."""
