"""Tests meshes from arrays: accepted and refused arrays, and meshes in live pictures and renders."""

import numpy as np
import pumice
import pytest

CORNERS = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
FACES = [[0, 1, 2], [0, 3, 1]]


def test_a_mesh_of_arrays_of_any_kind():
    meshes = [
        pumice.Mesh(CORNERS, FACES),
        pumice.Mesh(np.array(CORNERS), np.array(FACES, dtype=np.uint32), [0, 0]),
        pumice.Mesh(np.array(CORNERS, dtype=np.float32)[::1], np.asfortranarray(np.array(FACES, dtype=np.int16))),
    ]
    assert [m.triangles for m in meshes] == [2, 2, 2]
    assert len({mesh.content_hash for mesh in meshes}) == 1 and len(meshes[0].content_hash) == 32
    assert meshes[0].bytes_resident == 4 * 24 + 2 * 12 and meshes[1].bytes_resident == 4 * 24 + 2 * 12 + 2 * 4
    assert pumice.Mesh(CORNERS, FACES, [0, 1]).content_hash != meshes[1].content_hash
    assert repr(meshes[0]) == "<pumice.Mesh 4 corners, 2 triangles, 120 bytes>"
    assert pumice.Mesh([], []).triangles == 0


@pytest.mark.parametrize(
    "positions,triangles,materials,said",
    [
        (CORNERS, [[0, 1, 4]], None, "triangle 0: expected corners below 4, got 4"),
        ([[0.0, np.nan, 0.0]], [], None, "corner 0: expected finite numbers"),
        (CORNERS, FACES, [0], "expected a material for each of 2 triangles, got 1"),
        (CORNERS, [[0, 1, -1]], None, "triangles: expected whole numbers from 0"),
        (CORNERS, [[0.0, 1.0, 2.0]], None, "triangles: expected whole numbers from 0"),
        (CORNERS, [[0, 1, 2, 3]], None, "triangles: expected an array of shape (n, 3), got (1, 4)"),
        ([0.0, 1.0, 2.0], FACES, None, "positions: expected an array of shape (n, 3), got (3,)"),
        ("corners", FACES, None, "positions: "),
        ([[0.0, 1.0], [2.0]], FACES, None, "positions: "),
        (CORNERS, FACES, [0, 2**32], "materials: expected whole numbers from 0"),
    ],
)
def test_what_is_no_mesh_is_refused_by_name(positions, triangles, materials, said):
    with pytest.raises(pumice.InputError) as raised:
        pumice.Mesh(positions, triangles, materials)
    assert said in str(raised.value) and str(raised.value).startswith("mesh: ") and "\n" not in str(raised.value)


PLY = """ply
format ascii 1.0
comment a square and a triangle
element vertex 5
property float x
property float y
property float z
element face 2
property list uchar int vertex_indices
property int material_index
end_header
0 0 0
1 0 0
1 1 0
0 1 0
0 0 1
4 0 1 2 3 0
3 0 3 4 2
"""


def test_a_mesh_that_was_saved_is_opened_again(tmp_path):
    path = tmp_path / "m.ply"
    for mesh in (
        pumice.Mesh(CORNERS, FACES),
        pumice.Mesh(np.array(CORNERS) / 3, FACES, [0, 7]),
        pumice.Mesh(CORNERS, FACES, [1, 0], normals=[[0.5, 0, 1]] * 4),
    ):
        mesh.save(path)
        opened = pumice.Mesh.open(path)
        assert isinstance(opened, pumice.Mesh) and opened.content_hash == mesh.content_hash
        assert (opened.triangles, opened.is_smooth) == (mesh.triangles, mesh.is_smooth)
        assert pumice.Mesh.open(str(path)).content_hash == mesh.content_hash
    # Control: the last one has materials and normals.
    assert pumice.Mesh.open(path).content_hash != pumice.Mesh(CORNERS, FACES).content_hash


def test_a_mesh_of_another_program_is_the_one_of_its_numbers(tmp_path):
    """The text is written by hand: a polygon becomes a fan of triangles about its first corner."""
    path = tmp_path / "m.ply"
    path.write_text(PLY)
    corners = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1]]
    opened = pumice.Mesh.open(path)
    assert opened.content_hash == pumice.Mesh(corners, [[0, 1, 2], [0, 2, 3], [0, 3, 4]], [0, 0, 2]).content_hash
    assert opened.content_hash != pumice.Mesh(corners, [[0, 1, 2], [0, 2, 3], [0, 3, 4]], [0, 0, 1]).content_hash


@pytest.mark.parametrize(
    "text,said",
    [
        (None, "No such file"),
        ("solid cube", "expected a PLY mesh"),
        (PLY.replace("0 0 1\n4", "0 0 nan\n4"), "expected finite numbers"),
        (PLY.replace("3 0 3 4 2", "3 0 3 9 2"), "got 9"),
        (PLY[:-20], ""),
        (PLY.replace("vertex 5", "vertex 99999999999"), ""),
    ],
)
def test_a_file_that_is_no_mesh_is_refused_in_one_line(tmp_path, text, said):
    path = tmp_path / "m.ply"
    if text is not None:
        path.write_text(text)
    with pytest.raises(pumice.InputError) as raised:
        pumice.Mesh.open(path)
    assert said in str(raised.value) and "m.ply" in str(raised.value) and "\n" not in str(raised.value)
    with pytest.raises(pumice.InputError, match="expected an ordinary file, got a device"):
        pumice.Mesh.open("/dev/zero")
    with pytest.raises(pumice.InputError, match="path: expected a path, got int"):
        pumice.Mesh.open(3)


