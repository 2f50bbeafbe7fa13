"""Docstrings: each parameter that they describe exists."""

import ast
import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).parents[3]
FOLDERS = ("dfvs_core", "dfvs", "models", "common", "service")
INHERITED = {"GateMachine"}
"""Classes whose parameters are their base's."""


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


def test_described_parameters_exist():
    command = ["git", "ls-files", *(f"{folder}/*.py" for folder in FOLDERS)]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    wrong = []
    for path in listed.split():
        for node in ast.walk(ast.parse((ROOT / path).read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
                names = set(described(ast.get_docstring(node) or ""))
                if node.name not in INHERITED and (extra := names - parameters(node)):
                    wrong.append(f"{path}: {node.name} describes {sorted(extra)}")
    assert wrong == []
