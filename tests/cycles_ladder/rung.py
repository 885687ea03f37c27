"""A rung of the ladder: a small scene of real voxels, the same for Pumice and for Cycles.

    rungs/NAME.json    a JSON merge patch (RFC 7386) of rungs/base.json:
      what             a description in one line
      awaits           why the rung is not compared yet: a feature that is not drawn, or a missing reference
      crop             volume (in data/), low, size in voxels, labels: [first, end) of its labels by falling number of voxels;
                       spacing: in place of the volume's own; cut_x: only voxels left of this plane, which may halve them
      view             eye and target in world units: the crop's middle is the origin, its longest side 2
      scene            fields of the scene file; labels of `style.materials` are ranks within the crop
      sky              parameters of a generated sky image
      floor            a square mesh: height, half of its side, material, shadow_catcher
      ball             a smooth mesh, or a list of them: position, radius, number of subdivisions, materials of its halves
      second           the same volume once more within the first, turned about their common middle: axis, angle_rad, style
      seeds, spp       of a comparison
      controls         names of faults in `controls.py` that the comparison must detect
"""

import copy
import dataclasses
import hashlib
import json
import math
import warnings
from pathlib import Path

import numpy as np

import controls
import shapes
import sky

FOLDER = Path(__file__).resolve().parent
DATA = FOLDER.parents[1] / "data"


def names():
    """Names of all rungs in order."""
    return sorted(path.stem for path in (FOLDER / "rungs").glob("*.json") if path.stem != "base")


def judged():
    """Names of the rungs that are compared: those that await nothing."""
    return [name for name in names() if "awaits" not in described(name)]


def described(name):
    """The rung's fields: its file merged into the base."""
    return completed(json.loads((FOLDER / "rungs" / f"{name}.json").read_text()))


def completed(own):
    """The fields of a rung, merged into the base."""
    return merged(json.loads((FOLDER / "rungs" / "base.json").read_text()), own)


def merged(base, patch):
    """JSON merge patch (RFC 7386): merges objects field by field, null removes a field, anything else replaces it."""
    if not isinstance(patch, dict) or not isinstance(base, dict):
        return copy.deepcopy(patch)
    out = copy.deepcopy(base)
    for key, value in patch.items():
        if value is None:
            out.pop(key, None)
        else:
            out[key] = merged(out.get(key, {}), value) if isinstance(value, dict) else copy.deepcopy(value)
    return out


def looking(eye, target):
    """The matrix of a camera with z up, as twelve numbers."""
    eye = np.array(eye, dtype=np.float64)
    back = eye - target
    back /= np.linalg.norm(back)
    right = np.cross((0.0, 0.0, 1.0), back)
    right /= np.linalg.norm(right)
    return np.concatenate([right, np.cross(back, right), back, eye]).tolist()


def turning(axis, angle_rad):
    """The 3 × 3 matrix of a turn about an axis, counter-clockwise for who looks against it (Rodrigues' formula)."""
    x, y, z = np.array(axis, dtype=np.float64) / np.linalg.norm(axis)
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + math.sin(angle_rad) * across + (1.0 - math.cos(angle_rad)) * across @ across


