# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A node of a farm: runs the arguments of a command `blender …` in a process of its own, with Blender as a module.

The module has no command line. So the process does what Blender's manual says of the arguments that recipes use, in their order
(https://docs.blender.org/manual/en/latest/advanced/command_line/arguments.html); any other is refused.

    -b FILE                opens a file                      -S --scene NAME         chooses a scene
    -E --engine NAME       sets the engine                   -o --render-output      where pictures go; # are digits of the frame
    -s, -e, -j             first and last frame, step        -F --render-format      the kind of file
    -a                     renders these frames              -f --render-frame       renders frames: 7 or 1..10 or 1,3,5..9
    -t, -y                 taken, and left alone             --python-expr CODE      runs code; --python-exit-code N ends with N where it fails

A frame that fails ends the process with status 1, as it does `blender -b` (observed in Blender 4.3.2).
"""

import os
import subprocess
import sys
from pathlib import Path


def blender(arguments, **environment):
    """Runs a node; its status and output, as `subprocess.run` returns them. BLENDER_USER_RESOURCES says which extension it has."""
    command = [sys.executable, __file__, *map(str, arguments)]
    return subprocess.run(command, env={**os.environ, **environment}, capture_output=True, text=True, timeout=300)


def frames(text):
    """The frames of -f."""
    for part in text.split(","):
        first, _, last = part.partition("..")
        yield from range(int(first), int(last or first) + 1)


def _main(arguments):
    import addon_utils
    import bpy

    assert addon_utils.enable("bl_ext.user_default.pumice", default_set=True, persistent=True) is not None
    words, exit_code = list(arguments), 0
    while words:
        word = words.pop(0)
        scene = bpy.context.scene
        if word in ("-b", "--background"):
            bpy.ops.wm.open_mainfile(filepath=words.pop(0))
        elif word in ("-S", "--scene"):
            bpy.context.window.scene = bpy.data.scenes[words.pop(0)]
        elif word in ("-E", "--engine"):
            scene.render.engine = words.pop(0)
        elif word in ("-o", "--render-output"):
            scene.render.filepath = words.pop(0)
        elif word in ("-F", "--render-format"):
            _set_format(scene.render.image_settings, words.pop(0))
        elif word in ("-s", "--frame-start"):
            scene.frame_start = int(words.pop(0))
        elif word in ("-e", "--frame-end"):
            scene.frame_end = int(words.pop(0))
        elif word in ("-j", "--frame-jump"):
            scene.frame_step = int(words.pop(0))
        elif word in ("-a", "--render-anim"):
            bpy.ops.render.render(animation=True)
        elif word in ("-f", "--render-frame"):
            for frame in frames(words.pop(0)):
                _one(scene, frame)
        elif word == "--python-exit-code":
            exit_code = int(words.pop(0))
        elif word == "--python-expr":
            try:
                exec(words.pop(0), {"__name__": "__main__"})
            except Exception as problem:
                print(f"Python: {problem}", file=sys.stderr)
                if exit_code:
                    return exit_code
        elif word in ("-t", "--threads"):
            words.pop(0)
        elif word not in ("-y", "--enable-autoexec"):
            raise AssertionError(f"{word}: this node does not know the argument")
    return 0


def _one(scene, frame):
    """Renders a frame as -f does: an animation of one frame, so the file has its number."""
    import bpy

    kept = scene.frame_start, scene.frame_end
    scene.frame_start, scene.frame_end = frame, frame
    bpy.ops.render.render(animation=True)
    scene.frame_start, scene.frame_end = kept


def _set_format(settings, kind):
    # Blender 5 asks first whether a file has one layer or all.
    if hasattr(settings, "media_type"):
        settings.media_type = "MULTI_LAYER_IMAGE" if kind.endswith("MULTILAYER") else "IMAGE"
    settings.file_format = kind


if __name__ == "__main__":
    # The tests' folder hides nothing from this process.
    sys.path[:] = [place for place in sys.path if Path(place or ".").resolve() != Path(__file__).resolve().parent]
    import shutil

    import bpy

    status = 1
    try:
        status = _main(sys.argv[1:])
    except RuntimeError as problem:
        print(problem, file=sys.stderr)
    sys.stdout.flush()
    shutil.rmtree(bpy.app.tempdir, ignore_errors=True)
    os._exit(status)
