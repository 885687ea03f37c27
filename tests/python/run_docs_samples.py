"""Runs the samples of one page in the working folder, as a reader does who copies them from top to bottom:

    python tests/python/run_docs_samples.py docs/python.md

`pumice` must be on the PATH, and `data` in the folder. A sample that fails ends the run with exit code 1 and `page:line: what`; after the
last one the run says how many ran. Samples in Python share one namespace, that of this process.

**Output.** What a `console` block shows is compared with standard output and standard error together. `…` stands for any text, and in a
line of its own for any number of lines. Numbers before a unit of time or of memory (s, ms, kB, MB, GB) are not compared, since they depend
on the machine; bytes are.

**Scenes.** A `json` block in braces is a whole scene: `pumice.Scene` must take it, and it is written as `scene.json`, as its reader does.
Any other block is a list of fields, as one adds them to a scene: they replace those of `scene.json`, which a sample before must have
written, and the result must be a scene.
"""

import json
import os
import re
import subprocess
import sys
import tempfile
import traceback
from pathlib import Path

from docs_samples import Broken, samples_of

# A limit against hangs: the longest sample takes a minute or two of CPU time.
LIMIT_SECONDS = 1800
# A number that depends on the machine, with its unit.
MEASURED = re.compile(r"\d[\d,.]*(?= ?(?:s|ms|CPU s|kB|MB|GB)\b)")
# Writes the line of the script on which a command failed.
FAILED_LINE = "trap 'echo $LINENO >\"$FAILED_LINE\"' ERR\n"


def run_page(page, text):
    """Runs all samples of a page; the number of them. Raises `Broken` at the first that fails."""
    runners = {"sh": _run_sh, "console": _run_console, "python": run_python, "json": _take_scene}
    namespace = {"__name__": "__main__"}
    samples = [sample for sample in samples_of(page, text) if sample.runs]
    for sample in samples:
        runners[sample.language](sample, namespace)
    return len(samples)


def _run_sh(sample, _namespace):
    code, said, line = _bash(FAILED_LINE + sample.text)
    # Line 2 of the script is the first of the sample. Bash stops without a trap at an error of syntax and at a variable that is not set.
    line = sample.first_line if line is None else sample.first_line + line - 2
    if code:
        raise Broken(sample.page, line, f"expected exit code 0, got {code}: {said.strip()}")


def _run_console(sample, _namespace):
    lines = sample.text.splitlines()
    if not lines[0].startswith("$ "):
        raise Broken(sample.page, sample.first_line, f"expected a line that begins with $, got {lines[0]}")
    starts = [i for i, line in enumerate(lines) if line.startswith("$ ")]
    for start, end in zip(starts, starts[1:] + [len(lines)]):
        code, said, _ = _bash(lines[start].removeprefix("$ ") + "\n")
        line = sample.first_line + start
        if code:
            raise Broken(sample.page, line, f"expected exit code 0, got {code}: {said.strip()}")
        if not matches("\n".join(lines[start + 1 : end]), said):
            shown = "\n".join(lines[start + 1 : end])
            raise Broken(sample.page, line, f"expected the output\n{shown}\ngot\n{said}")


def matches(shown, said):
    """Whether what a page shows is what a command said, by the rule of this file's first lines."""
    shown, said = (MEASURED.sub("#", text.strip()) for text in (shown, said))
    any_lines, any_text = r"(?:[^\n]*\n)*", r"[^\n]*"
    lines = shown.splitlines()
    pattern = "".join(any_lines if line == "…" else any_text.join(map(re.escape, line.split("…"))) + "\n" for line in lines)
    return re.fullmatch(pattern, said + "\n" if said else "") is not None


def _bash(script):
    """Exit code, both outputs together, and the number that the script wrote to the file $FAILED_LINE, if any."""
    with tempfile.TemporaryDirectory() as folder:
        line_file, said_file = Path(folder, "line"), Path(folder, "said")
        with said_file.open("wb") as said:
            process = subprocess.Popen(
                ["bash", "-eu", "-o", "pipefail", "-c", script],
                stdin=subprocess.DEVNULL,
                stdout=said,
                stderr=subprocess.STDOUT,
                env={**os.environ, "FAILED_LINE": str(line_file)},
            )
            try:
                code = process.wait(LIMIT_SECONDS)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
                code = f"no end within {LIMIT_SECONDS} s"
        line = int(line_file.read_text()) if line_file.exists() else None
        return code, said_file.read_text(errors="replace"), line


def run_python(sample, namespace):
    """Runs a sample in Python in a namespace. Raises `Broken` with the line of the page at which it fails."""
    try:
        # Empty lines before the sample, so that lines in a traceback are those of the page.
        code = compile("\n" * (sample.first_line - 1) + sample.text, sample.page, "exec")
    except SyntaxError as error:
        raise Broken(sample.page, error.lineno, f"expected Python, got {error.msg}: {(error.text or '').strip()}") from None
    try:
        exec(code, namespace)
    except (Exception, SystemExit) as error:
        line = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == sample.page][-1]
        what = "".join(traceback.format_exception_only(error)).strip()
        raise Broken(sample.page, line, f"expected no exception, got {what}") from None


def _take_scene(sample, _namespace):
    import pumice

    text = sample.text
    whole = text.lstrip().startswith("{")
    try:
        fields = json.loads(text if whole else "{" + text + "}")
    except json.JSONDecodeError as error:
        # Of what is missing at the end, the last line is at fault.
        line = min(error.lineno, text.count("\n"))
        raise Broken(sample.page, sample.first_line + line - 1, f"expected JSON, got {error.msg}") from None
    path = Path("scene.json")
    if not whole:
        if not path.exists():
            raise Broken(sample.page, sample.first_line, "expected a scene.json that a sample before has written, got none")
        text = json.dumps({**json.loads(path.read_text()), **fields})
    try:
        pumice.Scene.from_json(text)
    except pumice.PumiceError as error:
        raise Broken(sample.page, sample.first_line, f"expected a scene, got {error}") from None
    path.write_text(text)


if __name__ == "__main__":
    root = Path(__file__).resolve().parents[2]
    name = sys.argv[1]
    try:
        print(f"samples run: {run_page(name, (root / name).read_text(encoding='utf-8'))}")
    except Broken as broken:
        print(broken, file=sys.stderr)
        sys.exit(1)