class Rung:
    """A prepared rung: its labels, its scene as a dictionary, its faces for Cycles."""

    def __init__(self, name, folder, own=None):
        """`folder` receives the files that the scene refers to. `own`: fields in place of those of the file `rungs/NAME.json`."""
        import pumice

        self.name, self.folder = name, Path(folder)
        self.fields = described(name) if own is None else completed(own)
        self.seeds, self.spp = self.fields["seeds"], self.fields["spp"]
        crop = self.fields["crop"]
        self.labels, spacing = cut_out(crop)
        size = np.array(self.labels.shape) * spacing
        scale = 2.0 / size.max()
        columns = np.diag(spacing * scale)
        matrix = np.vstack([columns, -0.5 * scale * size]).ravel().tolist()
        self.volume = pumice.compress(self.labels)
        self.ids = ranked(self.labels)

        # Shapes by file name; each mesh is there twice, as given and with flat shading.
        self.shapes = {}
        scene = copy.deepcopy(self.fields["scene"])
        style = scene.pop("style")
        if "materials" in style:
            style["materials"] = {str(self.ids[int(rank)]): m for rank, m in style["materials"].items()}
        scene["instances"] = [{"id": 1, "source": "crop", "world_from_index": matrix, "style": style}]
        if "second" in self.fields:
            second = self.fields["second"]
            turned = (np.reshape(matrix, (4, 3)) @ turning(second["axis"], second["angle_rad"]).T).ravel().tolist()
            scene["instances"].append({"id": 2, "source": "crop", "world_from_index": turned, "style": second["style"]})
        view = self.fields["view"]
        scene["camera"]["world_from_camera"] = looking(view["eye"], view["target"])
        if "sky" in self.fields:
            path = self.folder / f"{name}-sky.exr"
            sky.write(path, sky.picture(**self.fields["sky"]))
            scene["world"]["environment"]["image"]["path"] = str(path)
        if "cut_x" in crop:
            point = [matrix[0] * crop["cut_x"] + matrix[9], 0.0, 0.0]
            scene["cuts"] = [{"shape": {"plane": {"point": point, "normal": [1.0, 0.0, 0.0]}}}]
        if "floor" in self.fields:
            floor = self.fields["floor"]
            place = floor["half"], [0, 0, floor["height"]]
            self.add_mesh(scene, shapes.square(), place, [floor["material"]])
            scene["meshes"][-1]["shadow_catcher"] = floor.get("shadow_catcher", False)
        if "ball" in self.fields:
            given = self.fields["ball"]
            for ball in given if isinstance(given, list) else [given]:
                self.add_mesh(scene, shapes.ball(ball["times"]), (ball["radius"], ball["at"]), ball["materials"])
        self.scene = pumice.Scene.from_dict(scene).to_dict()

    def add_mesh(self, scene, shape, place, materials):
        """Adds a mesh to a scene, scaled and moved, and writes its files."""
        scale, at = place
        stem = self.folder / f"{self.name}-mesh-{len(self.shapes)}"
        for path, form in ((f"{stem}.ply", shape), (f"{stem}{controls.FLAT}", shape.flat())):
            Path(path).write_text(form.ply())
            self.shapes[path] = form
        matrix = np.vstack([scale * np.eye(3), at]).ravel().tolist()
        mesh = {"id": len(scene.get("meshes", [])) + 1, "source": f"{stem}.ply", "world_from_mesh": matrix, "materials": materials}
        scene.setdefault("meshes", []).append(mesh)

    def meshes_of(self, scene):
        """The `pumice.Mesh` objects that a scene of the rung refers to."""
        return [self.shapes[mesh["source"]].made() for mesh in scene["meshes"]]

    @property
    def volumes(self):
        """The volume by the source that the instances name."""
        return {"crop": self.volume}

    @property
    def meshes(self):
        """The meshes of the rung's own scene."""
        return self.meshes_of(self.scene)

    @property
    def digest(self):
        """A digest of everything that the reference depends on."""
        scene = {k: v for k, v in self.fields.items() if k in ("crop", "view", "scene", "sky", "floor", "ball", "second")}
        text = json.dumps(scene, sort_keys=True).encode() + np.ascontiguousarray(self.labels).tobytes()
        return hashlib.sha256(text).hexdigest()[:16]

    def job(self, pictures, report, renders, scene=None, **options):
        """A job for `scene_in_cycles.py`; writes its arrays into the rung's folder."""
        scene = self.scene if scene is None else scene
        instances = [self.surface(instance, options.get("smooth", False)) for instance in scene["instances"]]
        meshes = []
        for mesh in scene["meshes"]:
            shape = self.shapes[mesh["source"]]
            arrays = {"vertices": shape.corners, "triangles": shape.triangles, "material_of_triangle": shape.materials}
            if shape.normals is not None:
                arrays["normals"] = shape.normals[shape.triangles]
            files = {key: f"{mesh['source']}-{key}.npy" for key in arrays}
            for key, values in arrays.items():
                np.save(files[key], values)
            meshes.append({**files, "materials": mesh["materials"]})
        return {
            "scene": scene,
            "instances": instances,
            "meshes": meshes,
            "cut_is_in_the_mesh": True,
            "renders": renders,
            "pictures": str(pictures),
            "report": str(report),
            **options,
        }

    def surface(self, instance, smooth):
        """An instance's surface, as a job has it: the files of its arrays, and its materials."""
        style = instance["style"]
        show = style["show"]
        shown = self.ids if show == "all" else show["only"]
        interfaces = "all" if lets_light_through(style) else "outside"
        # For smooth shading quads must share vertices; a vertex of a single quad has that quad's normal.
        vertices, faces = self.cut_faces(shown, interfaces, smooth)
        own = sorted(style["materials"], key=int)
        materials = [style["material"], *(style["materials"][label] for label in own)]
        number = {int(label): i + 1 for i, label in enumerate(own)}
        of_row = np.array([number.get(int(label), 0) for label in self.volume.labels.ids])
        arrays = {"vertices": vertices, "quads": faces.quads, "material_of_quad": of_row[faces.labels]}
        paths = {}
        for key, array in arrays.items():
            paths[key] = str(self.folder / f"{self.name}-{instance['id']}-{key}.npy")
            np.save(paths[key], array)
        return {**paths, "materials": materials}

    def cut_faces(self, shown, interfaces, shared_corners):
        """(vertices, faces) of the shown labels; `interfaces` as for `Volume.faces`. Voxels right of the cut are removed, and those that it
        halves end at it."""
        import pumice

        cut = self.fields["crop"].get("cut_x")
        if cut is None:
            faces = self.volume.faces(shown, interfaces=interfaces, shared_corners=shared_corners)
            return faces.vertices, faces
        left = self.labels.copy(order="F")
        left[math.ceil(cut) :] = 0
        kept = [label for label in shown if (left == label).any()]
        faces = pumice.compress(left).faces(kept, interfaces=interfaces, shared_corners=shared_corners)
        vertices = faces.vertices.astype(np.float32)
        vertices[:, 0] = np.minimum(vertices[:, 0], cut)
        # Maps rows of the cut volume's label table to rows of the whole volume's.
        whole = np.searchsorted(self.volume.labels.ids, np.unique(left[left > 0]).astype(np.uint64)).astype(np.uint32)
        return vertices, dataclasses.replace(faces, labels=whole[faces.labels])

    def draw(self, first, seeds, *, scene=None, spp=None, backend="cpu"):
        """Renders with Pumice: pictures (seeds, height, width, 3) with the seeds from `first` on."""
        import pumice

        scene = self.scene if scene is None else scene
        out, meshes = [], self.meshes_of(scene)
        for seed in range(first, first + seeds):
            scene["settings"]["seed"] = seed
            picture = pumice.render(
                pumice.Scene.from_dict(scene), self.volumes, meshes=meshes, spp=spp or self.spp, backend=backend
            )
            out.append(laid_over_white(picture.color, picture.alpha, picture.passes.get("shadow_catcher")))
        return np.array(out, dtype=np.float64)


