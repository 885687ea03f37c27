"""Tests that the script in the README is the example file, and that it runs."""

import subprocess
import sys

from conftest import ROOT

EXAMPLE = ROOT / "python/examples/array_to_figure.py"


def test_the_script_of_the_readme_is_the_example():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    script = text.split("```python\n")[1].split("```")[0]
    assert EXAMPLE.read_text(encoding="utf-8").split('"""', 2)[2].lstrip("\n") == script


def test_the_example_makes_its_figure(tmp_path):
    done = subprocess.run([sys.executable, EXAMPLE], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert "samples a pixel, error about" in done.stdout
    assert (tmp_path / "cells.png").read_bytes().startswith(b"\x89PNG")
