# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Random actions of a user on the scene of `pick_scene`, from a seed: operators of the extension, operators of Blender, edits of properties.

    abuse_labels     labels of a volume
    abuse_actions    volumes, cuts, figures, materials, light, camera
    here             undo, redo, saving and opening

Each action is a function of a `User`. It may be refused: `User.act` returns the one line of the refusal. Values stay in the
ranges that Pumice draws, so a picture is due after every action. Objects are looked up anew by each action, because undo replaces them.
"""

import random

from abuse_actions import CUTS, FIGURE, LOOK, VOLUMES
from abuse_labels import LABELS
from pick_scene import FIRST_IDS, SECOND_IDS


class User:
    """Acts on the scene of a Blender; `random` is the only source of chance."""

    def __init__(self, bpy, folder, seed):
        self.bpy, self.folder, self.random = bpy, folder, random.Random(seed)
        # Steps that undo may take back, and those that redo may bring again.
        self.steps = self.undone = 0

    def act(self):
        """One action and its undo step; (name of the action, the line of a refusal or None)."""
        act = self.random.choice(ACTIONS)
        try:
            act(self)
            refusal = None
        except RuntimeError as error:  # what an operator reports as an error arrives as this
            if type(error) is not RuntimeError:
                raise
            refusal = str(error).strip()
        self.bpy.context.view_layer.update()
        if act not in (undo, redo, reopen):
            self.push(act.__name__)
        return act.__name__, refusal

    def push(self, name):
        """Makes an undo step, which Blender makes by itself only in a window."""
        self.bpy.ops.ed.undo_push(message=name)
        self.steps, self.undone = self.steps + 1, 0

    def volumes(self):
        """The volume objects of the scene, by name."""
        return sorted((o for o in self.bpy.context.scene.objects if o.pumice.filepath), key=lambda o: o.name)

    def others(self, kind):
        """The other objects of a kind, by name."""
        return sorted((o for o in self.bpy.context.scene.objects if o.type == kind and not o.pumice.filepath), key=lambda o: o.name)

    def choose(self, objects):
        """Makes one of some objects active and alone selected; a RuntimeError where there is none."""
        if not objects:
            raise RuntimeError("there is no such object")
        chosen = self.random.choice(objects)
        for obj in self.bpy.context.view_layer.objects:
            obj.select_set(obj == chosen)
        self.bpy.context.view_layer.objects.active = chosen
        return chosen

    def volume(self):
        return self.choose(self.volumes())

    def ids(self):
        """One id or two, which the active volume may lack."""
        known = self.random.sample(FIRST_IDS + SECOND_IDS, self.random.randint(1, 2))
        return ", ".join(map(str, known))

    def between(self, low, high, count=3):
        return [self.random.uniform(low, high) for _ in range(count)]


def undo(user):
    for _ in range(min(user.steps - 1, user.random.randint(1, 4))):
        user.bpy.ops.ed.undo()
        user.steps, user.undone = user.steps - 1, user.undone + 1


def redo(user):
    for _ in range(min(user.undone, user.random.randint(1, 4))):
        user.bpy.ops.ed.redo()
        user.steps, user.undone = user.steps + 1, user.undone - 1


def reopen(user):
    """Saves the file and opens it again, which ends every viewport and forgets the undo steps."""
    path = str(user.folder / "abused.blend")
    user.bpy.ops.wm.save_as_mainfile(filepath=path)
    user.bpy.ops.wm.open_mainfile(filepath=path)
    user.steps = user.undone = 0
    user.push("opened")


# Undo is what breaks most, so it comes up as often as a whole group of others.
ACTIONS = LABELS + VOLUMES + CUTS + FIGURE + LOOK + 5 * [undo] + 2 * [redo] + [reopen]