def lets_light_through(style):
    """Whether light reaches the faces between two labels: some label has alpha below 1 or is of glass."""
    return any(m["alpha"] < 1 or m["transmission"] > 0 for m in [style["material"], *style["materials"].values()])


def laid_over_white(color, alpha, shadow=None):
    """The picture composited over white, in three channels; a shadow pass darkens the white. Without alpha, the picture itself."""
    if alpha is None:
        return color
    return color + (1.0 - alpha[..., None]) * (1.0 if shadow is None else shadow)


def cut_out(crop):
    """(labels, spacing) of the crop; labels outside the wanted ranks become background."""
    import pumice

    with warnings.catch_warnings():
        # Ignores that a file states no spacing; the rung gives one where it matters.
        warnings.simplefilter("ignore", pumice.PumiceWarning)
        volume = pumice.open(DATA / crop["volume"])
    low, size = np.array(crop["low"]), np.array(crop["size"])
    part = volume.decode()[tuple(slice(l, l + s) for l, s in zip(low, size, strict=True))]
    first, end = crop["labels"]
    kept = np.isin(part, ranked(part)[first:end])
    spacing = np.array(crop.get("spacing", volume.spacing), dtype=np.float64)
    return np.asfortranarray(np.where(kept, part, 0)), spacing


def ranked(labels):
    """Ids without background by decreasing number of voxels; ties by id."""
    ids, counts = np.unique(labels[labels > 0], return_counts=True)
    return ids[np.lexsort((ids, -counts))].astype(int).tolist()
