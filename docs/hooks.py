"""MkDocs hooks: reference pages generated from the code that they describe.

Settings come from the settings' own text, command lines from the parsers' help, faults from the
list of the fault matrix. Nothing here needs a network.
"""

from __future__ import annotations

import importlib
import io
import itertools
import os
import re
import tomllib
import typing
from collections.abc import Callable, Iterator, Sequence
from contextlib import redirect_stdout, suppress
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.files import Files
    from mkdocs.structure.pages import Page

Main = Callable[[Sequence[str]], object]

ROOT = Path(__file__).parents[1]
_WIDTH = "80"
_EXTERNAL = re.compile(
    r'<(?:script|img|source|iframe|link rel="?(?:stylesheet|icon)"?)\b'
    r'[^>]*?["\'= ]((?:https?:)?//[^"\'> ]+)'
)
_SETTINGS = """\
# Settings

All settings of `dfvs-service`, as `dfvs-service config` prints them. Save that text as a file, edit
it, and give it by `--config`. `--set SECTION.KEY=VALUE` overrides one setting. Angles are in
degrees in files and on command lines. An unknown key is an error that names the nearest known one.
A setting without a default is not set.
"""
_HEAD = ("", "| key | default | allowed | meaning |", "|---|---|---|---|")
_COMMANDS = """\
# Command lines

Every command prints this text with `--help`, and its version with `--version`. Exit codes: 0 done,
1 ran and did not reach its aim, 2 cannot run (one line says why, what was expected, and how to
repair it).
"""
_FAULTS = """\
# Faults

Every fault that `dfvs-robustness faults` causes, the states in which it is caused, what detects it,
and what must follow. The limit is the longest time allowed from fault to reaction. For faults
of the camera, the network and perception it counts from the capture of the last good frame, with
50 ms for the vehicle's record beside the 300 ms of invariant I4, which is judged as well. The
measured times are in [the fault matrix](../experiments/faults.md). [The
gate](../explanation/gate.md) explains the reactions.
"""


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the generated pages."""
    from mkdocs.structure.files import File

    for name, make in (("settings", settings), ("commands", commands), ("faults", faults)):
        path = f"reference/{name}.md"
        files.append(File.generated(config, path, content=make()))
    return files


def on_post_page(output: str, page: Page, config: MkDocsConfig) -> str:
    """Refuse a page that would load a file from elsewhere."""
    from mkdocs.exceptions import PluginError

    if loaded := _EXTERNAL.search(output):
        raise PluginError(f"{page.file.src_uri} loads {loaded[1]}, expected a file of the site")
    return output


# --- settings ---------------------------------------------------------------------------------


def settings() -> str:
    """Page of all settings: a table for every section."""
    from dfvs_service.settings.config import ServiceConfig
    from dfvs_service.settings.config_text import markdown_table

    lines = [_SETTINGS]
    rows = re.findall(r"^\| `([\w.]+)\.(\w+)` (.*)$", markdown_table(ServiceConfig()), re.MULTILINE)
    for section, group in itertools.groupby(rows, lambda row: row[0]):
        lines += ["", f"## {section}", "", _about(ServiceConfig, section), *_HEAD]
        lines += [f"| `{key}` {rest}" for _, key, rest in group]
    return "\n".join(lines) + "\n"


def _about(config: type, section: str) -> str:
    """First line of the docstring of a section, such as ``camera.mount``."""
    for name in section.split("."):
        hint = typing.get_type_hints(config)[name]
        config = next((each for each in typing.get_args(hint) if each is not type(None)), hint)
    return (config.__doc__ or "").partition("\n")[0]


def _cell(text: str) -> str:
    return text.replace("|", r"\|")


# --- command lines ----------------------------------------------------------------------------


def commands() -> str:
    """Page of all command lines: the help of every command and subcommand."""
    projects = [
        tomllib.loads((ROOT / folder / "pyproject.toml").read_text(encoding="utf-8"))["project"]
        for folder in (".", "lab")
    ]
    lines = [_COMMANDS]
    width = os.environ.get("COLUMNS")
    os.environ["COLUMNS"] = _WIDTH  # argparse wraps its help to the terminal
    try:
        for prog, entry in (item for each in projects for item in each["scripts"].items()):
            module, _, function = entry.partition(":")
            main: Main = getattr(importlib.import_module(module), function)
            lines += ["", f"## {prog}"]
            for words, told in _helps(main, prog, ()):
                title = ["", f"### {' '.join((prog, *words))}"] if words else []
                lines += [*title, "", "```text", told.rstrip(), "```"]
    finally:
        if width is None:
            del os.environ["COLUMNS"]
        else:
            os.environ["COLUMNS"] = width
    return "\n".join(lines) + "\n"


def _helps(main: Main, prog: str, words: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], str]]:
    """Help of a command and of all below it, each with the words that lead to it."""
    told = _help(main, words)
    yield words, told
    name = " ".join((prog, *words))
    listed = re.findall(r"^    ([a-z][a-z0-9-]*)(?:  +\S|$)", told, re.MULTILINE)
    shown = re.findall(rf"^ +{re.escape(name)} ([a-z][a-z0-9-]*)\b", told, re.MULTILINE)
    for word in dict.fromkeys((*listed, *shown)):
        if _help(main, (*words, word)).startswith(f"usage: {name} {word} "):
            yield from _helps(main, prog, (*words, word))


def _help(main: Main, words: tuple[str, ...]) -> str:
    out = io.StringIO()
    with redirect_stdout(out), suppress(SystemExit):
        main([*words, "--help"])
    return out.getvalue()


# --- faults -----------------------------------------------------------------------------------


def faults() -> str:
    """Page of all faults: what detects each, and the reaction with its limit."""
    from dfvs_robustness.faults.table import all_faults

    lines = [_FAULTS, "| fault | in state | seen by | reaction | limit |", "|---|---|---|---|---|"]
    for fault in all_faults().values():
        states = ", ".join(str(state) for state in fault.states)
        limit = f"{fault.limit_ms:g} ms" if fault.limit_ms else "–"
        cells = (fault.what, states, fault.seen_by, fault.reaction.value, limit)
        lines.append(f"| {' | '.join(map(_cell, cells))} |")
    return "\n".join(lines) + "\n"
