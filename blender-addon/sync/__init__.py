# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's scene as plain values, and what to send when it changed.

`matrix`, `camera`, `parts` and `edits` know no Blender. `world`, `lights`, `materials` and `instances` read Blender's data and give
values of the scene's JSON form (docs/scene.md), together with one line for each thing that they had to leave out.
"""
