"""Faces of labels that lie in one place, arranged for Cycles as Pumice passes them (docs/scene.md, "Volumes that touch or overlap").

    A │ B    labels of one volume, or of two bodies    both faces stay, each moved by half of `GAP` into its own label
    A ┊ A    one label of two parts of one body        no surface: both faces are dropped
    A ▐ B    faces of two volumes that look the        opaque: that of the first volume stays; where light passes, no program
             same way: their insides overlap           has an order, and the comparison cannot judge what it shows

Cycles continues a ray behind a transparent surface from the next greater distance, so of two faces in one place it passes one.

Faces of an instance lie on whole numbers of its own index space. Two instances are therefore compared in the index space of the one with
the larger voxels: a face of the other counts where its corners lie on such a plane, whatever its own voxels and its rotation in the plane,
and overlaps the cells of the faces there.

This module needs numpy alone; nothing here knows Blender.
"""

import json

import numpy as np

# Distance in voxels between the faces of two labels that touch. It is exact for indices below 2^13, and thirty times the rounding of a
# ray that is 1,000 voxels long.
GAP = 2.0**-9

# Share of the thinnest voxel of the scene within which faces of two instances count as one place, as in Pumice.
NEAR_VOXELS = 2.0**-20

# Faces that overlap by less than this share of a voxel share an edge or a corner: far more than roundings, far less than voxels differ.
LEAST_OVERLAP = 1e-4

# Planes of polygons that cuts leave are equal where they are equal in this unit, relative to the size of the scene. (No round number, so
# that round coordinates do not lie on the border of two units.)
PLANE_UNIT = 1.0471975511965976e-5


class Surface:
    """The quads that an instance shows, with what decides how they are passed."""

    def __init__(self, vertices, quads, place, body, label_of_quad, material_of_quad, materials, cut=None):
        """`place` is the 4 × 4 matrix from index space to the world; instances of an equal `body` are parts of one; `cut` are the corners
        (m, 3, 3) of triangles in index space that cuts leave."""
        self.vertices, self.quads, self.place, self.body = vertices, quads, place, body
        self.label, self.material, self.cut = label_of_quad, material_of_quad, cut
        opaque = [m["alpha"] >= 1.0 and m["transmission"] <= 0.0 for m in materials]
        self.opaque = np.array(opaque, dtype=bool)[material_of_quad]
        self.materials = [json.dumps(m, sort_keys=True) for m in materials]
        self.lets_light_through = not all(opaque)
        self.dropped, self.moved = np.zeros(len(quads), dtype=bool), coincident(self.corners())

    def corners(self):
        """Corners of the quads (m, 4, 3) in index space. They are not kept, since Blender needs the memory."""
        return np.asarray(self.vertices, dtype=np.float64)[self.quads].reshape(-1, 4, 3)

    def triangles(self, other_from_world):
        """Corners, in some space, of the triangles that cuts leave; and of these with all quads as triangles."""
        place = other_from_world @ self.place
        matrix, start = place[:3, :3].T, place[:3, 3]
        cut = (np.zeros((0, 3, 3)) if self.cut is None else self.cut) @ matrix + start
        corners = self.corners() @ matrix + start
        return cut, np.concatenate([cut, corners[:, :3], corners[:, [0, 2, 3]]])

    def settled(self):
        """(vertices, quads, which of the given quads these are)."""
        kept = np.flatnonzero(~self.dropped)
        quads, moved = self.quads[kept], self.moved[kept]
        if not moved.any() and len(kept) == len(self.quads):
            return self.vertices, self.quads, kept
        apart = self.corners()[kept[moved]]
        apart -= 0.5 * GAP * outward(apart)[:, None]
        # The others keep the corners that they share; corners that none of them has are dropped.
        used = np.zeros(len(self.vertices), dtype=bool)
        used[quads[~moved]] = True
        renumbered = np.cumsum(used)[quads] - 1
        renumbered[moved] = used.sum() + np.arange(4 * len(apart)).reshape(-1, 4)
        return np.concatenate([self.vertices[used], apart.reshape(-1, 3)]), renumbered, kept


def settle(surfaces):
    """Marks in each surface which quads are moved and which are dropped; returns a line for each kind of faces that no program orders."""
    if len(surfaces) < 2:
        return []
    thicknesses = [thickness(s.place) for s in surfaces]
    near = NEAR_VOXELS * min(t.min() for t in thicknesses)
    counts = {"same": 0, "part": 0, "cut": 0}
    bounds = [world_bounds(s, near) for s in surfaces]
    for second in range(len(surfaces)):
        for first in range(second):
            if (np.maximum(bounds[first][0], bounds[second][0]) > np.minimum(bounds[first][1], bounds[second][1])).any():
                continue
            settle_pair(surfaces[first], surfaces[second], near, counts)
    lines = {
        "same": "faces of two volumes in one place that look the same way",
        "part": "faces of two parts of one body in one plane that overlap in part",
        "cut": "planes in which faces of two volumes lie, where a cut passes",
    }
    return [f"{line} ({counts[key]})" for key, line in lines.items() if counts[key]]


