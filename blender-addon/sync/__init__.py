# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Converts Blender's scene to plain values, and finds the edits to send when it has changed.

`matrix`, `camera`, `parts` and `edits` do not use Blender. `world`, `lights`, `materials` and `instances` read Blender's data and return
values of the scene's JSON form (docs/scene.md), together with one line for each thing that they had to leave out. `dressing` and
`shader_notes` go the other way: they make Blender's materials of such values.
"""
