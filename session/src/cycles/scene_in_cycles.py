"""Draws a scene of Pumice with Cycles, in Blender as a Python module (bpy 4.2 to 5.0): `python scene_in_cycles.py JOB.json`.

    JOB.json  scene       the scene file's object (docs/scene.md), every default written out, paths absolute
              instances   for each: vertices.npy (n, 3), quads.npy (m, 4), materials.npy (m,): a quad for each voxel face in index
                          space, and the materials that the last counts in; `cut`: the same of triangles, where cuts pass;
                          labels.npy (m,) and `body`, which tell parts of one body (coincident_faces.py): without them labels are
                          told by their materials, and each instance is a body of its own
              meshes      for each: vertices.npy, triangles.npy, materials.npy; normals.npy (m, 3, 3) at the triangles' corners, where
                          the mesh is smooth
              renders     [{seed, spp}, …]; without it, standard input asks for one picture after the other, each a line of JSON
                          {seed, spp, picture, report}, and `report` is written once the scene is built
              smooth      true shades smoothly: a fault on purpose
              pattern     Cycles' sampling pattern
              threads     0: all
              pictures    where (renders, height, width, 3) float32 is written, row 0 at the top; RGBA where the film is transparent, and
                          the shadow catchers' pass behind that where the film asks for it
              passes      where light by kind is written besides, if anywhere: (renders, kinds, height, width, 3) float32 in the order of
                          `KINDS`, what Cycles divided by a colour multiplied with it again
              report      where seconds, CPU seconds and peak memory are written

What is set here is what must match (docs/cycles.md has the table). Everything that Cycles would do besides is switched off: adaptive
sampling, denoising, clamps, filtering of glossy light, light that is left out because it is dim.
"""

import json
import math
import os
import resource
import sys
import tempfile
import time

import bpy
import mathutils
import numpy as np

# (A script that the program Blender runs does not find its neighbors.)
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import coincident_faces  # noqa: E402

# Blender's own least; a scene's near of 0 means no clipping.
LEAST_CLIP = 1e-6
MOST_CLIP = 1e6

# Largest cosine between two axes that location, rotation and scale of an object hold: the rounding of their 32 bits.
MOST_SHEAR = 1e-6


def matrix_of(twelve):
    """Four rows of a 4 × 4 matrix from three columns and the translation."""
    columns = np.array(twelve, dtype=np.float64).reshape(4, 3)
    matrix = np.eye(4)
    matrix[:3] = columns.T
    return matrix


def unit_axes(matrix):
    """The matrix with axes of length 1."""
    out = matrix.copy()
    out[:3, :3] /= np.linalg.norm(out[:3, :3], axis=0)
    return out


def looking_along(position, direction):
    """A matrix whose -z is a direction."""
    back = -np.asarray(direction, dtype=np.float64)
    back /= np.linalg.norm(back)
    right = np.cross((0.0, 0.0, 1.0) if abs(back[2]) < 0.9 else (1.0, 0.0, 0.0), back)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3] = np.column_stack([right, np.cross(back, right), back, position])
    return matrix


def linked(name, data, matrix):
    """A new object at a place."""
    obj = bpy.data.objects.new(name, data)
    axes = unit_axes(matrix)[:3, :3]
    # A nested list would be taken column by column.
    place = mathutils.Matrix(matrix.tolist())
    if np.abs(axes.T @ axes - np.eye(3)).max() < MOST_SHEAR:
        obj.matrix_world = place
    else:
        # Location, rotation and scale hold no shear; the matrix between a parent and its child does.
        obj.parent = bpy.data.objects.new(f"parent of {name}", None)
        bpy.context.scene.collection.objects.link(obj.parent)
        obj.matrix_parent_inverse = place
    bpy.context.scene.collection.objects.link(obj)
    return obj


