"""Tests that what the prose of the docs names exists: flags of the command, names and keywords of the Python module,
files and headings of links."""

import inspect
import re
import subprocess
from pathlib import Path

import pumice as module
import pumice.dask  # noqa: F401: a module of its own, which is an attribute of `pumice` once it is imported
import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = ["README.md", "CONTRIBUTING.md", "CHANGELOG.md", *sorted(str(page.relative_to(ROOT)) for page in (ROOT / "docs").rglob("*.md"))]
FLAG = re.compile(r"(?<![\w-])--[a-z][a-z-]+")


def text_of(page):
    return (ROOT / page).read_text(encoding="utf-8")


def subcommands(pumice, *names):
    """Names of the subcommands that the help of a command lists."""
    said = subprocess.run([pumice, *names, "--help"], capture_output=True, text=True, check=True).stdout
    return re.findall(r"(?m)^  ([a-z][a-z-]+)  ", said.split("Commands:")[1].split("Options:")[0])


@pytest.fixture(scope="module")
def flags(pumice):
    """The flags in the help of each command, by its name: `render`, `bench lod`."""
    names = [(name,) for name in subcommands(pumice)] + [("bench", name) for name in subcommands(pumice, "bench")]
    assert ("render",) in names and ("bench", "lod") in names
    helps = {name: subprocess.run([pumice, *name, "--help"], capture_output=True, text=True, check=True).stdout for name in names}
    return {" ".join(name): set(FLAG.findall(said)) for name, said in helps.items()}


def unknown_flags(text, flags):
    """What inline code names that no command has: `pumice COMMAND … --flag`, or `--flag …` at its beginning, which any may have."""
    wrong = []
    for code in re.findall(r"`([^`\n]+)`", re.sub(r"(?ms)^ *```.*?^ *```", "", text)):
        command = re.match(r"pumice (bench [a-z]+|[a-z-]+)(?= |$)", code)
        if command and command[1] not in flags:
            wrong.append(code)
        known = flags.get(command[1], set()) if command else set().union(*flags.values()) if code.startswith("--") else None
        wrong += [] if known is None else [f"{code}: {flag}" for flag in FLAG.findall(code) if flag not in known]
    return wrong


# The changelog also names what is gone, and CONTRIBUTING the flags of other programs.
@pytest.mark.parametrize("page", [page for page in PAGES if page not in ("CHANGELOG.md", "CONTRIBUTING.md")])
def test_flags_in_the_prose_are_in_the_help(page, flags):
    # `pumice bench` alone, or with a placeholder, stands for all of them.
    assert [wrong for wrong in unknown_flags(text_of(page), flags) if not re.fullmatch("pumice bench( NAME)?", wrong)] == []


def test_an_unknown_flag_or_command_is_found(flags):
    text = "`pumice render a.nrrd --pick 3`, `--spp 4`, `--sp 4`, `pumice info a --pick 3`, `pumice draw a`, `pumice bench lid`, `cargo --lid`"
    wrong = ["--sp 4: --sp", "pumice info a --pick 3: --pick", "pumice draw a", "pumice bench lid"]
    assert unknown_flags(text, flags) == wrong


def unknown_names(text):
    """Names `pumice.x` in code that the module lacks. `bpy.ops.pumice.x` and files `x.pumice` are none of its."""
    return [name for name in re.findall(r"(?<![\w./-])pumice\.(?!pumice\b)([A-Za-z_]\w*)", text) if not hasattr(module, name)]


@pytest.mark.parametrize("page", PAGES[3:] + PAGES[:1])
def test_names_of_the_python_module_exist(page):
    assert unknown_names(text_of(page)) == []


def test_an_unknown_name_is_found():
    assert unknown_names("`pumice.render(a)`, `pumice.draw(a)`, `bpy.ops.pumice.verify()`, `cells.pumice.bak`") == ["draw"]


def unknown_keywords(text):
    """Keywords in inline code `pumice.f(…)` that the function does not take, but for functions that pass keywords on."""
    wrong = []
    for name, arguments in re.findall(r"`pumice\.(\w+)\(([^`]*)\)", re.sub(r"(?ms)^ *```.*?^ *```", "", text)):
        taken = inspect.signature(getattr(module, name)).parameters
        passes_on = any(parameter.kind is parameter.VAR_KEYWORD for parameter in taken.values())
        wrong += [f"{name}({word}=)" for word in re.findall(r"(\w+)=", arguments) if word not in taken and not passes_on]
    return wrong


@pytest.mark.parametrize("page", PAGES[3:] + PAGES[:1])
def test_keywords_of_the_python_module_exist(page):
    assert unknown_keywords(text_of(page)) == []


def test_an_unknown_keyword_is_found():
    text = "`pumice.render(scene, volume, spp=3, sp=3)`, `pumice.figure(volume, picks=3)`, `pumice.compress(a, axes=\"zyx\")`"
    assert unknown_keywords(text) == ["render(sp=)", "figure(picks=)"]


def anchors(page):
    """Anchors of a page's headings, as GitHub makes them."""
    heads = re.findall(r"(?m)^#+ (.*)$", re.sub(r"(?ms)^ *```.*?^ *```", "", text_of(page)))
    plain = [re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", head).replace("`", "").replace("*", "") for head in heads]
    return [re.sub(r"[^\w\- ]", "", head.strip().lower()).replace(" ", "-") for head in plain]


def broken_links(page, text):
    """Relative links of a page that lead to no file or to no heading."""
    broken = []
    for link in re.findall(r"\]\(([^)\s]+)\)", re.sub(r"(?ms)^ *```.*?^ *```", "", text)):
        if re.match(r"[a-z]+:", link):
            continue
        name, _, anchor = link.partition("#")
        target = (ROOT / page).parent / name if name else ROOT / page
        if not target.exists() or anchor and target.suffix == ".md" and anchor not in anchors(target.resolve().relative_to(ROOT)):
            broken.append(link)
    return broken


@pytest.mark.parametrize("page", PAGES)
def test_links_lead_somewhere(page):
    assert broken_links(page, text_of(page)) == []


def test_a_link_to_nowhere_is_found():
    text = "[a](scene.md) [b](scene.md#cuts) [c](#the-scene) [d](scene.md#cats) [e](scenes.md) [f](#the-stage) [g](https://example.org/x)"
    assert broken_links("docs/scene.md", text) == ["scene.md#cats", "scenes.md", "#the-stage"]
