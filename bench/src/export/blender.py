"""Imports a file into Blender and draws one sample of it with Cycles: `pumice bench export` runs it for each file, in Blender or in a
Python that has it as a module. The request is a JSON file: {"file", "report", "most_seconds"}. A process that takes longer ends by a signal, which
needs no help of Blender's.

The report has wall seconds and CPU seconds of the import alone, and of one sample of 320 × 180 pixels on the CPU with all that Cycles does
before it: copying the scene, building its hierarchy, loading kernels; then objects, polygons of meshes, and the peak of memory.
"""

import json
import os
import pathlib
import resource
import signal
import sys
import time

import bpy
import mathutils


def clocked(work):
    """Wall seconds and CPU seconds of all threads of work()."""

    def cpu():
        used = resource.getrusage(resource.RUSAGE_SELF)
        return used.ru_utime + used.ru_stime

    wall, before = time.monotonic(), cpu()
    work()
    return {"seconds": time.monotonic() - wall, "cpu_seconds": cpu() - before}


def peak_rss_bytes():
    with open("/proc/self/status") as status:
        return 1024 * int(next(line for line in status if line.startswith("VmHWM:")).split()[1])


def imported(file):
    importer = bpy.ops.wm.usd_import if file.endswith(".usdc") else bpy.ops.import_scene.gltf
    assert importer(filepath=file) == {"FINISHED"}, file


def look_at_all():
    """A camera that sees all objects, and a white world."""
    scene = bpy.context.scene
    corners = []
    # Instances of a point cloud or of Geometry Nodes are objects of the evaluated scene alone.
    for instance in bpy.context.evaluated_depsgraph_get().object_instances:
        if instance.object.type in {"MESH", "POINTCLOUD"}:
            corners += [instance.matrix_world @ mathutils.Vector(c) for c in (instance.object.bound_box[0], instance.object.bound_box[6])]
    low, high = (mathutils.Vector([pick(c[a] for c in corners) for a in range(3)]) for pick in (min, max))
    middle, radius = (low + high) / 2, max((high - low).length / 2, 1e-6)
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    direction = mathutils.Vector((1, -2, 1)).normalized()
    camera.location = middle + 4 * radius * direction
    camera.rotation_euler = direction.to_track_quat("Z", "Y").to_euler()
    camera.data.clip_end = 10 * radius
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.world = bpy.data.worlds.new("world")
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 320, 180, 100
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.device = 1, False, "CPU"


def main():
    job = json.loads(pathlib.Path(sys.argv[-1]).read_text())
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.alarm(int(job["most_seconds"]))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.preferences.addons.get("io_scene_gltf2") or bpy.ops.preferences.addon_enable(module="io_scene_gltf2")
    bpy.context.preferences.addons.get("cycles") or bpy.ops.preferences.addon_enable(module="cycles")
    importing = clocked(lambda: imported(job["file"]))
    look_at_all()
    drawing = clocked(lambda: bpy.ops.render.render())
    meshes = [obj for obj in bpy.data.objects if obj.type == "MESH"]
    report = {
        "version": bpy.app.version_string,
        "import": importing,
        "first_sample": drawing,
        "objects": len(bpy.data.objects) - 1,
        "polygons": sum(len(mesh.polygons) for mesh in {obj.data for obj in meshes}),
        "peak_rss_bytes": peak_rss_bytes(),
    }
    pathlib.Path(job["report"]).write_text(json.dumps(report))
    # Some versions crash when the interpreter ends.
    os._exit(0)


main()
