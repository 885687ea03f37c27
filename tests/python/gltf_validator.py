"""The Khronos validator of glTF files, which is JavaScript: finds the package, and asks it.

The validator is the folder that GLTF_VALIDATOR names, or target/gltf-validator.
"""

import json
import os
import subprocess
from pathlib import Path

import npm_package

VERSION = "2.0.0-dev.3.10"
SHA256 = "4e03dbdc3bc0d1342afd5d2d7ae341a7e3474502ccb872b02dbbaddaee0fdec6"

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
    command = [npm_package.node(), "-e", SCRIPT, package() / "index.js", *files]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def package():
    """The folder of the package, with its index.js."""
    folder = os.environ.get("GLTF_VALIDATOR")
    return Path(folder) if folder else npm_package.package("gltf-validator", VERSION, SHA256)
