# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests the extension as a package: layers of modules, licence lines, manifest."""

import ast
import re
import tomllib
from pathlib import Path

FOLDER = Path(__file__).resolve().parents[1]
SOURCES = sorted(FOLDER.glob("*.py")) + sorted((FOLDER / "sync").glob("*.py"))


def layers():
    """{module name: line, counted from the top, of the drawing of layers in the package's docstring}."""
    text = ast.get_docstring(ast.parse((FOLDER / "__init__.py").read_text()))
    drawing = re.search(r"(?:^    \S.*\n)+", text, re.MULTILINE).group()
    return {name: row for row, line in enumerate(drawing.splitlines()) for name in line.split()}


def imported(path):
    """Names, as in the drawing, of the modules of this package that a file imports."""
    inside = path.parent.name == "sync"
    for node in ast.walk(ast.parse(path.read_text())):
        if not isinstance(node, ast.ImportFrom) or node.level == 0:
            continue
        in_sync = (inside and node.level == 1) or (node.module or "").startswith("sync")
        if in_sync:
            yield "sync.*"
        elif node.module:
            yield node.module.split(".")[0]
        else:
            yield from (alias.name for alias in node.names)


def test_a_module_imports_only_from_lines_below_its_own():
    rows = layers()
    assert len(rows) > 15
    for path in SOURCES:
        me = "sync.*" if path.parent.name == "sync" else path.stem
        for other in imported(path):
            if me == other == "sync.*":
                continue
            assert rows[other] > rows[me], f"{path.name} imports {other}"


def test_what_knows_no_blender_imports_none():
    for name in ("cache", "devices", "mesh_file", "overlay", "file_facts", "file_series", "opening", "time_steps", "units", "sync/matrix", "sync/camera", "sync/parts", "sync/edits"):
        text = (FOLDER / f"{name}.py").read_text()
        assert not re.search(r"^\s*(import|from) (bpy|gpu|mathutils)", text, re.MULTILINE), name


def test_every_source_names_its_licence():
    for path in [*SOURCES, *(FOLDER / "tests").glob("*.py"), FOLDER / "blender_manifest.toml"]:
        assert path.read_text().splitlines()[1] == "# SPDX-License-Identifier: GPL-3.0-or-later", path


def test_the_manifest_is_what_blender_asks_for():
    manifest = tomllib.loads((FOLDER / "blender_manifest.toml").read_text())
    assert manifest["schema_version"] == "1.0.0" and manifest["id"] == "pumice"
    assert manifest["blender_version_min"] == "4.2.0"
    assert manifest["license"] == ["SPDX:GPL-3.0-or-later"]
    reason = manifest["permissions"]["files"]
    assert len(reason) <= 64 and not reason.endswith("."), "Blender's own rule"
    assert len(manifest["tagline"]) <= 64 and not manifest["tagline"].endswith(".")


def test_the_manifest_follows_the_version_of_the_project():
    cargo = tomllib.loads((FOLDER.parent / "Cargo.toml").read_text())
    manifest = tomllib.loads((FOLDER / "blender_manifest.toml").read_text())
    assert manifest["version"] == cargo["workspace"]["package"]["version"]
