"""A rung of the ladder: a small scene of real voxels, the same for Pumice and for Cycles.

    rungs/NAME.json    over rungs/base.json, field by field (as RFC 7386 merges):
      what             a line
      awaits           what it wants before it is judged: a part of scenes that is not drawn yet, or its reference
      crop             volume (in data/), low, size in voxels, labels: [first, end) of its labels by falling number of voxels;
                       spacing: in place of the volume's own; cut_x: only voxels left of this plane, which may halve them
      view             eye and target in world units: the crop's middle is the origin, its longest side 2
      scene            what the scene file has; labels of `style.materials` are ranks within the crop
      sky              draws the picture of an image sky
      floor            a square mesh: height, half of its side, material
      seeds, spp       of a verdict
      controls         faults that the verdict must see, by the names of `controls.py`
"""

import copy
import dataclasses
import hashlib
import json
import math
import warnings
from pathlib import Path

import numpy as np

import sky

FOLDER = Path(__file__).resolve().parent
DATA = FOLDER.parents[1] / "data"
# A square, seen from above counter-clockwise.
FLOOR = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]]
HALVES = [[0, 1, 2], [0, 2, 3]]


def names():
    """All rungs, in their order."""
    return sorted(path.stem for path in (FOLDER / "rungs").glob("*.json") if path.stem != "base")


def judged():
    """Those that want nothing more."""
    return [name for name in names() if "awaits" not in described(name)]


def described(name):
    """The rung's file over the base."""
    base, own = (json.loads((FOLDER / "rungs" / f"{n}.json").read_text()) for n in ("base", name))
    return merged(base, own)


def merged(base, patch):
    """JSON merge patch: objects field by field, null takes away, all else replaces."""
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
    """A camera's matrix, z up, as twelve numbers."""
    eye = np.array(eye, dtype=np.float64)
    back = eye - target
    back /= np.linalg.norm(back)
    right = np.cross((0.0, 0.0, 1.0), back)
    right /= np.linalg.norm(right)
    return np.concatenate([right, np.cross(back, right), back, eye]).tolist()