def test_normals_make_a_mesh_smooth():
    up, bent = [0.0, 0.0, 1.0], [0.5, 0.0, 1.0]
    flat, by_corner = pumice.Mesh(CORNERS, FACES), pumice.Mesh(CORNERS, FACES, normals=[bent, bent, up, up])
    by_triangle = pumice.Mesh(CORNERS, FACES, normals=np.array([bent, bent, up, up])[np.array(FACES)])
    assert by_corner.is_smooth and not flat.is_smooth and by_corner.content_hash == by_triangle.content_hash
    assert by_corner.bytes_resident == flat.bytes_resident + 2 * 12
    # The lengths of normals do not matter. A normal that equals the triangle's own, or is 0, counts as none.
    assert pumice.Mesh(CORNERS, FACES, normals=np.array([bent, bent, up, up]) * 7).content_hash == by_corner.content_hash
    one = pumice.Mesh(CORNERS, FACES[:1])
    assert pumice.Mesh(CORNERS, FACES[:1], normals=[up, [0, 0, 0], [0, 0, 3], bent]).content_hash == one.content_hash


@pytest.mark.parametrize(
    "normals,said",
    [
        ([[0, 0, 1]] * 3, "expected a normal for each of 4 corners, got 3"),
        (np.zeros((3, 3, 3)), "expected a normal for each of 6 corners of triangles, got 9"),
        ([[0, 0, 1]] * 3 + [[0, np.inf, 1]], "normal 3: expected finite numbers, got [0.0, inf, 1.0]"),
        ([[0, 1]] * 4, "normals: expected an array of shape (n, 3), got (4, 2)"),
        (np.zeros((2, 4, 3)), "normals: expected an array of shape (n, 3, 3), got (2, 4, 3)"),
        ([[1e300, 0, 0]] * 4, "normal 0: expected finite numbers"),
        ("up", "normals: "),
    ],
)
def test_bad_normals_are_refused_by_name(normals, said):
    with np.errstate(over="ignore"), pytest.raises(pumice.InputError) as raised:
        pumice.Mesh(CORNERS, FACES, normals=normals)
    assert said in str(raised.value) and str(raised.value).startswith("mesh: ") and "\n" not in str(raised.value)


def test_a_picture_shows_a_mesh_where_it_is(volume):
    """A tilted square has the depth of its plane, and each triangle the colour of its material."""
    fields = pumice.figure(volume, size=(24, 20)).to_dict()
    camera = fields["camera"]
    camera["world_from_camera"] = [1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 10]
    camera["projection"] = {"orthographic": {"scale": 6.0}}
    camera["clip"] = [0.0, 1e9]
    # The square is far from the volume, rises by 1 from x = 0 to 2, and has a mirroring matrix.
    colors = [[0.9, 0.1, 0.1], [0.1, 0.1, 0.9]]
    materials = [{"base_color": color, "roughness": 1.0, "specular": 0.0} for color in colors]
    place = [-1, 0, -0.5, 0, 1, 0, 0, 0, 1, 2, 0, 1]
    fields["meshes"] = [{"id": 7, "source": "floor", "world_from_mesh": place, "materials": materials}]
    fields["instances"][0]["world_from_index"] = [1, 0, 0, 0, 1, 0, 0, 0, 1, 1e6, 0, 0]
    corners = [[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]]
    square = pumice.Mesh(corners, [[0, 1, 2], [0, 2, 3]], [0, 1])
    picture = pumice.render(pumice.Scene.from_dict(fields), volume, meshes=[square], spp=4, backend="cpu")
    x = (np.arange(24) + 0.5) / 4 - 3
    y = 2.5 - (np.arange(20) + 0.5) / 4
    x, y = np.meshgrid(x, y)
    inside = (x > 0) & (x < 2) & (y > 0) & (y < 2)
    assert np.array_equal(np.isfinite(picture.depth), inside) and inside.sum() == 64
    assert np.abs(picture.depth - (10 - x / 2))[inside].max() < 1e-5
    # Leaves out the diagonal from (2, 0) to (0, 2), on which pixels belong to either triangle.
    off = np.abs(x + y - 2) > 0.1
    expected = np.where((x + y < 2)[..., None], colors[0], colors[1])
    assert np.abs(picture.albedo - expected)[inside & off].max() < 1e-6
    assert not picture.label[inside].any()
    lit = picture.color[inside & off]
    assert (lit.max(axis=-1) > 0.01).all()
    # The scene is refused without its mesh, and another mesh gives another picture.
    smaller = pumice.Mesh([[v / 2 for v in c] for c in corners], [[0, 1, 2], [0, 2, 3]])
    other = pumice.render(pumice.Scene.from_dict(fields), volume, meshes=[smaller], spp=1, backend="cpu")
    assert np.isfinite(other.depth).sum() == 16


def test_as_many_meshes_as_the_scene_has(volume):
    scene = pumice.figure(volume, size=(16, 12)).to_dict()
    place = [1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0]
    fields = {"id": 7, "source": "floor", "world_from_mesh": place, "materials": [{}]}
    with_mesh = pumice.Scene.from_dict({**scene, "meshes": [fields]})
    with pytest.raises(pumice.InputError, match="mesh"):
        pumice.render(with_mesh, volume, spp=1)
    with pumice.Session(pumice.Scene.from_dict(scene), [volume], backend="cpu", spp=1) as session:
        before = session.status.revision
        assert session.add_mesh(fields, pumice.Mesh(CORNERS, FACES)) == before + 1
        assert [m["id"] for m in session.scene.to_dict()["meshes"]] == [7]
        assert session.edit({"edit": "remove_mesh", "id": 7}) == before + 2
        with pytest.raises(pumice.InputError, match="world_from_mesh"):
            session.add_mesh({**fields, "world_from_mesh": [0] * 12}, pumice.Mesh(CORNERS, FACES))
