# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Fixtures for tests of the extension inside a real Blender (the wheel `bpy`, without a window).

    PUMICE_EXTENSION_ZIP   the packed extension, which is installed as a user installs it. If it is not set, the source folder is linked
                           in, and the module `pumice` must be importable
    PUMICE                 the command; by default the dev build

A process has only one Blender, which all tests share; the fixture `blender` opens an empty file for each. The process ends with
`os._exit`, because some versions of Blender crash when an interpreter in which a render engine ran shuts down.
"""

import os
import shutil
import sys
import tempfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/python"))
from share import pytest_collection_modifyitems, pytest_configure  # noqa: E402, F401

EXTENSION = "bl_ext.user_default.pumice"

# Blender reads this variable when it is imported.
_resources = Path(tempfile.mkdtemp(prefix="pumice-blender-"))
os.environ["BLENDER_USER_RESOURCES"] = str(_resources)
_zip = os.environ.get("PUMICE_EXTENSION_ZIP")
if not _zip:
    _folder = _resources / "extensions" / "user_default"
    _folder.mkdir(parents=True)
    (_folder / "pumice").symlink_to(ROOT / "blender-addon")

import bpy  # noqa: E402, I001
import addon_utils  # noqa: E402  (bpy brings it)

# Adds the packages that Blender ships for its own Python, such as OpenImageIO, after those installed here.
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
    """The package of the extension, enabled."""
    module = addon_utils.enable(EXTENSION, persistent=True)
    assert module is not None, f"{EXTENSION} does not register"
    return sys.modules[EXTENSION]


@pytest.fixture
def blender(extension):
    """bpy with an empty file and the extension enabled."""
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    yield bpy
    extension.viewport.close_all()


@pytest.fixture
def startup(extension):
    """bpy with Blender's startup file: camera, cube, point light, grey world."""
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    yield bpy
    extension.viewport.close_all()


@pytest.fixture
def drawn(extension, monkeypatch):
    """The flags of drawable features, all set, so that features are read from a scene even if the compiled module does not draw them."""
    flags = sys.modules[f"{EXTENSION}.sync.drawn"]
    for name, value in vars(flags).items():
        if name.isupper():
            monkeypatch.setattr(flags, name, True if isinstance(value, bool) else Everything())
    return flags


class Everything:
    """A set that contains everything."""

    def __contains__(self, _):
        return True


@pytest.fixture(scope="session")
def data():
    """Folder of the volumes that the project ships."""
    return ROOT / "data"


@pytest.fixture(scope="session")
def pumice_command():
    """Path of the command `pumice`."""
    path = Path(os.environ.get("PUMICE", ROOT / "target" / "debug" / "pumice"))
    assert path.is_file(), f"{path} is missing: cargo build -p pumice, or set PUMICE"
    return path


@pytest.fixture
def nuclei(tmp_path, data):
    """A copy of a small shipped volume in a temporary folder, so that nothing is written into the checkout."""
    path = tmp_path / "nuclei.tif"
    shutil.copyfile(data / "platynereis_nuclei.tif", path)
    return path
