# SPDX-License-Identifier: Apache-2.0
"""The run's side of the cockpit: what the page is told, and what is done with its orders."""
