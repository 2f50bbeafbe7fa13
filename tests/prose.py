"""Sentences of Markdown pages and of docstrings, without code, tables' rules and markup."""

import re
from collections.abc import Iterator

MOST_WORDS = 35

_FENCE = re.compile(r"^ *```.*?^ *```", re.MULTILINE | re.DOTALL)
_IMAGE = re.compile(r"!\[[^\]]*\]\([^)]*\)")
_LINK = re.compile(r"\[([^\]]*)\]\([^)]*\)")
_CODE = re.compile(r"``[^`]+``|`[^`]+`")
_BLOCK = re.compile(r"^\s*(?:[-*+] |\d+\. |#+ |> ?|!!! )")
_END = re.compile(r"(?<=[.!?])[\"')*]*\s+")


def sentences(text: str) -> Iterator[str]:
    """Every sentence; headings, items of lists and cells of tables end one as well."""
    text = _LINK.sub(r"\1", _IMAGE.sub("", _CODE.sub("code", _FENCE.sub("", text))))
    block: list[str] = []
    for line in [*text.splitlines(), ""]:
        if line.lstrip().startswith("|"):
            yield from _split(block)
            for cell in line.split("|"):
                yield from _split([cell])
            block = []
        elif not line.strip() or _BLOCK.match(line) or set(line.strip()) <= set("=-+ "):
            yield from _split(block)
            block = [_BLOCK.sub("", line)]
        else:
            block.append(line)
    yield from _split(block)


def too_long(text: str) -> list[str]:
    """Sentences of more than ``MOST_WORDS`` words, each after its number of words."""
    counted = ((sum(map(_is_word, s.split())), s) for s in sentences(text))
    return [f"{words}: {sentence}" for words, sentence in counted if words > MOST_WORDS]


def _split(block: list[str]) -> Iterator[str]:
    yield from filter(None, _END.split(" ".join(" ".join(block).split())))


def _is_word(token: str) -> bool:
    return any(letter.isalnum() for letter in token)
