# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a user of `abuse_driver` does with volumes, cuts, figures, materials, light and camera."""

import os

from pick_scene import FIRST_IDS, SECOND_IDS, SIZE, block

SAMPLES, BOUNCES = 2, 2
# So few that rounds stay quick, and enough that volumes share tables, files and cuts.
MOST_VOLUMES, MOST_OTHERS = 5, 8


def make_quick(bpy):
    """Size and limits with which pictures take a moment."""
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = *SIZE, 100
    wishes = scene.pumice
    wishes.samples = wishes.viewport_samples = SAMPLES
    wishes.bounces, wishes.use_error, wishes.backend = BOUNCES, False, "CPU"


def name_of(volume):
    """The name of a volume's file, whose path is relative once the `.blend` file was saved."""
    return os.path.basename(volume.pumice.filepath)


# Volumes


def import_another(user):
    if len(user.volumes()) >= MOST_VOLUMES:
        return remove_volume(user)
    path = user.folder / user.random.choice(("first.pumice", "second.pumice"))
    placement = user.random.choice(("CENTER", "ALIGN", "FILE"))
    known = user.random.random() < 0.5
    user.bpy.ops.pumice.import_volume(filepath=str(path), pick=user.random.randint(0, 3), placement=placement, use_known_colors=known)
    # Surfaces of two volumes in the very same place are as near as each other: which of them is seen depends on their order.
    user.bpy.context.object.location = user.between(-2.0, 2.0)


def rewrite_and_reload(user):
    obj = user.volume()
    ids = sorted(user.random.sample(FIRST_IDS + SECOND_IDS, user.random.randint(1, 6)))
    block(ids, user.folder / name_of(obj), {ids[0]: "new"})
    user.bpy.ops.pumice.reload()
    # Other objects of the file are reloaded too, but for one time in five: then their label tables may not fit it.
    if user.random.random() < 0.8:
        for other in [o for o in user.volumes() if name_of(o) == name_of(obj) and o != obj]:
            user.bpy.context.view_layer.objects.active = other
            user.bpy.ops.pumice.reload()


def duplicate(user):
    if len(user.volumes()) >= MOST_VOLUMES:
        return remove_volume(user)
    user.volume()
    user.bpy.ops.object.duplicate(linked=user.random.random() < 0.5)
    user.bpy.context.object.location.x += user.random.uniform(-4.0, 4.0)


def remove_volume(user):
    if len(user.volumes()) > 1:
        user.volume()
        user.bpy.ops.object.delete()


def transform(user):
    obj = user.volume()
    obj.location, obj.rotation_euler = user.between(-3.0, 3.0), user.between(-3.0, 3.0)
    obj.scale = [obj.scale[0] * user.random.choice((-1.0, 1.0)), obj.scale[1] * user.random.uniform(0.8, 1.2), obj.scale[2]]


def apply_transforms(user):
    user.volume()
    user.bpy.ops.object.make_single_user(object=True, obdata=True)
    user.bpy.ops.object.transform_apply()


def set_origin(user):
    user.volume()
    kind = user.random.choice(("GEOMETRY_ORIGIN", "ORIGIN_GEOMETRY", "ORIGIN_CENTER_OF_VOLUME"))
    user.bpy.ops.object.origin_set(type=kind)


def turn_in_edit_mode(user):
    user.volume()
    user.bpy.ops.object.mode_set(mode="EDIT")
    try:
        user.bpy.ops.mesh.select_all(action="SELECT")
        user.bpy.ops.transform.translate(value=user.between(-0.5, 0.5))
    finally:
        user.bpy.ops.object.mode_set(mode="OBJECT")


def hide_or_show_object(user):
    obj = user.random.choice(user.volumes())
    obj.hide_set(False)
    obj.hide_render = obj.hide_viewport = not obj.hide_viewport


def exact_mesh(user):
    user.volume()
    user.bpy.ops.pumice.make_exact_mesh(merged=user.random.random() < 0.5, hide_volume=False)


def proxy(user):
    user.volume()
    user.bpy.ops.pumice.update_proxy()


# Cuts


def add_cut(user):
    if len(user.others("EMPTY")) >= MOST_OTHERS:
        return remove_cut(user)
    user.volume()
    shape, orientation = user.random.choice(("PLANE", "BOX")), user.random.choice(("VIEW", "X", "Y", "Z"))
    user.bpy.ops.pumice.add_cut(shape=shape, orientation=orientation, volumes=user.random.choice(("ALL", "ACTIVE", "SELECTED")))