def settle_pair(first, second, near, counts):
    """`settle` of two surfaces; `counts` grows by the faces without an order."""
    a, b, same_side, whole = meeting(first, second, near)
    one = (first.label[a] == second.label[b]) & (first.body == second.body)
    opaque = first.opaque[a] & second.opaque[b]

    # Parts of one label of one body have no surface between them.
    inner = ~same_side & one
    first.dropped[a[inner & whole]] = second.dropped[b[inner & whole]] = True
    counts["part"] += int((inner & ~whole & ~opaque).sum())
    # Others that touch have a surface each, where light gets between them.
    touch = ~same_side & ~one & ~opaque
    first.moved[a[touch]] = second.moved[b[touch]] = True
    # Of two opaque faces that look the same way the first is seen; it does not matter which where they look alike.
    over = same_side & opaque
    second.dropped[b[over & whole]] = True
    rest = np.flatnonzero(over & ~whole)
    alike = [first.materials[first.material[a[i]]] == second.materials[second.material[b[i]]] for i in rest]
    counts["same"] += int((same_side & ~opaque).sum()) + len(rest) - sum(alike)
    if first.lets_light_through or second.lets_light_through:
        counts["cut"] += cut_planes(first, second)


def outward(corners):
    """Unit normals of quads (m, 4, 3)."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return normal / np.linalg.norm(normal, axis=1, keepdims=True)


def coincident(corners):
    """Which quads of one surface lie in the place of another."""
    _, place, count = np.unique(corners.sum(axis=1), axis=0, return_inverse=True, return_counts=True)
    return count[place.ravel()] > 1


def thickness(place):
    """Distances in the world between the planes of voxels, by axis."""
    return 1.0 / np.linalg.norm(np.linalg.inv(place[:3, :3]), axis=1)


def world_bounds(surface, near):
    """Least and largest corner in the world; of no face, an empty box."""
    points = surface.triangles(np.eye(4))[1].reshape(-1, 3)
    if len(points) == 0:
        return np.full(3, np.inf), np.full(3, -np.inf)
    return points.min(axis=0) - near, points.max(axis=0) + near


def meeting(first, second, near):
    """Pairs of faces of two surfaces that lie in one plane and overlap: indices in `first` and in `second`, whether they look the same way,
    and whether they have the same corners. A face that is turned in the plane counts with its bounds; to move one face too many by a
    thousandth of a voxel changes nothing."""
    volume = [abs(np.linalg.det(s.place[:3, :3])) for s in (first, second)]
    larger, smaller = (first, second) if volume[0] >= volume[1] else (second, first)
    matrix = np.linalg.inv(larger.place) @ smaller.place
    corners, own_corners = smaller.corners(), larger.corners()
    inside = (corners.mean(axis=1) - 0.25 * outward(corners)) @ matrix[:3, :3].T + matrix[:3, 3]
    corners, own_outward = corners @ matrix[:3, :3].T + matrix[:3, 3], outward(own_corners)
    plane = np.rint(corners.mean(axis=1))
    found = []
    for axis in range(3):
        off = np.abs(corners[..., axis] - plane[:, None, axis]).max(axis=1) * thickness(larger.place)[axis]
        flat = np.flatnonzero(off <= near)
        own = np.flatnonzero(np.abs(own_outward[:, axis]) > 0.5)
        across = [a for a in range(3) if a != axis]
        low, high = corners[flat][..., across].min(axis=1), corners[flat][..., across].max(axis=1)
        own_low, own_high = own_corners[own][..., across].min(axis=1), own_corners[own][..., across].max(axis=1)
        own_plane = own_corners[own, 0, axis]
        mine, other = overlapping(
            np.column_stack([own_plane, np.floor(own_low), np.ceil(own_high)]),
            np.column_stack([plane[flat, axis], np.floor(low + LEAST_OVERLAP), np.ceil(high - LEAST_OVERLAP)]),
        )
        looks_up = np.sign(plane[flat, axis] - inside[flat, axis])
        same_side = np.sign(own_outward[own, axis])[mine] == looks_up[other]
        # The same corners: the same bounds, and a quad that fills them.
        to_bounds = np.minimum(np.abs(corners[flat][..., across] - low[:, None]), np.abs(corners[flat][..., across] - high[:, None]))
        fills = to_bounds.max(axis=(1, 2), initial=0.0) < LEAST_OVERLAP
        equal = np.abs(np.hstack([own_low, own_high])[mine] - np.hstack([low, high])[other]).max(axis=1, initial=0.0) < LEAST_OVERLAP
        found.append((own[mine], flat[other], same_side, equal & fills[other]))
    mine, other, same_side, whole = (np.concatenate(column) for column in zip(*found, strict=True))
    return (mine, other, same_side, whole) if larger is first else (other, mine, same_side, whole)


def overlapping(one, other):
    """Pairs of rectangles of two lists that share a cell, each pair once. Rows are (plane, low 0, low 1, high 0, high 1), whole numbers."""
    one, other = one.astype(np.int64), other.astype(np.int64)
    none = np.zeros(0, dtype=np.int64)
    if len(one) == 0 or len(other) == 0:
        return none, none
    # Leave out what is in no plane of the other list, or outside of its bounds.
    low = np.maximum(one[:, :3].min(axis=0), other[:, :3].min(axis=0))
    high = np.minimum(one[:, [0, 3, 4]].max(axis=0), other[:, [0, 3, 4]].max(axis=0))
    span = [int(n) for n in np.maximum(high - low + 1, 1)]
    if span[0] * span[1] * span[2] >= 2**62:
        raise SystemExit(f"volumes that touch: expected fewer than 2^62 cells where two of them meet, got {span[0]} x {span[1]} x {span[2]}")
    keys, owners = [], []
    for rows, planes in ((one, other[:, 0]), (other, one[:, 0])):
        there = np.isin(rows[:, 0], planes) & (rows[:, 1:3] < high[1:]).all(axis=1) & (rows[:, 3:] > low[1:]).all(axis=1)
        there = np.flatnonzero(there)
        owner, cell = cells(np.maximum(rows[there, 1:3], low[1:]), np.minimum(rows[there, 3:], high[1:]))
        cell -= low[1:]
        keys.append(((rows[there, 0] - low[0])[owner] * span[1] + cell[:, 0]) * span[2] + cell[:, 1])
        owners.append(there[owner])
    order = np.argsort(keys[0], kind="stable")
    begin, end = (np.searchsorted(keys[0][order], keys[1], side) for side in ("left", "right"))
    count = end - begin
    within = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    pairs = np.unique(owners[0][order][np.repeat(begin, count) + within] * len(other) + np.repeat(owners[1], count))
    return pairs // len(other), pairs % len(other)


def cells(low, high):
    """The unit cells of rectangles (n, 2): index of the rectangle, and the cell's least corner."""
    size = np.maximum(high - low, 0)
    count = size.prod(axis=1)
    owner = np.repeat(np.arange(len(low)), count)
    within = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    return owner, low[owner] + np.column_stack([within % size[owner, 0], within // size[owner, 0]])


def cut_planes(first, second):
    """Number of planes in which polygons that a cut leaves of the one surface may overlap polygons of the other, by their bounds."""
    if first.cut is None and second.cut is None:
        return 0
    polygons = [s.triangles(np.linalg.inv(first.place)) for s in (first, second)]
    size = max((np.abs(every).max(initial=0.0) for _, every in polygons), default=0.0)
    planes = set()
    for (cut, _), (_, every) in (polygons, polygons[::-1]):
        ours, theirs = bounds_by_plane(cut, size), bounds_by_plane(every, size)
        for key in ours.keys() & theirs.keys():
            low, high = np.maximum(ours[key][0], theirs[key][0]), np.minimum(ours[key][1], theirs[key][1])
            # Overlap in two axes at least: in one, the polygons share an edge.
            if ((high - low) > -PLANE_UNIT * size).all() and ((high - low) > PLANE_UNIT * size).sum() >= 2:
                planes.add(key)
    return len(planes)


def bounds_by_plane(triangles, size):
    """Least and largest corner of the triangles (m, 3, 3) in each plane, whichever way they look."""
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    length = np.linalg.norm(normal, axis=1)
    triangles, normal = triangles[length > 0.0], normal[length > 0.0] / length[length > 0.0, None]
    if len(triangles) == 0:
        return {}
    distance = np.einsum("ij,ij->i", normal, triangles[:, 0]) / (size or 1.0)
    keys = np.rint(np.column_stack([normal, distance]) / PLANE_UNIT).astype(np.int64)
    # The first number that is not 0 is positive.
    leading = keys[np.arange(len(keys)), (keys != 0).argmax(axis=1)]
    planes, number = np.unique(keys * np.sign(leading)[:, None], axis=0, return_inverse=True)
    order = np.argsort(number.ravel(), kind="stable")
    begin = np.searchsorted(number.ravel()[order], np.arange(len(planes)))
    low = np.minimum.reduceat(triangles.min(axis=1)[order], begin)
    high = np.maximum.reduceat(triangles.max(axis=1)[order], begin)
    return {tuple(plane): (low[i], high[i]) for i, plane in enumerate(planes.tolist())}
