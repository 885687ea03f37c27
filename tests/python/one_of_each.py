"""A folder with one file of each kind that a command reads, and command lines that name them, for tests of inputs and outputs."""

import json
import os
import socket

import tifffile
from broken_files import labels, volumes
from command import run

QUICK = ["--backend", "cpu", "--spp", "1", "--size", "8x8"]
# A triangle below the volume.
MESH = (
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 -1\n9 0 -1\n0 9 -1\n3 0 1 2\n"
)


def one_of_each(pumice, folder):
    """Writes the files into an empty folder, and returns it. The scene names them by paths that are relative to it."""
    volumes(folder)
    run(pumice, "compress", folder / "raw.nrrd", "-o", folder / "v.pumice").fine()
    for name in ["a.exr", "b.exr"]:
        run(pumice, "render", folder / "v.pumice", "-o", folder / name, *QUICK, "--save-scene", folder / "saved.json").fine()
    (folder / "mesh.ply").write_text(MESH)
    scene = json.loads((folder / "saved.json").read_text())
    place = [1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0]
    scene["meshes"] = [{"id": 1, "source": "mesh.ply", "world_from_mesh": place, "materials": [{"base_color": [0.5, 0.5, 0.5]}]}]
    scene["world"]["environment"] = {"image": {"path": "a.exr", "strength": 1.0}}
    (folder / "scene.json").write_text(json.dumps(scene))
    (folder / "table.csv").write_text("id,name\n1,one\n")
    (folder / "types.csv").write_text("id,type\n1,axon\n")
    (folder / "slices").mkdir()
    for z, plane in enumerate(labels().transpose(2, 1, 0)):
        tifffile.imwrite(folder / "slices" / f"s{z:02}.tif", plane)
    return folder


def arguments(line, made, out):
    """The arguments of a line: QUICK stands for flags of a small picture, OUT for `out`, `rest.…` for a file beside that, FOLDER for its
    folder, and names of files in `made` for these."""
    words = []
    for word in line.split():
        if word == "QUICK":
            words += QUICK
        elif word == "OUT":
            words.append(out)
        elif word == "FOLDER":
            words.append(out.parent)
        elif word.startswith("rest."):
            words.append(out.parent / word)
        else:
            words.append(made / word if os.path.lexists(made / word) else word)
    return words


def left_in(folder):
    return sorted(p.name for p in folder.iterdir())


def listen(path):
    """Makes a socket. Its name is short, because the system takes no long path of one."""
    before = os.getcwd()
    os.chdir(path.parent)
    try:
        with socket.socket(socket.AF_UNIX) as listener:
            listener.bind(path.name)
    finally:
        os.chdir(before)


# What is no ordinary file, by the words for it: functions that make one.
NO_FILES = {"a pipe": os.mkfifo, "a device": lambda path: path.symlink_to("/dev/full"), "a socket": listen}
