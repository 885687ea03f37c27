# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What an object's *Visibility* says and Pumice does not draw, for meshes and volumes alike."""

from . import lights

RAYS = ("camera", "diffuse", "glossy", "transmission", "shadow")


def left_out_of(obj, *, catches):
    """One line for each property of an object that is not drawn. `catches` says that such objects can be shadow catchers."""
    owner, left_out = f"Object {obj.name}", []
    if obj.is_shadow_catcher and not catches:
        left_out.append(f"{owner}: Shadow Catcher is drawn as an ordinary object")
    if obj.is_holdout:
        left_out.append(f"{owner}: Holdout is not drawn")
    hidden = [ray for ray in RAYS if not getattr(obj, f"visible_{ray}")]
    if hidden:
        left_out.append(f"{owner}: it is seen by {' and '.join(hidden)} rays all the same")
    return left_out + lights.linking(obj, owner)


def of_collections(view_layer):
    """One line for each collection of a view layer whose *Holdout* or *Indirect Only* is not drawn."""
    left_out, waiting = [], [view_layer.layer_collection]
    while waiting:
        one = waiting.pop()
        if one.exclude:
            continue
        for name, what in (("holdout", "Holdout"), ("indirect_only", "Indirect Only")):
            if getattr(one, name):
                left_out.append(f"Collection {one.name}: {what} is not drawn")
        waiting += one.children
    return left_out