class Rung:
    """A rung made ready: its labels, its scene as a dictionary, its faces for Cycles."""

    def __init__(self, name, folder):
        """`folder`: where what the scene points at is written."""
        import pumice

        self.name, self.folder = name, Path(folder)
        self.fields = described(name)
        self.seeds, self.spp = self.fields["seeds"], self.fields["spp"]
        crop = self.fields["crop"]
        self.labels, spacing = cut_out(crop)
        size = np.array(self.labels.shape) * spacing
        scale = 2.0 / size.max()
        columns = np.diag(spacing * scale)
        matrix = np.vstack([columns, -0.5 * scale * size]).ravel().tolist()
        self.volume = pumice.compress(self.labels)
        self.ids = ranked(self.labels)

        scene = copy.deepcopy(self.fields["scene"])
        style = scene.pop("style")
        if "materials" in style:
            style["materials"] = {str(self.ids[int(rank)]): m for rank, m in style["materials"].items()}
        scene["instances"] = [{"id": 1, "source": "crop", "world_from_index": matrix, "style": style}]
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
            path = self.folder / f"{name}-floor.ply"
            path.write_text(ply(FLOOR, HALVES))
            matrix = np.vstack([floor["half"] * np.eye(3), [0, 0, floor["height"]]]).ravel().tolist()
            mesh = {"id": 1, "source": str(path), "world_from_mesh": matrix, "materials": [floor["material"]]}
            scene["meshes"] = [mesh]
        self.meshes = [pumice.Mesh(FLOOR, HALVES) for _ in scene.get("meshes", [])]
        self.scene = pumice.Scene.from_dict(scene).to_dict()

    @property
    def digest(self):
        """Changes with all that the reference depends on."""
        scene = {k: v for k, v in self.fields.items() if k in ("crop", "view", "scene", "sky", "floor")}
        text = json.dumps(scene, sort_keys=True).encode() + np.ascontiguousarray(self.labels).tobytes()
        return hashlib.sha256(text).hexdigest()[:16]

    def job(self, pictures, report, renders, scene=None, **options):
        """A job for `scene_in_cycles.py`; arrays are written into the rung's folder."""
        scene = self.scene if scene is None else scene
        style = scene["instances"][0]["style"]
        show = style["show"]
        shown = self.ids if show == "all" else show["only"]
        # A vertex of one quad alone has that quad's normal: to be smooth, quads must share them.
        vertices, faces = self.cut_faces(shown, options.get("smooth", False))
        own = sorted(style["materials"], key=int)
        materials = [style["material"], *(style["materials"][label] for label in own)]
        number = {int(label): i + 1 for i, label in enumerate(own)}
        of_row = np.array([number.get(int(label), 0) for label in self.volume.labels.ids])
        arrays = {"vertices": vertices, "quads": faces.quads, "material_of_quad": of_row[faces.labels]}
        paths = {}
        for key, array in arrays.items():
            paths[key] = str(self.folder / f"{self.name}-{key}.npy")
            np.save(paths[key], array)
        meshes = []
        for mesh in scene["meshes"]:
            floor = {"vertices": FLOOR, "triangles": HALVES, "material_of_triangle": [0, 0]}
            files = {key: str(self.folder / f"{self.name}-floor-{key}.npy") for key in floor}
            for key, values in floor.items():
                np.save(files[key], np.array(values))
            meshes.append({**files, "materials": mesh["materials"]})
        return {
            "scene": scene,
            "instances": [{**paths, "materials": materials}],
            "meshes": meshes,
            "cut_is_in_the_mesh": True,
            "renders": renders,
            "pictures": str(pictures),
            "report": str(report),
            **options,
        }

    def cut_faces(self, shown, shared_corners):
        """(vertices, faces) of the labels that are shown: what is right of the cut is gone, and what it halves ends there."""
        import pumice

        cut = self.fields["crop"].get("cut_x")
        if cut is None:
            faces = self.volume.faces(shown, shared_corners=shared_corners)
            return faces.vertices, faces
        left = self.labels.copy(order="F")
        left[math.ceil(cut) :] = 0
        faces = pumice.compress(left).faces(
            [label for label in shown if (left == label).any()], shared_corners=shared_corners
        )
        vertices = faces.vertices.astype(np.float32)
        vertices[:, 0] = np.minimum(vertices[:, 0], cut)
        # Rows of the cut volume's table, as those of the whole one's.
        whole = np.searchsorted(self.volume.labels.ids, np.unique(left[left > 0]).astype(np.uint64)).astype(np.uint32)
        return vertices, dataclasses.replace(faces, labels=whole[faces.labels])

    def draw(self, first, seeds, *, scene=None, spp=None, backend="cpu"):
        """Pictures of Pumice, (seeds, height, width, 3), of seeds from `first` on."""
        import pumice

        scene = self.scene if scene is None else scene
        out = []
        for seed in range(first, first + seeds):
            scene["settings"]["seed"] = seed
            picture = pumice.render(
                pumice.Scene.from_dict(scene), self.volume, meshes=self.meshes, spp=spp or self.spp, backend=backend
            )
            out.append(picture.color)
        return np.array(out, dtype=np.float64)


def ply(corners, triangles):
    """A mesh file as text."""
    header = f"""ply
format ascii 1.0
element vertex {len(corners)}
property double x
property double y
property double z
element face {len(triangles)}
property list uchar int vertex_indices
end_header
"""
    rows = [*corners, *([3, *triangle] for triangle in triangles)]
    return header + "".join(" ".join(map(str, row)) + "\n" for row in rows)


def cut_out(crop):
    """(labels of the crop, spacing): the wanted ranks of its labels, all else background."""
    import pumice

    with warnings.catch_warnings():
        # A file that does not say its spacing: the rung does where it matters.
        warnings.simplefilter("ignore", pumice.PumiceWarning)
        volume = pumice.open(DATA / crop["volume"])
    low, size = np.array(crop["low"]), np.array(crop["size"])
    part = volume.decode()[tuple(slice(l, l + s) for l, s in zip(low, size, strict=True))]
    first, end = crop["labels"]
    kept = np.isin(part, ranked(part)[first:end])
    spacing = np.array(crop.get("spacing", volume.spacing), dtype=np.float64)
    return np.asfortranarray(np.where(kept, part, 0)), spacing


def ranked(labels):
    """Ids by falling number of voxels, ties by id; background left out."""
    ids, counts = np.unique(labels[labels > 0], return_counts=True)
    return ids[np.lexsort((ids, -counts))].astype(int).tolist()
