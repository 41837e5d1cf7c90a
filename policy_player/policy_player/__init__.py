# SPDX-License-Identifier: Apache-2.0
"""A neural network as the controller: its files, observations and commands."""