def mesh_object(name, vertices, faces, material_of_face, materials, matrix, smooth, normals=None):
    """A mesh from arrays. `faces` are rows of 3 or 4 vertex numbers; `normals` are of their corners."""
    mesh = bpy.data.meshes.new(name)
    corners = faces.shape[1]
    mesh.vertices.add(len(vertices))
    mesh.vertices.foreach_set("co", np.ascontiguousarray(vertices, dtype=np.float32).ravel())
    mesh.loops.add(faces.size)
    mesh.loops.foreach_set("vertex_index", np.ascontiguousarray(faces, dtype=np.int32).ravel())
    mesh.polygons.add(len(faces))
    mesh.polygons.foreach_set("loop_start", np.arange(0, faces.size, corners, dtype=np.int32))
    mesh.polygons.foreach_set("material_index", np.ascontiguousarray(material_of_face, dtype=np.int32))
    # Blender shades a mesh from arrays smooth unless its faces are marked sharp.
    sharp = np.full(len(faces), not smooth and normals is None, dtype=bool)
    mesh.attributes.new("sharp_face", "BOOLEAN", "FACE").data.foreach_set("value", sharp)
    if normals is not None:
        # Stored unrounded, unlike `normals_split_custom_set`, which rounds normals to 16 bits. (Blender 4.5 and later.)
        values = np.ascontiguousarray(normals, dtype=np.float32).ravel()
        mesh.attributes.new("custom_normal", "FLOAT_VECTOR", "CORNER").data.foreach_set("vector", values)
    mesh.update(calc_edges=True)
    for i, fields in enumerate(materials):
        mesh.materials.append(principled(f"{name} {i}", fields))
    obj = linked(name, mesh, matrix)
    # Blender offsets the start of shadow rays on smooth triangles; this switches it off, so that they start on the surface.
    # Blender 4.2 has them among Cycles' own settings.
    of_cycles = obj if hasattr(obj, "shadow_terminator_geometry_offset") else obj.cycles
    of_cycles.shadow_terminator_geometry_offset = of_cycles.shadow_terminator_shading_offset = 0.0
    return obj


def surface_of(number, instance, mesh):
    """An instance's quads, and how they lie to those of others."""
    vertices, quads, material = (np.load(mesh[key]) for key in ("vertices", "quads", "material_of_quad"))
    label = np.load(mesh["label_of_quad"]) if "label_of_quad" in mesh else material
    cut = np.load(mesh["cut"]["vertices"])[np.load(mesh["cut"]["triangles"])] if "cut" in mesh else None
    place, body = matrix_of(instance["world_from_index"]), mesh.get("body", number)
    return coincident_faces.Surface(vertices, quads, place, body, label, material, mesh["materials"], cut)


def principled(name, fields):
    """A Principled BSDF with the scene's values."""
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    inputs = next(n for n in material.node_tree.nodes if n.bl_idname == "ShaderNodeBsdfPrincipled").inputs
    node = inputs[0].node
    node.distribution = "MULTI_GGX" if fields["multiscatter"] else "GGX"
    for socket, value in {
        "Base Color": [*fields["base_color"], 1.0],
        "Metallic": fields["metallic"],
        "Roughness": fields["roughness"],
        "IOR": fields["ior"],
        "Alpha": fields["alpha"],
        "Specular IOR Level": fields["specular"],
        "Specular Tint": [*fields["specular_tint"], 1.0],
        "Transmission Weight": fields["transmission"],
        "Subsurface Weight": fields["subsurface"],
        "Subsurface Radius": fields["subsurface_radius"],
        "Subsurface Scale": 1.0,
        "Coat Weight": fields["coat"],
        "Coat Roughness": fields["coat_roughness"],
        "Coat IOR": fields["coat_ior"],
        "Coat Tint": [*fields["coat_tint"], 1.0],
        "Sheen Weight": fields["sheen"],
        "Sheen Roughness": fields["sheen_roughness"],
        "Sheen Tint": [*fields["sheen_tint"], 1.0],
        "Emission Color": [*fields["emission"], 1.0],
        "Emission Strength": 1.0,
    }.items():
        inputs[socket].default_value = value
    return material


