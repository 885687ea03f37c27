"""Tests how faces that lie in one place go to Cycles (session/src/cycles/coincident_faces.py), against faces counted voxel by voxel."""

import itertools
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "session/src/cycles"))
import coincident_faces  # noqa: E402

GLASS = {"alpha": 1.0, "transmission": 1.0, "base_color": [1.0, 1.0, 1.0]}
DULL = {"alpha": 1.0, "transmission": 0.0, "base_color": [0.5, 0.5, 0.5]}
VEIL = DULL | {"alpha": 0.5}
RED = DULL | {"base_color": [0.9, 0.1, 0.1]}
# Slanted and mirrored, with voxels of three lengths: no coordinate of a face is exact in the world.
TURN = np.linalg.qr(np.array([[0.3, 0.7, -0.2], [0.9, -0.1, 0.4], [0.1, 0.5, 0.8]]))[0] @ np.diag([0.31, -0.17, 0.23])


def placed(move=(0, 0, 0), scale=(1, 1, 1)):
    """The slanted place, moved by voxels, with other voxels."""
    place = np.eye(4)
    place[:3, :3] = TURN @ np.diag(scale)
    place[:3, 3] = TURN @ move + [3.1, -17.7, 0.3]
    return place


def faces_of(labels, interfaces):
    """(corners (m, 4, 3), label of each): the faces of each voxel whose neighbor has another label, one voxel after the other; between labels
    where `interfaces`."""
    corners, owners = [], []
    for voxel in zip(*np.nonzero(labels), strict=True):
        for axis, side in itertools.product(range(3), (0, 1)):
            neighbor = list(voxel)
            neighbor[axis] += 2 * side - 1
            inside = all(0 <= n < size for n, size in zip(neighbor, labels.shape, strict=True))
            other = labels[tuple(neighbor)] if inside else 0
            if other == labels[voxel] or (other and not interfaces):
                continue
            b, c = np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3]
            start = np.array(voxel) + side * np.eye(3)[axis]
            square = [start, start + b, start + b + c, start + c]
            corners.append(square if side else square[::-1])
            owners.append(labels[voxel])
    return np.array(corners), np.array(owners)


def surface(labels, place, body, materials, interfaces=True):
    corners, owner = faces_of(np.asarray(labels), interfaces)
    vertices = corners.reshape(-1, 3)
    # A label's material is that of its number less one.
    return coincident_faces.Surface(
        vertices, np.arange(len(vertices)).reshape(-1, 4), place, body, owner, owner - 1, materials
    )


def world(one, corners=None):
    return (one.corners() if corners is None else corners) @ one.place[:3, :3].T + one.place[:3, 3]


def kept(surfaces):
    """Corners in the world of all faces that Cycles gets."""
    out = []
    for one in surfaces:
        vertices, quads, _ = one.settled()
        out.append(world(one, np.asarray(vertices, dtype=np.float64)[quads]))
    return np.concatenate(out)


def places(corners):
    """How many faces lie in each place, by their middles to a millionth."""
    return Counter(map(tuple, np.rint(1e6 * corners.mean(axis=1)).astype(int).tolist()))


SLAB = np.ones((2, 3, 4), dtype=int)


def test_parts_of_one_body_have_the_faces_of_the_whole():
    parts = [surface(SLAB, placed((x, 0, 0)), 0, [GLASS]) for x in (4, 0, 2)]
    assert coincident_faces.settle(parts) == []
    whole = surface(np.ones((6, 3, 4), dtype=int), placed(), 0, [GLASS])
    assert places(kept(parts)) == places(world(whole))
    # Negative control: as bodies of their own they keep their faces.
    own = [surface(SLAB, placed((x, 0, 0)), body, [GLASS]) for body, x in enumerate((4, 0, 2))]
    assert coincident_faces.settle(own) == []
    assert len(kept(own)) == len(world(whole)) + 4 * 3 * 4


def test_labels_of_a_body_that_differ_keep_their_faces():
    """Two parts of one volume with two labels, of which one goes on in the other part and one meets the other."""
    low = np.ones((2, 3, 4), dtype=int)
    low[:, 2] = 2
    high = np.ones((2, 3, 4), dtype=int)
    pair = [surface(low, placed(), 0, [GLASS, DULL]), surface(high, placed((2, 0, 0)), 0, [GLASS, DULL])]
    assert coincident_faces.settle(pair) == []
    whole = surface(np.concatenate([low, high]), placed(), 0, [GLASS, DULL])
    assert len(kept(pair)) == len(world(whole)), "two faces for each pair of labels, none within a label"
    assert [int(one.dropped.sum()) for one in pair] == [8, 8]


