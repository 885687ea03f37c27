# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests of the extension inside a real Blender: the wheel `bpy`, without a window.

    PUMICE_EXTENSION_ZIP   the packed extension: installed as a user installs it; unset: the sources are linked in as they stand,
                           and the module `pumice` must be importable
    PUMICE                 the command; by default the dev build

One process holds one Blender, so all tests share it; `blender` gives each an empty one. The process ends with `os._exit`: some
versions of Blender crash when the interpreter that a render engine ran in is taken down.
"""

import os
import shutil
import sys
import tempfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
EXTENSION = "bl_ext.user_default.pumice"

# Blender reads it when it is imported.
_resources = Path(tempfile.mkdtemp(prefix="pumice-blender-"))
os.environ["BLENDER_USER_RESOURCES"] = str(_resources)
_zip = os.environ.get("PUMICE_EXTENSION_ZIP")
if not _zip:
    _folder = _resources / "extensions" / "user_default"
    _folder.mkdir(parents=True)
    (_folder / "pumice").symlink_to(ROOT / "blender-addon")

import bpy  # noqa: E402, I001
import addon_utils  # noqa: E402  (bpy brings it)

# What Blender brings for its own Python, among it OpenImageIO, other people's reader of pictures; after all that is installed here.
for _brought in Path(bpy.utils.resource_path("LOCAL")).glob("python/lib/python3*/site-packages"):
    sys.path.append(str(_brought))

if _zip:
    assert bpy.ops.extensions.package_install_files(filepath=_zip, repo="user_default", enable_on_install=True) == {"FINISHED"}

_exit_status = 0


def pytest_sessionfinish(session, exitstatus):
    global _exit_status
    _exit_status = int(exitstatus)


@pytest.hookimpl(trylast=True)
def pytest_unconfigure(config):
    sys.stdout.flush()
    sys.stderr.flush()
    for folder in (_resources, bpy.app.tempdir):
        shutil.rmtree(folder, ignore_errors=True)
    os._exit(_exit_status)


@pytest.fixture
def extension():
    """The extension's package, enabled."""
    module = addon_utils.enable(EXTENSION, persistent=True)
    assert module is not None, f"{EXTENSION} does not register"
    return sys.modules[EXTENSION]


@pytest.fixture
def blender(extension):
    """bpy, with an empty file and the extension enabled."""
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    yield bpy
    extension.viewport.close_all()


@pytest.fixture
def startup(extension):
    """bpy, with the file that Blender starts with: camera, cube, point light, grey world."""
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    yield bpy
    extension.viewport.close_all()


@pytest.fixture
def drawn(extension, monkeypatch):
    """What is read of a scene, whether the compiled module draws it yet or not."""
    flags = sys.modules[f"{EXTENSION}.sync.drawn"]
    for name, value in vars(flags).items():
        if name.isupper():
            monkeypatch.setattr(flags, name, True if isinstance(value, bool) else Everything())
    return flags


class Everything:
    """A set that has whatever it is asked for."""

    def __contains__(self, _):
        return True


@pytest.fixture(scope="session")
def data():
    """The volumes that the project ships."""
    return ROOT / "data"


@pytest.fixture(scope="session")
def pumice_command():
    """Path of the command."""
    path = Path(os.environ.get("PUMICE", ROOT / "target" / "debug" / "pumice"))
    assert path.is_file(), f"{path} is missing: cargo build -p pumice, or set PUMICE"
    return path


@pytest.fixture
def nuclei(tmp_path, data):
    """A small shipped volume in a folder of its own, so that nothing is written into the checkout."""
    path = tmp_path / "nuclei.tif"
    shutil.copyfile(data / "platynereis_nuclei.tif", path)
    return path