def set_camera(scene, camera, film):
    """Blender's lens from the field of view over the fitted side."""
    data = bpy.data.cameras.new("camera")
    fit = camera.get("fit", "auto").upper()
    data.sensor_fit, data.sensor_width, data.sensor_height = fit, 36.0, 36.0
    (kind, values), = camera["projection"].items()
    if kind == "perspective":
        data.lens_unit = "MILLIMETERS"
        data.lens = 18.0 / math.tan(0.5 * values["fov_rad"])
    else:
        data.type, data.ortho_scale = "ORTHO", values["scale"]
    data.shift_x, data.shift_y = camera["shift"]
    near, far = camera["clip"]
    data.clip_start, data.clip_end = max(near, LEAST_CLIP), min(far, MOST_CLIP)
    aperture = camera.get("aperture")
    if aperture is not None:
        dof = data.dof
        dof.use_dof, dof.focus_distance = True, aperture["focus_distance"]
        # Cycles: radius = focal length / (2 N), an orthographic camera's focal length being 1.
        focal_length = 1e-3 * data.lens if kind == "perspective" else 1.0
        dof.aperture_fstop = focal_length / (2.0 * aperture["radius"])
        dof.aperture_blades, dof.aperture_rotation = aperture["blades"], aperture["rotation_rad"]
        dof.aperture_ratio = aperture["ratio"]
    scene.camera = linked("camera", data, unit_axes(matrix_of(camera["world_from_camera"])))

    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = film["width"], film["height"], 100
    aspect = film.get("pixel_aspect", 1.0)
    # Blender accepts no value below 1.
    render.pixel_aspect_x, render.pixel_aspect_y = max(aspect, 1.0), max(1.0 / aspect, 1.0)
    render.film_transparent = film.get("transparent", False)
    (kind, values), = film["filter"].items()
    if kind == "box" and values["width"] != 1.0:
        raise SystemExit(f"film.filter.box.width: Cycles has 1 pixel alone, got {values['width']}")
    scene.cycles.pixel_filter_type = kind.upper()
    # Blender's width is half of the filter's.
    scene.cycles.filter_width = 0.5 * values["width"]


def set_world(scene, world):
    """A constant sky, or an equirectangular picture."""
    if world["backdrop"] is not None:
        raise SystemExit("world.backdrop: Cycles has none")
    scene.world = bpy.data.worlds.new("world")
    scene.world.use_nodes = True
    tree = scene.world.node_tree
    tree.nodes.clear()
    background, output = tree.nodes.new("ShaderNodeBackground"), tree.nodes.new("ShaderNodeOutputWorld")
    tree.links.new(background.outputs[0], output.inputs["Surface"])
    (kind, values), = world["environment"].items()
    if kind == "constant":
        background.inputs["Color"].default_value = [*values["radiance"], 1.0]
        return
    background.inputs["Strength"].default_value = values["strength"]
    picture, turn, place = (tree.nodes.new("ShaderNode" + n) for n in ("TexEnvironment", "Mapping", "TexCoord"))
    picture.image = bpy.data.images.load(values["path"])
    picture.image.colorspace_settings.name = "Linear Rec.709"
    turn.vector_type = "POINT"
    # The direction is rotated back before the lookup in the picture.
    turn.inputs["Rotation"].default_value = (0.0, 0.0, -values["rotation_rad"])
    tree.links.new(place.outputs["Generated"], turn.inputs["Vector"])
    tree.links.new(turn.outputs["Vector"], picture.inputs["Vector"])
    tree.links.new(picture.outputs["Color"], background.inputs["Color"])


def add_suns(suns):
    for i, sun in enumerate(suns):
        light = bpy.data.lights.new(f"sun {i}", "SUN")
        light.energy, light.color, light.angle = sun["strength"], sun["color"], sun["angle_rad"]
        linked(light.name, light, looking_along((0.0, 0.0, 0.0), sun["direction"]))


