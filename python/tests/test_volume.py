"""Tests volumes and their label tables against numpy."""

import ctypes
import warnings

import numpy as np
import pumice
import pytest


def test_the_label_table_against_numpy(volume, labels):
    table = volume.labels
    ids, counts = np.unique(labels[labels > 0], return_counts=True)
    np.testing.assert_array_equal(table.ids, ids)
    np.testing.assert_array_equal(table.voxels, counts)
    for row, label in enumerate(ids):
        where = np.argwhere(labels == label)
        np.testing.assert_array_equal(table.low[row], where.min(axis=0))
        np.testing.assert_array_equal(table.high[row], where.max(axis=0))
        assert table.index_of(int(label)) == row
    assert int(table.boxes.sum()) == volume.boxes
    assert [column.dtype for column in (table.ids, table.voxels, table.boxes, table.low)] == ["u8", "u8", "u4", "u4"]
    with pytest.raises(pumice.InputError, match="no label 251"):
        table.index_of(251)
    with pytest.raises(pumice.InputError, match="label: expected 0 to"):
        table.index_of(-1)


def test_columns_show_memory_that_cannot_be_changed(volume):
    ids = volume.labels.ids
    assert not ids.flags.writeable and not ids.flags.owndata
    with pytest.raises(ValueError):
        ids[0] = 3
    with pytest.raises(ValueError):
        ids.flags.writeable = True
    # A request for a writable buffer is refused by the buffer protocol itself.
    with pytest.raises(TypeError, match="not writable"):
        (ctypes.c_char * 8).from_buffer(volume._native.ids())


class PyBuffer(ctypes.Structure):
    """The structure Py_buffer of CPython."""

    _fields_ = [
        *((name, kind) for name, kind in [("buf", ctypes.c_void_p), ("obj", ctypes.py_object)]),
        *((name, ctypes.c_ssize_t) for name in ("len", "itemsize")),
        *((name, ctypes.c_int) for name in ("readonly", "ndim")),
        *((name, ctypes.c_void_p) for name in ("format", "shape", "strides", "suboffsets", "internal")),
    ]


@pytest.mark.parametrize(
    ("flags", "given"),
    [
        (0x000, True),  # SIMPLE: plain bytes
        (0x008, True),  # ND
        (0x018, True),  # STRIDES
        (0x038, True),  # C_CONTIGUOUS
        (0x098, True),  # ANY_CONTIGUOUS
        (0x11C, True),  # FULL_RO
        (0x058, False),  # F_CONTIGUOUS
        (0x001, False),  # WRITABLE
    ],
)
def test_a_buffer_is_given_as_asked_for_or_refused(volume, flags, given):
    array, view = volume._native.bounds()[0], PyBuffer()
    get = ctypes.pythonapi.PyObject_GetBuffer
    get.argtypes = [ctypes.py_object, ctypes.POINTER(PyBuffer), ctypes.c_int]
    if not given:
        with pytest.raises(BufferError):
            get(array, view, flags)
        return
    assert get(array, view, flags) == 0
    assert (view.len, view.itemsize, view.readonly) == (12 * len(volume.labels), 4, 1)
    assert [bool(view.shape), bool(view.strides), bool(view.format)] == [flags & f == f for f in (0x8, 0x18, 0x4)]
    assert ctypes.string_at(view.buf, view.len) == np.asarray(array).tobytes()
    ctypes.pythonapi.PyBuffer_Release(ctypes.byref(view))


def test_bytes_in_memory_are_those_of_now(labels):
    volume = pumice.compress(labels)
    before = volume.bytes_resident
    assert "index" not in volume.resident_parts and before == sum(volume.resident_parts.values())
    volume.label_at(0, 0, 0)
    assert volume.bytes_resident == before + volume.resident_parts["index"] > before


def test_contacts_against_a_shift_of_the_array(volume, labels):
    wanted = set()
    for axis in range(3):
        a = np.moveaxis(labels, axis, 0)
        left, right = a[:-1].ravel(), a[1:].ravel()
        touch = (left != right) & (left > 0) & (right > 0)
        wanted |= {tuple(sorted(pair)) for pair in zip(left[touch].tolist(), right[touch].tolist(), strict=True)}
    ids = volume.labels.ids
    got = {tuple(sorted((int(ids[a]), int(ids[b])))) for a, b in volume.contacts}
    assert got == wanted and wanted


def test_boxes_cover_their_labels_and_no_other_voxel_twice(volume, labels):
    origins, extents, rows = volume.box_arrays()
    assert len(origins) == volume.boxes
    covered = np.zeros((len(volume.labels), *labels.shape), np.uint8)
    for origin, extent, row in zip(origins, extents, rows, strict=True):
        low, high = np.maximum(origin, 0), origin + extent
        covered[row][tuple(slice(a, b) for a, b in zip(low, high, strict=True))] += 1
    assert covered.max() == 1
    for row, label in enumerate(volume.labels.ids):
        assert covered[row][labels == label].all()