@pytest.mark.parametrize(("first", "other"), [(GLASS, GLASS), (GLASS, DULL), (DULL, GLASS), (DULL, VEIL), (VEIL, RED)])
def test_no_two_faces_of_labels_that_touch_coincide(first, other):
    pair = [surface(SLAB, placed(), 0, [first]), surface(SLAB, placed((2, 1, 0)), 1, [other])]
    before = places(np.concatenate([world(one) for one in pair]))
    assert max(before.values()) == 2, "negative control: they coincide before"
    assert coincident_faces.settle(pair) == []
    after = kept(pair)
    assert max(places(after).values()) == 1
    # Each of the 2 × 4 that touch has moved by half of the gap into its own label: along x of the first, and against it of the second.
    for one, sign in zip(pair, (-1, 1), strict=True):
        vertices, quads, _ = one.settled()
        moves = np.asarray(vertices)[quads] - one.corners()
        moved = np.abs(moves).max(axis=(1, 2)) > 0
        assert moved.sum() == 8
        expected = [sign * 2.0**-10, 0, 0]
        assert np.abs(moves[moved] - expected).max() < 1e-12


def test_opaque_labels_that_touch_stay_in_their_place():
    pair = [surface(SLAB, placed(), 0, [DULL]), surface(SLAB, placed((2, 0, 0)), 1, [RED])]
    assert coincident_faces.settle(pair) == []
    assert np.array_equal(kept(pair), np.concatenate([world(one) for one in pair]))


def test_labels_split_among_instances_are_as_in_one_volume():
    labels = np.random.default_rng(5).integers(1, 4, (5, 4, 6))
    materials = [GLASS, DULL, GLASS | {"base_color": [0.5, 0.5, 1.0]}]
    split = [surface(np.where(labels == number, number, 0), placed(), number, materials) for number in (1, 2, 3)]
    assert coincident_faces.settle(split) == []
    whole = surface(labels, placed(), 0, materials)
    assert places(kept(split)) == places(kept([whole]))
    assert max(places(kept(split)).values()) == 1


@pytest.mark.parametrize("order", [(0, 1, 2), (1, 2, 0), (2, 0, 1)])
def test_voxels_of_other_sizes_and_turns_touch_too(order):
    """A slab of voxels of a third of the length, moved by no whole voxel, and one that is turned in the plane."""
    first = surface(SLAB, placed(), 0, [GLASS])
    fine = surface(np.ones((3, 5, 5), dtype=int), placed((2, 0.37, 0.81), (1 / 3, 1 / 3, 1 / 3)), 1, [GLASS])
    angle = 0.4
    turn = np.eye(4)
    turn[1:3, 1:3] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    turned = surface(np.ones((2, 1, 1), dtype=int), placed((-2, 0.2, 0.3)) @ turn, 2, [GLASS])
    trio = [first, fine, turned]
    assert coincident_faces.settle([trio[i] for i in order]) == []
    x = [np.abs(one.corners()[..., 0] - one.corners()[:, :1, 0]).max(axis=1) < 0.5 for one in trio]
    high = x[0] & (first.corners()[:, 0, 0] == 2)
    low = x[0] & (first.corners()[:, 0, 0] == 0)
    # By intervals: the fine slab covers 0.37 to 2.04 of y and 0.81 to 2.48 of z, so rows 0 to 2 of both, all 25 of its faces meet.
    covered = first.corners()[high].min(axis=1)
    assert set(map(tuple, covered[first.moved[high]][:, 1:].tolist())) == set(itertools.product((0.0, 1.0, 2.0), (0.0, 1.0, 2.0)))
    assert fine.moved.sum() == 25 and turned.moved.sum() == 1
    # The turned square has its corners at (0.2, 0.3), (1.12, 0.69), (0.73, 1.61) and (-0.19, 1.22). Its bounds reach into a fourth face.
    covered = set(map(tuple, first.corners()[low].min(axis=1)[first.moved[low]][:, 1:].tolist()))
    exact = {(0.0, 0.0), (0.0, 1.0), (1.0, 0.0)}
    assert exact <= covered <= exact | {(1.0, 1.0)}
    assert not first.moved[~high & ~low].any()
    # Negative control: a thousandth of a voxel away nothing touches.
    away = [first, surface(SLAB, placed((2.001, 0, 0)), 1, [GLASS])]
    first.moved[:] = False
    assert coincident_faces.settle(away) == [] and not any(one.moved.any() for one in away)


@pytest.mark.parametrize(("distance", "is_touching"), [(-3e-7, True), (3e-7, True), (8e-7, False), (-8e-7, False)])
def test_faces_within_a_share_of_the_thinnest_voxel_touch(distance, is_touching):
    """2⁻²⁰ of the thinnest voxel, 0.17, are 5.2e-7 of a voxel of 0.31."""
    pair = [surface(SLAB, placed(), 0, [GLASS]), surface(SLAB, placed((2 + distance, 0, 0)), 1, [GLASS])]
    coincident_faces.settle(pair)
    assert [bool(one.moved.any()) for one in pair] == [is_touching, is_touching]


