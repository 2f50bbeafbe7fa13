"""The documentation: its prose, its links, its figures, and what it says of the code."""

import ast
import dataclasses
import importlib.util
import re
import tomllib
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from prose import sentences, too_long

from dfvs_core.gate.states import TRANSITIONS
from dfvs_core.messages.link import GateStatus
from dfvs_core.messages.topics import Topics
from dfvs_core.servo.exchange import Status
from dfvs_service.settings.config import load_config, parse_assignment

ROOT = Path(__file__).parents[3]
DOCS = ROOT / "docs"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
ROOMS = [path for path in PROJECT["tool"]["mypy"]["files"] if "dfvs" in path]
AIRCRAFT = PROJECT["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]
INHERITED = {"GateMachine"}
"""Classes whose parameters are their base's."""
FRONT = [*sorted(ROOT.glob("[A-Z]*.md")), ROOT / "deploy" / "README.md"]
PAGES = [page for page in sorted(DOCS.rglob("*.md")) if "experiments" not in page.parts]
PRESENT = [page for page in (*FRONT, *PAGES) if page.name != "CHANGELOG.md"]
SOURCES = [
    path.relative_to(ROOT).as_posix()
    for name in {*(Path(room).parts[0] for room in ROOMS), "deploy", "docs", "examples", "tests"}
    for path in (ROOT / name).rglob("*.*")
]


_SPEC = importlib.util.spec_from_file_location("docs_hooks", DOCS / "hooks.py")
hooks = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(hooks)


def named(path):
    return str(path.relative_to(ROOT))


def modules(folder):
    """Syntax tree of every module in a folder, by its path."""
    paths = (ROOT / folder).rglob("*.py")
    return {named(path): ast.parse(path.read_text(encoding="utf-8")) for path in paths}


@pytest.mark.parametrize("page", PRESENT, ids=named)
def test_no_sentence_of_a_page_is_too_long(page):
    assert too_long(page.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize("room", ROOMS)
def test_no_sentence_of_a_module_s_docstring_is_too_long(room):
    found = {name: too_long(ast.get_docstring(t) or "") for name, t in modules(room).items()}
    assert {name: long for name, long in found.items() if long} == {}


def described(docstring):
    """Names in a section of numpydoc's that is headed Parameters."""
    _, _, section = docstring.partition("Parameters\n----------\n")
    section = re.split(r"\n\n\w+\n-{3,}", section)[0]
    for line in section.splitlines():
        if line and not line.startswith(" "):
            yield from (name.strip("* ") for name in line.split(" :")[0].split(","))


def parameters(node):
    """Names of the parameters of a function, of a class' constructor, or of a dataclass' fields."""
    if isinstance(node, ast.ClassDef):
        functions = [each for each in node.body if isinstance(each, ast.FunctionDef)]
        node = next((each for each in functions if each.name == "__init__"), node)
    if isinstance(node, ast.ClassDef):
        return {each.target.id for each in node.body if isinstance(each, ast.AnnAssign)}
    some = node.args
    every = [*some.posonlyargs, *some.args, *some.kwonlyargs, some.vararg, some.kwarg]
    return {each.arg for each in every if each is not None}


@pytest.mark.parametrize("package", AIRCRAFT)
def test_parameters_that_a_docstring_describes_exist(package):
    wrong = []
    for name, tree in modules(package).items():
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
                names = set(described(ast.get_docstring(node) or ""))
                if node.name not in INHERITED and (extra := names - parameters(node)):
                    wrong.append(f"{name}: {node.name} describes {sorted(extra)}")
    assert wrong == []


def test_a_sentence_ends_with_its_item_cell_or_stop_and_not_in_code():
    text = "One. Two `a. b` more\ngoes on:\n- an item\n| a cell | ends. Here |\n```\nno. text\n```"
    told = ["One.", "Two code more goes on:", "an item", "a cell", "ends.", "Here"]
    assert list(sentences(text)) == told
    assert too_long("word " * 36) == [f"36: {'word ' * 35}word"]


def test_the_readme_has_at_most_100_lines():
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 100


def test_a_cell_of_the_readme_s_tables_is_read_at_a_glance():
    """At most 80 words: a list of all runs belongs into the experiments."""
    lines = (ROOT / "README.md").read_text(encoding="utf-8").splitlines()
    cells = [cell for line in lines if line.startswith("|") for cell in line.split("|")]
    assert len(cells) > 20
    assert [cell for cell in cells if len(cell.split()) > 80] == []


@pytest.mark.parametrize("page", FRONT, ids=named)
def test_links_outside_of_the_site_lead_to_files(page):
    text = page.read_text(encoding="utf-8")
    targets = re.findall(r"\]\((?!https?:|#)([^)#\s]+)", text)
    assert [t for t in targets if not (page.parent / t).exists()] == []


def test_every_answer_to_where_do_i_find_names_files_that_exist():
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| [^|]*\? \| (.*) \|$", text, re.MULTILINE)
    answers = [re.findall(r"`([^`]+)`", row) for row in rows]
    assert len(answers) >= 20
    assert all(answers)
    assert [path for paths in answers for path in paths if not (ROOT / path).exists()] == []


@pytest.mark.parametrize("page", PRESENT, ids=named)
def test_source_files_that_a_page_names_exist(page):
    paths = re.findall(r"`([\w/]+\.(?:py|service))`", page.read_text(encoding="utf-8"))
    assert [path for path in paths if not any(f"/{f}".endswith(f"/{path}") for f in SOURCES)] == []


def test_the_figure_of_the_states_shows_the_gate_s_transitions():
    figure = ET.parse(DOCS / "images" / "states.svg")
    edges = [e for e in figure.iter() if "data-from" in e.attrib]
    shown = {(a, e.attrib["data-to"]) for e in edges for a in e.attrib["data-from"].split()}
    assert shown == {(a, b) for a, following in TRANSITIONS.items() for b in following}


def test_the_page_of_messages_names_every_key_of_the_messages():
    text = (DOCS / "reference" / "messages.md").read_text(encoding="utf-8")
    cells = set(re.findall(r"`([\w/]+)`", text))
    topics = re.findall(r"^(?:    )?(\w+) +(?:camera|service|operator) ", Topics.__doc__, re.M)
    assert len(topics) > 10
    assert set(topics) - {cell.partition("/")[0] for cell in cells} == set()
    assert {field.name for field in dataclasses.fields(GateStatus)} - cells == set()
    assert {status.name for status in Status} - cells == set()


def command_lines(text):
    """Words of every command of ours in the blocks of code, without quoted ones and comments."""
    for block in re.findall(r"^ *```\w*\n(.*?)^ *```", text, re.MULTILINE | re.DOTALL):
        lines = block.replace("\\\n", " ").replace('make demo ARGS="', "dfvs-demo ").splitlines()
        for line in lines:
            plain = re.sub(r"'[^']*'|\"[^\"]*\"|\s#.*", "", line)
            if found := re.search(r"(?:^|[ /$])(dfvs-[a-z0-9]+(?: .*)?)$", plain):
                yield found[1].replace('"', "").split()


@pytest.fixture(scope="module")
def helps():
    """Help of every command, by its words."""
    parts = re.split(r"^##+ (dfvs.*)$", hooks.commands(), flags=re.MULTILINE)[1:]
    return dict(zip(parts[::2], parts[1::2], strict=True))


def test_every_option_in_the_blocks_of_code_is_known_to_its_command(helps):
    unknown, count = [], 0
    for page in (*FRONT, *PAGES):
        for words in command_lines(page.read_text(encoding="utf-8")):
            leading = [" ".join(words[:k]) for k in range(len(words), 0, -1)]
            command = next((name for name in leading if name in helps), None)
            if command is None:
                unknown.append((named(page), words))
                continue
            options = {w.partition("=")[0] for w in words if re.match("--[a-z]", w)}
            count += len(options)
            told = set(re.findall(r"--[a-z][a-z0-9-]*", helps[command]))
            unknown += [(named(page), command, o) for o in sorted(options - told)]
    assert unknown == []
    assert count > 100


def test_the_settings_in_the_examples_of_the_helps_are_accepted(helps):
    words = [w for told in helps.values() for w in re.findall(r"--set ([a-z]\S+)", told)]
    assert words
    for word in words:
        load_config(None, dict([parse_assignment(word.replace("'", ""))]))


@pytest.fixture(scope="module")
def settings():
    """Every setting and section, as ``section.key``."""
    parts = re.split(r"^## ([\w.]+)$", hooks.settings(), flags=re.MULTILINE)[1:]
    tables = dict(zip(parts[::2], parts[1::2], strict=True))
    keys = {s: re.findall(r"^\| `(\w+)` \|", t, re.MULTILINE) for s, t in tables.items()}
    return {f"{section}.{key}" for section in keys for key in keys[section]} | set(keys)


def test_every_section_of_the_settings_says_what_it_is_about():
    sections = re.findall(r"^## [\w.]+\n\n(.*)$", hooks.settings(), re.MULTILINE)
    assert len(sections) > 10
    assert all(sections)


def flat(table, where=""):
    for key, value in table.items():
        yield from flat(value, f"{where}{key}.") if isinstance(value, dict) else (where + key,)


def test_every_setting_that_the_pages_name_exists(settings):
    sections = "|".join(name for name in settings if "." not in name)
    files = "toml|json|jsonl|png|err|py|sock|drone1"  # gate.jsonl is none, nor a role's name
    pattern = re.compile(rf"`((?:{sections})\.(?!(?:{files})\b)[\w.]+)")
    found = []
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        found += [(named(page), key) for key in pattern.findall(text)]
        for block in re.findall(r"^ *```toml\n(.*?)^ *```", text, re.MULTILINE | re.DOTALL):
            found += [(named(page), key) for key in flat(tomllib.loads(block))]
    assert len(found) > 80
    assert [(name, key) for name, key in found if key not in settings] == []
