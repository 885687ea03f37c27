"""Every public name explains itself: it has a docstring, which names the arguments that it has and no others.

    `spp`: samples per pixel        a documented argument; also `spp`, `seconds`: …, and `spp=16` in a sentence
    as for `render`                 the docstring of `render` counts too

`path` and `job` are explained once, in the docstring of the module. The stub of the compiled part is walked as text.
"""

import ast
import inspect
import re
from pathlib import Path

import pumice
import pytest

# Explained in the docstring of the module.
EVERYWHERE = {"path", "job"}
# Classes whose objects functions of the module make, so that nobody calls them.
MADE_BY_FUNCTIONS = {"LabelTable", "Picture", "Volume"}
STUB = Path(__file__).parents[1] / "pumice" / "_native.pyi"
ARGS = Path(__file__).parents[2] / "cli" / "src" / "args"

# For each function the files with the flags of its subcommand, and the keywords that no flag has.
COMMANDS = {
    "open": (["figure", "reading"], {"mapped", "memory"}),
    "probe": (["info", "reading"], set()),
    "compress": (["compress", "reading"], {"source", "unit", "world_from_index", "names"}),
    "compress_file": (["compress", "reading"], {"source", "unit", "world_from_index", "names"}),
    "compress_part": (["compress", "reading"], {"source", "fingerprint", "unit", "world_from_index", "names"}),
    "compress_series": (["compress", "reading"], {"source", "unit", "world_from_index", "names"}),
    "merge": (["merge"], set()),
    "figure": (["figure", "render", "annotations"], {"volume", "view_deg"}),
    "render": (["render", "annotations"], {"scene", "volumes", "meshes", "on_progress"}),
    "export": (["export"], set()),
    "verify_render": (["verify_render"], {"maps"}),
}
# Keywords with a name of their own, and the field of the flag that means the same; docs/python.md lists them.
OTHER_NAMES = {"time": "time_step", "seconds": "time", "limit_bytes": "limit", "for_blender": "reader", "blender": "with_blender", "page": "out"}


def public():
    """Each public object by name: functions and classes of the module, and methods and properties of the classes."""
    found = {"pumice": pumice}
    for name in pumice.__all__:
        value = getattr(pumice, name)
        if not callable(value):
            continue
        found[name] = value
        if inspect.isclass(value) and not issubclass(value, (Exception, Warning)):
            found |= {f"{name}.{member}": one for member, one in vars(value).items() if not member.startswith("_") and described(one)}
    return found


def described(member):
    """Whether a member of a class is code: not the default of a field."""
    return callable(member) or isinstance(member, (classmethod, staticmethod, property)) or inspect.isgetsetdescriptor(member)


PUBLIC = public()


def text_of(value):
    """The docstring of an object; for a class also that of how it is made."""
    function = value.__func__ if isinstance(value, (classmethod, staticmethod)) else value
    text = inspect.cleandoc(function.__doc__ or "")
    if inspect.isclass(value) and "__init__" in vars(value):
        text += "\n" + inspect.cleandoc(vars(value)["__init__"].__doc__ or "")
    # An object that has no docstring of its own shows that of its class.
    inherited = type(value).__doc__
    return "" if isinstance(inherited, str) and text == inspect.cleandoc(inherited) else text


def arguments_of(value):
    """Names of the arguments; those of a class are its `__init__`'s. None for what takes none, or says none, as the compiled part."""
    function = value.__func__ if isinstance(value, (classmethod, staticmethod)) else value
    if isinstance(function, property) or not callable(function) or hasattr(function, "__dataclass_fields__"):
        return set()
    if inspect.isclass(function) and (function.__name__ in MADE_BY_FUNCTIONS or issubclass(function, (Exception, Warning))):
        return set()
    try:
        parameters = inspect.signature(function).parameters.values()
    except ValueError:
        return set()
    variable = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
    passed = {name for p in parameters if p.name in ("reading", "choice") and p.kind is variable[1] for name in keywords_of(p.name)}
    return ({p.name for p in parameters if p.kind not in variable} | passed) - {"self", "cls"}


def keywords_of(name):
    from pumice.arguments import Choice, Reading

    return {"reading": Reading, "choice": Choice}[name].__annotations__ | (Choice.__annotations__ if name == "reading" else {})