@pytest.mark.parametrize(
    ("materials", "expected"),
    [
        ([DULL, RED], []),
        ([GLASS, DULL], ["faces of two volumes in one place that look the same way (12)"]),
        ([GLASS, GLASS], ["faces of two volumes in one place that look the same way (12)"]),
    ],
)
def test_flush_faces_of_overlapping_volumes_have_the_first_or_no_order(materials, expected):
    """Two slabs of 2 × 3 × 3 voxels that overlap in one layer of x: there the faces at both ends of y and of z coincide."""
    pair = [
        surface(np.ones((2, 3, 3), dtype=int), placed(), 0, [materials[0]]),
        surface(np.ones((2, 3, 3), dtype=int), placed((1, 0, 0)), 1, [materials[1]]),
    ]
    assert coincident_faces.settle(pair) == expected
    assert pair[1].dropped.sum() == (0 if expected else 12), "one layer: 4 sides of 3 faces"
    assert not pair[0].dropped.any() and not any(one.moved.any() for one in pair)


def test_parts_of_a_body_that_overlap_by_half_a_face_have_no_order():
    pair = [surface(SLAB, placed((x, y, 0)), 0, [GLASS]) for x, y in ((0, 0), (2, 0.5))]
    lines = coincident_faces.settle(pair)
    # Each of 3 × 4 faces meets two of the other, but for the last row.
    assert lines == ["faces of two parts of one body in one plane that overlap in part (20)"]
    assert not any(one.dropped.any() or one.moved.any() for one in pair)


def test_a_turned_face_within_the_bounds_of_another_is_no_whole_face():
    """A square of half the area, turned by 45° within a square: parts of one body that overlap in part."""
    half = np.sqrt(0.5)
    turn = np.eye(4)
    turn[1:3, 1:3] = half * np.array([[half, -half], [half, half]])
    turned = surface(np.ones((1, 1, 1), dtype=int), placed((1, 0.5, 0)) @ turn, 0, [GLASS])
    whole = surface(np.ones((1, 1, 1), dtype=int), placed(), 0, [GLASS])
    assert coincident_faces.settle([whole, turned]) == ["faces of two parts of one body in one plane that overlap in part (1)"]
    assert not whole.dropped.any() and not turned.dropped.any()


@pytest.mark.parametrize(
    ("materials", "expected"), [([DULL, dict(DULL)], []), ([DULL, RED], ["faces of two volumes in one place that look the same way (12)"])]
)
def test_opaque_faces_that_overlap_in_part_have_an_order_where_they_look_alike(materials, expected):
    """Two rods of two voxels, the other half a voxel along x: on each of four sides three pairs of faces overlap."""
    pair = [surface(np.ones((2, 1, 1), dtype=int), placed((x, 0, 0)), body, [materials[body]]) for body, x in enumerate((0, 0.5))]
    assert coincident_faces.settle(pair) == expected
    assert not any(one.dropped.any() for one in pair)


def test_caps_of_one_cut_have_no_order():
    """The two halves that a plane divides, each with its cap; caps apart from each other are none of that."""
    cap = np.array([[[2.5, 0, 0], [2.5, 3, 0], [2.5, 3, 4]], [[2.5, 0, 0], [2.5, 3, 4], [2.5, 0, 4]]])

    def cut(x, move, cap):
        one = surface(SLAB, placed((x, 0, move)), 0, [GLASS])
        one.cut = cap - [x, 0, 0]
        return one

    pair = [cut(0, 0, cap), cut(3, 0, cap[:, ::-1])]
    assert coincident_faces.settle(pair) == ["planes in which faces of two volumes lie, where a cut passes (1)"]
    assert coincident_faces.settle([cut(0, 0, cap), cut(3, 4, cap[:, ::-1])]) == []


def test_many_labels_are_settled_without_a_loop_over_them():
    """6,000 labels of one voxel each beside as many."""
    side = (30, 20, 10)
    labels = np.arange(1, np.prod(side) + 1).reshape(side)
    axis_faces = []
    for axis, up in itertools.product(range(3), (0, 1)):
        b, c = np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3]
        start = np.stack(np.meshgrid(*map(np.arange, side), indexing="ij"), axis=-1).reshape(-1, 3) + up * np.eye(3)[axis]
        square = np.stack([start, start + b, start + b + c, start + c], axis=1)
        axis_faces.append(square if up else square[:, ::-1])
    corners = np.concatenate(axis_faces)
    owner = np.tile(labels.ravel(), 6)
    vertices, quads = corners.reshape(-1, 3), np.arange(4 * len(corners)).reshape(-1, 4)
    pair = [
        coincident_faces.Surface(vertices, quads, placed(move), body, owner, np.zeros(len(owner), dtype=int), [GLASS])
        for body, move in enumerate([(0, 0, 0), (30, 0, 0)])
    ]
    inner = 6 * labels.size - 2 * (30 * 20 + 20 * 10 + 30 * 10)
    assert [int(one.moved.sum()) for one in pair] == [inner, inner]
    assert coincident_faces.settle(pair) == []
    assert [int(one.moved.sum()) for one in pair] == [inner + 200, inner + 200]
