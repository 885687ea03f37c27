# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a user of `abuse_driver` does with the labels of a volume."""

import numpy as np

from pick_scene import SIZE

QUERIES = ("", "axon", "voxels>100", "5-8", "type:axon", "-glia 3", "voxels>", "nothing has this name")


def select(user):
    user.volume()
    table = user.bpy.context.object.pumice.table
    low = np.zeros(len(table.vertices), dtype=np.int32)
    high = low.copy()
    table.attributes["id_low"].data.foreach_get("value", low)
    table.attributes["id_high"].data.foreach_get("value", high)
    ids = [(int(h) << 32) | (int(lo) & 0xFFFFFFFF) for lo, h in zip(low, high)]
    chosen = user.random.sample(ids, user.random.randint(1, len(ids)))
    extend, toggle = (user.random.random() < 0.5 for _ in range(2))
    user.bpy.ops.pumice.labels_select(ids=", ".join(map(str, chosen)), extend=extend, toggle=toggle)


def select_any_ids(user):
    user.volume()
    user.bpy.ops.pumice.labels_select(ids=user.ids())


def search(user):
    user.volume()
    user.bpy.ops.pumice.labels_search(query=user.random.choice(QUERIES))


def select_hits(user):
    user.volume()
    user.bpy.ops.pumice.labels_select_hits(extend=user.random.random() < 0.5)


def select_group(user):
    user.volume()
    user.bpy.ops.pumice.labels_select_group(slot=user.random.randint(-1, 2), deselect=user.random.random() < 0.3)


def invert(user):
    user.volume()
    user.bpy.ops.pumice.labels_invert()


def hide(user):
    user.volume()
    user.bpy.ops.pumice.labels_hide(unselected=user.random.random() < 0.3)


def hide_by_id(user):
    user.volume()
    user.bpy.ops.pumice.labels_hide(ids=user.ids())


def isolate(user):
    user.volume()
    user.bpy.ops.pumice.labels_isolate()


def show_all(user):
    user.volume()
    user.bpy.ops.pumice.labels_show_all()


def color(user):
    user.volume()
    user.bpy.ops.pumice.labels_color(color=user.between(0.0, 1.0))


def recolor(user):
    user.volume()
    palette = user.random.choice(("NEIGHBORS", "TYPE", "NUMBER", "GLASBEY", "SAFE"))
    user.bpy.ops.pumice.labels_recolor(palette=palette, color_map=user.random.choice(("VIRIDIS", "RAMP")))


def assign(user):
    user.volume()
    user.bpy.ops.pumice.labels_assign(slot=user.random.randint(-1, 2))


def frame(user):
    user.volume()
    user.bpy.ops.pumice.labels_frame()


def pick(user):
    x, y = user.random.randint(0, SIZE[0] + 2), user.random.randint(0, SIZE[1] - 1)
    extend, toggle = (user.random.random() < 0.5 for _ in range(2))
    user.bpy.ops.pumice.labels_pick(x=x, y=y, extend=extend, toggle=toggle)


def select_box(user):
    x, y = user.random.randint(-5, SIZE[0]), user.random.randint(-5, SIZE[1])
    user.bpy.ops.pumice.labels_select_box(x0=x, y0=y, x1=x + 20, y1=y + 20, extend=user.random.random() < 0.5)


def labels_through_a_file(user):
    user.volume()
    path = str(user.folder / "labels.csv")
    user.bpy.ops.pumice.labels_export(filepath=path)
    user.volume()
    user.bpy.ops.pumice.labels_import(filepath=path)


LABELS = [select, select_any_ids, search, select_hits, select_group, invert, hide, hide_by_id, isolate, show_all, color, recolor, assign]
LABELS += [frame, pick, select_box, labels_through_a_file]