def test_label_at(volume, labels):
    rng = np.random.default_rng(3)
    for x, y, z in rng.integers(0, labels.shape, (200, 3)):
        assert volume.label_at(int(x), int(y), int(z)) == labels[x, y, z]
    assert volume.label_at(-1, 0, 0) == 0 and volume.label_at(40, 0, 0) == 0


def test_place_and_names(labels):
    matrix = np.array([[0, 2, 0, 5], [1, 0, 0, 6], [0, 0, -3, 7], [0, 0, 0, 1.0]])
    label = int(labels.max())
    volume = pumice.compress(labels, world_from_index=matrix, unit="mm", names={label: "größte"}, types={label: "cell"})
    np.testing.assert_array_equal(volume.world_from_index, matrix)
    assert volume.spacing == (1.0, 2.0, 3.0) and volume.unit == "mm" and volume.dims == labels.shape
    row = volume.labels.index_of(label)
    assert volume.labels.names[row] == "größte" and volume.labels.types[row] == "cell"
    assert volume.labels.types.count("") == len(volume.labels) - 1
    assert np.isnan(volume.labels.colors).all()


def test_saved_and_opened_it_is_the_same(volume, labels, tmp_path):
    for level in ["fast", "default", "small"]:
        path = tmp_path / f"{level}.pumice"
        volume.save(path, level=level)
        again = pumice.open(path)
        assert again.content_hash == volume.content_hash
        np.testing.assert_array_equal(again.decode(), labels)
    assert pumice.probe(path)["labels"] == len(volume.labels)
    # A file of level small is read whole: all boxes are held, and rays need those of one label alone.
    found = pumice.probe(path, query=str(volume.labels.ids[0]))
    assert found["shown"]["labels"] == 1 and found["shown"]["boxes"] == found["boxes"]
    assert found["shown"]["resident_parts"]["bricks"] < found["resident_parts"]["bricks"]
    with pytest.raises(pumice.InputError, match="no label of the volume matches"):
        pumice.probe(path, query="voxels>1e12")
    with pytest.raises(pumice.InputError, match="expected fast, default or small"):
        volume.save(path, level="tiny")


def test_a_mapped_file_is_the_same_volume_and_takes_no_memory_for_boxes_and_nodes(volume, labels, tmp_path):
    path = tmp_path / "a.pumice"
    volume.save(path, level="fast")
    mapped = pumice.open(path, mapped=True)
    parts = mapped.resident_parts
    assert 0.9 * (parts["boxes"] + parts["nodes"]) < mapped.bytes_mapped <= parts["boxes"] + parts["nodes"]
    # A volume builds an index on the first request for a voxel, so this compares with a newly opened one.
    copied = pumice.open(path)
    assert mapped.bytes_resident == copied.bytes_resident and copied.bytes_mapped == 0
    # Saving replaces the file, so the mapped volume stays unchanged.
    other = np.ones((5, 5, 5), np.uint8)
    pumice.compress(other).save(path, level="fast")
    np.testing.assert_array_equal(mapped.decode(), labels)
    np.testing.assert_array_equal(pumice.open(path, mapped=True).decode(), other)
    # A compressed file has nothing that could be mapped.
    volume.save(path, level="default")
    assert pumice.open(path, mapped=True).bytes_mapped == 0


@pytest.mark.parametrize("level", ["fast", "default"])
def test_labels_that_are_read_alone(volume, labels, level, tmp_path):
    path = tmp_path / "a.pumice"
    volume.save(path, level=level)
    chosen = volume.labels.ids[1::3]
    part = pumice.open(path, labels=chosen)
    np.testing.assert_array_equal(part.decode(), np.where(np.isin(labels, chosen), labels, 0))
    np.testing.assert_array_equal(part.labels.ids, volume.labels.ids)
    np.testing.assert_array_equal(part.labels.boxes > 0, np.isin(volume.labels.ids, chosen))
    np.testing.assert_array_equal(part.contacts, volume.contacts)
    assert volume.is_whole and not part.is_whole and part.content_hash == volume.content_hash
    assert part.bytes_resident < volume.bytes_resident
    # A part of a volume cannot be saved, and labels that were not read cannot be shown or selected.
    with pytest.raises(pumice.PumiceError, match="only chosen labels were read"):
        part.save(tmp_path / "b.pumice")
    assert not (tmp_path / "b.pumice").exists()
    hidden = int(np.setdiff1d(volume.labels.ids, chosen)[0])
    scene = pumice.figure(volume, labels=[hidden], size=(16, 16))
    with pytest.raises(pumice.PumiceError, match=f"instances.0..style.show: label {hidden} was not read"):
        pumice.render(scene, part, spp=1)
    shown = pumice.figure(part, pick=1000, size=(16, 16)).to_dict()["instances"][0]["style"]["show"]["only"]
    assert sorted(shown) == chosen.tolist()