def move_cut(user):
    obj = user.choose(user.others("EMPTY"))
    obj.location, obj.rotation_euler = user.between(-2.0, 2.0), user.between(-1.0, 1.0)


def change_cut(user):
    obj = user.choose(user.others("EMPTY"))
    obj.pumice.cut = user.random.choice(("NONE", "PLANE", "BOX", "PLANE", "BOX"))


def choose_cut_volumes(user):
    obj = user.choose(user.others("EMPTY"))
    for volume in user.random.sample(user.volumes(), 1):
        volume.select_set(True)
    user.bpy.context.view_layer.objects.active = obj
    user.bpy.ops.pumice.cut_volumes(volumes=user.random.choice(("ALL", "SELECTED")))


def remove_cut(user):
    user.choose(user.others("EMPTY"))
    user.bpy.ops.object.delete()


# Figure


def figure_preset(user):
    user.bpy.ops.pumice.figure_preset(preset=user.random.choice(("DRAFT", "FIGURE", "FINAL")))
    make_quick(user.bpy)


def scale_bar(user):
    if len(user.others("MESH")) < MOST_OTHERS:
        user.volume()
        user.bpy.ops.pumice.add_scale_bar(corner=user.random.choice(("LOWER_RIGHT", "UPPER_LEFT")))


def legend(user):
    if len(user.others("MESH")) < MOST_OTHERS:
        user.volume()
        user.bpy.ops.pumice.add_legend(entries=user.random.choice(("GROUPS", "SELECTED")))


def remove_mesh(user):
    user.choose(user.others("MESH"))
    user.bpy.ops.object.delete()


# Materials, light, camera, settings


def material(user):
    slot = user.random.choice([s for s in user.volume().material_slots if s.material is not None] or [None])
    if slot is not None:
        inputs = slot.material.node_tree.nodes["Principled BSDF"].inputs
        inputs["Roughness"].default_value, inputs["Metallic"].default_value = user.between(0.1, 1.0, 2)
        inputs["Alpha"].default_value = user.random.choice((1.0, 0.4))
        inputs["Emission Strength"].default_value = user.random.choice((0.0, 0.0, 0.5))
        slot.material.pumice.colors_by_label = user.random.random() < 0.6


def fade(user):
    slot = next((s for s in user.volume().material_slots if s.material is not None), None)
    if slot is not None:
        alpha = slot.material.node_tree.nodes["Principled BSDF"].inputs["Alpha"]
        for number, value in ((1, 1.0), (5, 0.2)):
            alpha.default_value = value
            alpha.keyframe_insert("default_value", frame=number)


def another_frame(user):
    user.bpy.context.scene.frame_set(user.random.randint(1, 5))


def add_slot(user):
    obj = user.volume()
    if len(obj.material_slots) < 4:
        user.bpy.ops.object.material_slot_add()
        if user.random.random() < 0.7:
            obj.material_slots[-1].material = user.bpy.data.materials.new("group")
            if user.bpy.app.version < (5, 0, 0):
                obj.material_slots[-1].material.use_nodes = True


def remove_slot(user):
    user.volume()
    user.bpy.ops.object.material_slot_remove()


def light(user):
    for obj in user.others("LIGHT"):
        obj.data.energy, obj.rotation_euler = user.random.uniform(0.5, 4.0), user.between(-1.0, 1.0)


def camera(user):
    user.bpy.context.scene.camera.location = (user.random.uniform(-3.0, 3.0), user.random.uniform(-24.0, -16.0), user.random.uniform(0.0, 5.0))


def settings(user):
    wishes = user.bpy.context.scene.pumice
    wishes.bounces, wishes.seed = user.random.randint(0, BOUNCES), user.random.randint(0, 5)
    wishes.smooth_voxels, wishes.use_adaptive = user.random.random() < 0.3, False
    user.bpy.context.scene.render.film_transparent = user.random.random() < 0.3


VOLUMES = [import_another, rewrite_and_reload, duplicate, remove_volume, transform, apply_transforms, set_origin, turn_in_edit_mode]
VOLUMES += [hide_or_show_object, exact_mesh, proxy]
CUTS = 3 * [add_cut] + [move_cut, change_cut, choose_cut_volumes, remove_cut]
FIGURE = [figure_preset, scale_bar, legend, remove_mesh]
LOOK = [material, fade, another_frame, add_slot, remove_slot, light, camera, settings]