def faults(name, value, texts):
    """What is wrong with the docstring of an object, a line each."""
    text = texts[name]
    if not text or not text[0].isupper() and text[0] not in "4(" or not re.search(r"[.:]$", text.split("\n\n")[0].strip()):
        return [f"{name}: expected a docstring of sentences, got {text[:40]!r}"]
    arguments = arguments_of(value)
    own = name.split(".")[0] if "." in name else name
    fields = set(dir(getattr(pumice, own, pumice))) | instance_fields(own)
    referred = " ".join(texts.get(other, "") for other in re.findall(r"as for `(\w+)`", text))
    named = set(re.findall(r"`(\w+)", text + referred))
    wrong = [f"{name}: {argument} is not explained" for argument in sorted(arguments - named - EVERYWHERE)]
    documented = set(re.findall(r"`(\w+)=", text))
    for listed in re.findall(r"((?:`\w+`(?:, | and )?)+):", text):
        documented |= set(re.findall(r"`(\w+)`", listed))
    known = arguments | fields if inspect.isclass(value) else arguments
    return wrong + [f"{name}: {said} is no argument" for said in sorted(documented - known)]


def instance_fields(name):
    """Fields that the code of a class sets, and those of a data class."""
    value = getattr(pumice, name, None)
    if not inspect.isclass(value):
        return set()
    fields = set(getattr(value, "__dataclass_fields__", ()))
    try:
        return fields | set(re.findall(r"self\.(\w+)(?::[^=\n]*)? = ", inspect.getsource(value)))
    except (OSError, TypeError):
        return fields


TEXTS = {name: text_of(value) for name, value in PUBLIC.items()}


@pytest.mark.parametrize("name", PUBLIC)
def test_a_docstring_names_the_arguments_that_there_are(name):
    assert faults(name, PUBLIC[name], TEXTS) == []


def test_a_wrong_docstring_is_found():
    """Controls: each kind of fault."""

    def good(path, *, spp=1):
        """Draws.

        `spp`: samples per pixel."""

    def found(text):
        return faults("good", good, {"good": text})

    assert found(inspect.cleandoc(good.__doc__)) == []
    assert found("") != [] and found("no sentence") != []
    assert found("Draws.") == ["good: spp is not explained"]
    assert found("Draws `spp` samples. `samples`: the same.") == ["good: samples is no argument"]
    assert found("Draws. `spp`, `time`: limits.") == ["good: time is no argument"]
    assert found("Draws with `spp=3` and `seed=4`.") == ["good: seed is no argument"]
    assert len(PUBLIC) > 90 and "Volume.contacts" in PUBLIC and "Job.cancel" in PUBLIC and "Mesh.save" in PUBLIC
    raw = {"raw_dims", "raw_type", "raw_big_endian", "raw_offset"}
    store = {"scale", "roi", "label", "dataset", "missing_chunks", "relabel"}
    assert arguments_of(pumice.open) == {"path", "labels", "mapped", "memory", "job", "layer", "time", "channel", "array", "axes", "spacing"} | raw | store
    assert text_of(pumice.volume.MOST_FACES) == ""


@pytest.mark.parametrize("name", COMMANDS)
def test_keywords_are_named_as_the_flags_of_the_command(name):
    files, own = COMMANDS[name]
    flags = {field for file in files for field in re.findall(r"(?m)^    (?:pub\(crate\) )?(\w+): [A-Z\[bu]", (ARGS / f"{file}.rs").read_text())}
    keywords = arguments_of(getattr(pumice, name)) - EVERYWHERE - own
    assert len(keywords) > 3 and {OTHER_NAMES.get(keyword, keyword) for keyword in keywords} <= flags
    # No flag of the name that a keyword has means something else.
    assert not {keyword for keyword in keywords if keyword in OTHER_NAMES and OTHER_NAMES[keyword] in keywords}
    page = (ARGS.parents[2] / "docs" / "python.md").read_text(encoding="utf-8")
    assert all(f"`{keyword}`" in page for keyword in keywords if keyword in OTHER_NAMES)


def test_every_entry_of_the_stub_has_a_docstring():
    tree = ast.parse(STUB.read_text(encoding="utf-8"))
    nodes = [node for node in ast.walk(tree) if isinstance(node, (ast.ClassDef, ast.FunctionDef))]
    # Comparisons, and what stands for names that the generator does not know, are Python's own.
    own = [node for node in nodes if node.name not in ("__eq__", "__ne__", "__getattr__")]
    assert len(own) > 100 and [node.name for node in own if not ast.get_docstring(node)] == []