@pytest.mark.parametrize("level", ["fast", "default"])
def test_labels_that_are_added(volume, labels, level, tmp_path):
    path = tmp_path / "a.pumice"
    volume.save(path, level=level)
    ids = volume.labels.ids
    first = pumice.open(path, labels=ids[::3])
    # Those that it holds already may be named again.
    both = first.with_labels(ids[:10])
    chosen = np.union1d(ids[::3], ids[:10])
    at_once = pumice.open(path, labels=chosen)
    np.testing.assert_array_equal(both.decode(), np.where(np.isin(labels, chosen), labels, 0))
    np.testing.assert_array_equal(both.labels.boxes, at_once.labels.boxes)
    assert (both.content_hash, both.is_whole) == (volume.content_hash, False)
    # The volume that labels were added to stays as it was.
    np.testing.assert_array_equal(first.decode(), np.where(np.isin(labels, ids[::3]), labels, 0))
    scene = pumice.figure(at_once, size=(32, 18))
    pictures = [pumice.render(scene, one, spp=2, backend="cpu").color for one in (both, at_once)]
    np.testing.assert_array_equal(*pictures)
    whole = both.with_labels(ids)
    np.testing.assert_array_equal(whole.decode(), labels)
    assert whole.is_whole and whole.with_labels(ids[:3]) is whole
    for other in (first, whole):
        with pytest.raises(pumice.InputError, match="the volume has no label"):
            other.with_labels([int(ids.max()) + 1])
    pumice.compress(np.ones((5, 5, 5), np.uint8)).save(path)
    with pytest.raises(pumice.InputError, match="the volume has no label|the file has changed"):
        first.with_labels(ids)


def test_labels_cannot_be_read_alone_from_other_files(volume, cortex, tmp_path):
    volume.save(tmp_path / "a.pumice")
    with pytest.raises(pumice.InputError, match="the volume has no label 251"):
        pumice.open(tmp_path / "a.pumice", labels=[int(volume.labels.ids[0]), 251])
    with pytest.raises(pumice.InputError, match="is not a .pumice file"):
        pumice.open(cortex, labels=[1])
    with pytest.raises(pumice.InputError, match="labels: expected 0 to"):
        pumice.open(tmp_path / "a.pumice", labels=[-1])


def test_files_of_others(cortex):
    volume = pumice.open(cortex)
    assert volume.dims == (256, 256, 512) and volume.spacing == (32.0, 32.0, 40.0) and volume.unit == "nm"
    assert len(volume.labels) == 2511
    assert pumice.compress(cortex, threads=1).content_hash == volume.content_hash
    volume.verify(cortex)


def test_verify_says_what_differs(volume, labels):
    other = labels.copy()
    x, y, z = np.argwhere(labels > 0)[100]
    other[x, y, z] = 251
    with pytest.raises(pumice.InputError, match="251"):
        volume.verify(other)
    with pytest.raises(pumice.InputError, match="40"):
        volume.verify(labels[:-1])


def test_keywords_choose_in_files_alone(volume, labels, cortex):
    with pytest.raises(pumice.InputError, match="layer: an array is read as it is"):
        volume.verify(labels, layer=0)
    layers = cortex.with_name("slicer_SegmentationOverlapping.seg.nrrd")
    with pytest.raises(pumice.InputError, match=r"choose one with layer= \(0: ribs"):
        pumice.open(layers)
    assert pumice.open(layers, layer=0).content_hash != pumice.open(layers, layer=1).content_hash
    for call in (pumice.open, pumice.probe, pumice.compress):
        with pytest.raises(pumice.InputError, match="layer: expected 0 to"):
            call(layers, layer=-1)
        with pytest.raises(pumice.InputError, match="spacing: expected three lengths above 0"):
            call(layers, layer=0, spacing=(1, -1, 1))


def test_what_is_odd_in_a_file_is_a_warning(tmp_path):
    np.save(tmp_path / "a.npy", np.ones((3, 3, 3), np.uint8))
    with (tmp_path / "a.npy").open("ab") as file:
        file.write(b"tail")
    for call in (pumice.open, pumice.compress):
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            call(tmp_path / "a.npy")
        assert any("4 bytes after the last voxel" in str(w.message) for w in told)
        assert all(w.category is pumice.PumiceWarning for w in told)
        assert all(w.filename == __file__ for w in told), "the warning names the calling line"


@pytest.mark.parametrize("name", ["absent\nin two lines.nrrd", "absent.nrrd", "absent.pumice"])
def test_missing_files(name, tmp_path):
    with pytest.raises(pumice.InputError, match=name.replace("\n", r"\\n")) as caught:
        pumice.open(tmp_path / name)
    assert "\n" not in str(caught.value)
    with pytest.raises(pumice.InputError, match="path: expected a path"):
        pumice.open(b"absent.nrrd")


def test_damaged_files(volume, tmp_path):
    path = tmp_path / "half.pumice"
    volume.save(path)
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(pumice.InputError, match="half.pumice"):
        pumice.open(path)
    path.write_text("no volume at all")
    with pytest.raises(pumice.InputError, match="half.pumice"):
        pumice.open(path)


def test_colours_that_neighbours_do_not_share(volume):
    colors = volume.labels.auto_colors()
    assert colors.shape == (len(volume.labels), 3) and (colors >= 0).all() and (colors <= 1).all()
    a, b = volume.contacts.T
    assert (np.abs(colors[a] - colors[b]).max(axis=1) > 1e-3).all()
    with pytest.raises(pumice.InputError, match="one a label"):
        volume.labels.auto_colors([True])