def add_lights(lights):
    for i, lamp in enumerate(lights):
        (kind, shape), = lamp["shape"].items()
        light = bpy.data.lights.new(f"{kind} {i}", kind.upper())
        light.energy, light.color = lamp["power_w"], lamp["color"]
        if kind == "area":
            rectangle = shape["outline"] == "rectangle"
            light.shape = "RECTANGLE" if rectangle else "ELLIPSE"
            light.size, light.size_y = shape["size"]
            light.spread = shape["spread_rad"]
            matrix = matrix_of(shape["world_from_light"])
        else:
            light.shadow_soft_size = shape["radius"]
            light.use_soft_falloff = shape["soft_falloff"]
            if kind == "spot":
                light.spot_size, light.spot_blend = shape["angle_rad"], shape["blend"]
            matrix = looking_along(shape["position"], shape.get("direction", (0.0, 0.0, -1.0)))
        obj = linked(light.name, light, matrix)
        obj.visible_camera = lamp["visible_to_camera"]


def set_cycles(scene, settings, job):
    """Sets everything in Cycles that decides what the picture converges to, and switches the rest off."""
    if settings["mode"] != "path":
        raise SystemExit(f"settings.mode: expected path, got {settings['mode']}")
    scene.render.engine = "CYCLES"
    cycles, bounces = scene.cycles, min(settings["bounces"], 1024)
    cycles.device = "CPU"
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = cycles.transmission_bounces = bounces
    cycles.transparent_max_bounces, cycles.volume_bounces = 1024, 0
    cycles.sample_clamp_direct = settings.get("clamp_direct", 0.0)
    cycles.sample_clamp_indirect = settings.get("clamp_indirect", 0.0)
    cycles.use_adaptive_sampling = cycles.use_denoising = cycles.use_fast_gi = cycles.use_guiding = False
    cycles.blur_glossy = cycles.light_sampling_threshold = 0.0
    cycles.caustics_reflective = cycles.caustics_refractive = True
    cycles.min_light_bounces = cycles.min_transparent_bounces = 0
    cycles.film_exposure = 1.0
    cycles.sampling_pattern = job.get("pattern", "AUTOMATIC")
    threads = job.get("threads", 0)
    scene.render.threads_mode = "FIXED" if threads else "AUTO"
    if threads:
        scene.render.threads = threads
    # The scene is sent to Cycles once for all pictures.
    scene.render.use_persistent_data = True


def set_output(scene, path):
    image = scene.render.image_settings
    if bpy.app.version >= (5, 0, 0):
        image.media_type = "IMAGE"
    image.file_format, image.color_depth, image.exr_codec = "OPEN_EXR", "32", "NONE"
    image.color_mode = "RGBA" if scene.render.film_transparent else "RGB"
    scene.render.filepath = path


# Light by kind: the layers of a file that multiplied give it, by their names in Blender 5 and before.
KINDS = {
    "diffuse_direct": ("Diffuse Direct", "DiffDir", "Diffuse Color", "DiffCol"),
    "diffuse_indirect": ("Diffuse Indirect", "DiffInd", "Diffuse Color", "DiffCol"),
    "diffuse_color": ("Diffuse Color", "DiffCol"),
    "glossy_direct": ("Glossy Direct", "GlossDir", "Glossy Color", "GlossCol"),
    "glossy_indirect": ("Glossy Indirect", "GlossInd", "Glossy Color", "GlossCol"),
    "transmission_direct": ("Transmission Direct", "TransDir", "Transmission Color", "TransCol"),
    "transmission_indirect": ("Transmission Indirect", "TransInd", "Transmission Color", "TransCol"),
    "emission": ("Emission", "Emit"),
    "environment": ("Environment", "Env"),
}


