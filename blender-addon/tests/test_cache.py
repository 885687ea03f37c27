# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests where the compressed form is kept: a separate file for each source and choice of reading, in a writable folder."""

import importlib
import os

import pytest


@pytest.fixture
def cache(extension):
    return importlib.import_module(f"{extension.__name__}.cache")


def test_a_changed_source_and_another_choice_are_other_files(cache, tmp_path):
    source = tmp_path / "liver.nii.gz"
    source.write_bytes(b"one")
    names = [cache.file_name(str(source), {})]
    names.append(cache.file_name(str(source), {"layer": 1}))
    names.append(cache.file_name(str(source), {"spacing": (1.0, 1.0, 2.0)}))
    assert cache.file_name(str(source), {}) == names[0]
    source.write_bytes(b"other")
    names.append(cache.file_name(str(source), {}))
    os.utime(source, ns=(0, 12345))
    names.append(cache.file_name(str(source), {}))
    assert len(set(names)) == 5 and all(n.startswith("liver-") and n.endswith(".pumice") for n in names)


def test_a_folder_of_slices_is_known_by_its_files(cache, tmp_path):
    folder = tmp_path / "slices"
    folder.mkdir()
    (folder / "s1.tif").write_bytes(b"x")
    assert not cache.is_compressed(str(folder))
    before = cache.file_name(str(folder), {})
    (folder / "s2.tif").write_bytes(b"x")
    assert cache.file_name(str(folder) + os.sep, {}) != before
    assert os.path.dirname(cache.candidates(str(folder) + os.sep, {}, "/user")[0]) == str(tmp_path)


def test_the_users_folder_serves_where_the_source_cannot_be_written_beside(cache, tmp_path):
    blocked = tmp_path / "file"
    blocked.write_bytes(b"")
    paths = [str(blocked / "a.pumice"), str(tmp_path / "user" / "deep" / "a.pumice")]
    assert cache.writable(paths) == paths[1]
    assert os.listdir(tmp_path / "user" / "deep") == [], "testing a folder leaves no file"
    with pytest.raises(OSError):
        cache.writable(paths[:1])