def want_passes(scene):
    """Makes the file one of layers, with all that `KINDS` needs."""
    image, layer = scene.render.image_settings, scene.view_layers[0]
    # Without this, Cycles does not notice a change of the seed alone, and every picture equals the first.
    scene.render.use_persistent_data = False
    if bpy.app.version >= (5, 0, 0):
        image.media_type = "MULTI_LAYER_IMAGE"
    image.file_format, image.color_depth, image.exr_codec = "OPEN_EXR_MULTILAYER", "32", "NONE"
    for kind in ("diffuse", "glossy", "transmission"):
        for part in ("direct", "indirect", "color"):
            setattr(layer, f"use_pass_{kind}_{part}", True)
    layer.use_pass_emit = layer.use_pass_environment = True


def read_layers(path):
    """(height, width, 3) of each layer by its last name, the upper row first; of the picture's alpha (height, width, 1)."""
    from pathlib import Path

    for brought in Path(bpy.utils.resource_path("LOCAL")).glob("python/lib/python3*/site-packages"):
        sys.path.append(str(brought))
    import OpenImageIO

    file, found, part = OpenImageIO.ImageInput.open(path), {}, 0
    while file.seek_subimage(part, 0):
        spec = file.spec()
        pixels = file.read_image(part, 0, 0, spec.nchannels, "float")
        for at, name in enumerate(spec.channelnames):
            *_, layer, channel = f"{spec.getattribute('name') or ''}.{name}".split(".")
            if (layer, channel) == ("Combined", "A"):
                found["Alpha"] = pixels[..., at : at + 1].copy()
            elif channel in ("R", "G", "B"):
                found.setdefault(layer, np.zeros((spec.height, spec.width, 3), np.float32))[..., "RGB".index(channel)] = pixels[..., at]
        part += 1
    file.close()
    return found


def light_by_kind(layers):
    """(kinds, height, width, 3)."""
    there = lambda names: [layers[name] for name in names if name in layers]  # noqa: E731
    return np.stack([np.prod(there(names), axis=0) for names in KINDS.values()])


def read_picture(path, transparent):
    image = bpy.data.images.load(path)
    width, height = image.size
    values = np.empty(width * height * image.channels, dtype=np.float32)
    image.pixels.foreach_get(values)
    channels = image.channels
    bpy.data.images.remove(image)
    # Blender counts rows from below.
    return values.reshape(height, width, channels)[::-1, :, : 4 if transparent else 3].copy()


def cpu_seconds():
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def peak_bytes():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def build(job):
    """The job's scene as Blender's, and a line for each kind of faces of which no program knows an order."""
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    scene, wanted = bpy.context.scene, job["scene"]
    if wanted.get("cuts") and not job.get("cut_is_in_the_mesh", False):
        raise SystemExit("cuts: the meshes must be cut already")
    smooth = job.get("smooth", False)
    of_instance = list(zip(wanted["instances"], job["instances"], strict=True))
    surfaces = [surface_of(i, instance, mesh) for i, (instance, mesh) in enumerate(of_instance)]
    without_order = coincident_faces.settle(surfaces)
    for i, ((_, mesh), surface) in enumerate(zip(of_instance, surfaces, strict=True)):
        vertices, quads, kept = surface.settled()
        mesh_object(f"volume {i}", vertices, quads, surface.material[kept], mesh["materials"], surface.place, smooth)
        if "cut" in mesh:
            arrays = (np.load(mesh["cut"][key]) for key in ("vertices", "triangles", "material_of_triangle"))
            mesh_object(f"volume {i} cut", *arrays, mesh["materials"], surface.place, smooth)
    for i, (instance, mesh) in enumerate(zip(wanted.get("meshes", []), job.get("meshes", []), strict=True)):
        arrays = (np.load(mesh[key]) for key in ("vertices", "triangles", "material_of_triangle"))
        normals = np.load(mesh["normals"]) if "normals" in mesh else None
        place = matrix_of(instance["world_from_mesh"])
        obj = mesh_object(f"mesh {i}", *arrays, mesh["materials"], place, smooth, normals)
        obj.is_shadow_catcher = instance.get("shadow_catcher", False)
    set_camera(scene, wanted["camera"], wanted["film"])
    set_world(scene, wanted["world"])
    add_suns(wanted["suns"])
    add_lights(wanted.get("lights", []))
    set_cycles(scene, wanted["settings"], job)
    return scene, without_order


class Painter:
    """Renders the built scene as often as it is asked."""

    def __init__(self, job, folder):
        self.path = os.path.join(folder, "picture.exr")
        self.scene, self.without_order = build(job)
        self.transparent = self.scene.render.film_transparent
        self.shadow_apart = "shadow_catcher" in job["scene"]["film"].get("passes", [])
        self.with_kinds = bool(job.get("passes"))
        set_output(self.scene, self.path)
        if self.with_kinds or self.shadow_apart:
            want_passes(self.scene)
            self.scene.view_layers[0].cycles.use_pass_shadow_catcher = self.shadow_apart

    def picture(self, render):
        """(row of the report, picture, light by kind or None)."""
        self.scene.cycles.seed, self.scene.cycles.samples = render["seed"], render["spp"]
        start, cpu = time.perf_counter(), cpu_seconds()
        bpy.ops.render.render(write_still=True)
        row = {**render, "seconds": time.perf_counter() - start, "cpu_seconds": cpu_seconds() - cpu}
        if self.shadow_apart:
            layers = read_layers(self.path)
            return row, np.concatenate([layers["Combined"], layers["Alpha"], layers["Shadow Catcher"]], axis=2), None
        if self.with_kinds:
            layers = read_layers(self.path)
            return row, layers["Combined"], light_by_kind(layers)
        return row, read_picture(self.path, self.transparent), None


def write_report(path, report):
    """Writes JSON under a name that appears only when it is complete."""
    with open(path + ".part", "w", encoding="utf-8") as file:
        json.dump(report, file)
    os.replace(path + ".part", path)


def serve(painter, first):
    """Renders what each line of standard input asks for ({seed, spp, picture, report}), until there is none; `first` is the first report."""
    write_report(first.pop("path"), first)
    for line in sys.stdin:
        asked = json.loads(line)
        row, picture, _ = painter.picture({key: asked[key] for key in ("seed", "spp")})
        np.save(asked["picture"], picture)
        write_report(asked["report"], {**row, "peak_bytes": peak_bytes()})


def main(job):
    before = {"cpu_seconds": cpu_seconds(), "seconds": time.perf_counter(), "peak_bytes": peak_bytes()}
    with tempfile.TemporaryDirectory() as folder:
        painter = Painter(job, folder)
        report = {
            "blender": bpy.app.version_string,
            "built": {"cpu_seconds": cpu_seconds() - before["cpu_seconds"], "seconds": time.perf_counter() - before["seconds"]},
            "bytes_before": before["peak_bytes"],
            "without_order": painter.without_order,
        }
        if "renders" not in job:
            serve(painter, {**report, "path": job["report"]})
            return
        drawn = [painter.picture(render) for render in job["renders"]]
    np.save(job["pictures"], np.stack([picture for _, picture, _ in drawn]))
    if job.get("passes"):
        np.save(job["passes"], np.stack([kinds for _, _, kinds in drawn]))
    write_report(job["report"], {**report, "renders": [row for row, _, _ in drawn], "peak_bytes": peak_bytes()})


if __name__ == "__main__":
    # As an argument of the program Blender, the job comes behind two hyphens.
    arguments = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
    try:
        with open(arguments[0], encoding="utf-8") as job_file:
            main(json.load(job_file))
    except Exception as error:
        # Blender would go on after an exception; one line says what failed.
        print(f"{type(error).__name__}: {error}", file=sys.stderr, flush=True)
        os._exit(1)
    except SystemExit as refused:
        print(refused, file=sys.stderr, flush=True)
        os._exit(1)
    sys.stdout.flush()
    # Some versions of Blender crash when the interpreter shuts down.
    os._exit(0)
