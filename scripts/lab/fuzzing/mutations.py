"""Mutations of input files: the same bytes for the same seed, on every machine.

A mutator takes a random generator and the bytes of a valid file, and returns other bytes, most of
them invalid. Those of result files are in :mod:`fuzzing.result_mutations`.
"""

from __future__ import annotations

import copy
import json
import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator
from random import Random
from typing import Any

import yaml

Mutator = Callable[[Random, bytes], bytes]

NUMBERS = (
    0, 1, -1, 2, 7, -0.0, 0.5, 1e-300, 5e-324, 1e-9, 1e-6, 1e6, 1e9, -1e9, 1e12, 1e154, 1e300,
    1.7e308, -1e308, 2**31, 2**63, 10**30, 99999999, math.nan, math.inf, -math.inf,
)  # fmt: skip
PLACES = (
    "../../outside/secret", "../outside", "/etc/passwd", "/dev/zero", "/dev/stdin", "fifo", "zero",
    "loop", "link", "folder", ".", "..", "/", "~root", "a" * 300, "a/" * 2000, "a\0b", "%00",
    "file:///etc/passwd", "file://[", "file://\u2100/x", "package://", "package://../../outside/x",
    "package://[", "package://a/%2e%2e/%2e%2e/x", "model://a/b", "http://127.0.0.1:9/x.stl",
    "example-robot-data:../../x", "example-robot-data:panda", "C:\\x.stl", "\\\\host\\x.stl",
)  # fmt: skip
WORDS = (
    "", " ", "null", "true", "\0", "\n", "a\r\nb", "\x1b[31m", "\u202e", "\ud800", "\ufeff",
    "\U0001f600" * 40, "a" * 70_000, "<script>alert(1)</script>", "\"><img src=x onerror='x()'>",
    "</script><script>x()</script>", "&lt;", "]]>", "--", "$HOME", "$\\frac{", "%n%s", "{0}", "{}",
    "__class__", "__proto__", "1e400", "0x1f", "1_000", "1,5", "\u0663", "nan", "inf", "pi/2",
    "${pi}", "9**9**9", "0 0", "0 0 0 0", "a.b", "0", "-1", "[bold]", "#", "x: y", "'", '"',
    *PLACES,
)  # fmt: skip


def a_word(random: Random) -> str:
    """A text that is difficult to process."""
    return random.choice(WORDS)


def a_value(random: Random) -> Any:
    """A value of any type."""
    kind = random.randrange(8)
    if kind < 3:
        return random.choice(NUMBERS)
    if kind < 5:
        return a_word(random)
    if kind == 5:
        return random.choice([None, True, False, [], {}, [[]], [None], {"a": 1}, {"": {}}])
    if kind == 6:
        return [random.choice(NUMBERS) for _ in range(random.choice([1, 2, 3, 4, 6, 9, 33]))]
    value: Any = 0
    for _ in range(random.choice([2, 20, 200])):
        value = random.choice([[value], {"a": value}])
    return value


# Bytes


def flip(random: Random, content: bytes) -> bytes:
    """Change some bytes."""
    changed = bytearray(content)
    for _ in range(random.choice([1, 1, 2, 4, 16])):
        if changed:
            place = random.randrange(len(changed))
            changed[place] = random.choice([changed[place] ^ 1 << random.randrange(8),
                                            random.randrange(256), 0, 255])  # fmt: skip
    return bytes(changed)


def cut(random: Random, content: bytes) -> bytes:
    """Remove the end, or a part inside."""
    a, b = sorted(random.randrange(len(content) + 1) for _ in range(2))
    return content[:a] if random.random() < 0.5 else content[:a] + content[b:]


def splice(random: Random, content: bytes) -> bytes:
    """Insert bytes that no such file has."""
    word = a_word(random).encode("utf-8", "surrogatepass")
    inserted = random.choice([b"\xff\xfe", b"\x00" * 8, b"\xff" * 8, b"\x89HDF\r\n\x1a\n", word])
    a = random.randrange(len(content) + 1)
    return content[:a] + inserted + content[a + random.choice([0, 0, len(inserted)]) :]


def recode(random: Random, content: bytes) -> bytes:
    """Write the text in another encoding or with other line ends."""
    text = content.decode("utf-8", "replace")
    codec = random.choice(["utf-16", "utf-32", "utf-8-sig", "utf-7", "latin-1"])
    if random.random() < 0.5:
        return text.replace("\n", random.choice(["\r", "\r\n", "\u2028", "\t"])).encode()
    return text.encode(codec, "replace")


def new_number(random: Random, content: bytes) -> bytes:
    """Replace a number."""
    match = random.choice(list(re.finditer(rb"[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?", content)))
    new = str(random.choice(NUMBERS)) if random.random() < 0.8 else a_word(random)
    return content[: match.start()] + new.encode("utf-8", "replace") + content[match.end() :]


BYTES: tuple[Mutator, ...] = (flip, cut, splice)
LINES: tuple[Mutator, ...] = (*BYTES, recode, new_number)


# Trees of plain data


def _nodes(data: Any) -> Iterator[tuple[Any, Any]]:
    """Every node of a tree: its mapping or list, and the key there."""
    for key in list(data) if isinstance(data, dict) else range(len(data)):
        yield data, key
        if isinstance(data[key], dict | list):
            yield from _nodes(data[key])


def tree(random: Random, data: Any) -> Any:
    """Plain data with one to three of its nodes changed."""
    data = copy.deepcopy(data)
    for _ in range(random.choice([1, 1, 1, 2, 3])):
        nodes = list(_nodes(data))
        if not nodes:
            return data
        holder, key = random.choice(nodes)
        change = random.randrange(7)
        if change == 0:
            del holder[key]
        elif change == 1 and isinstance(holder, dict):
            holder[random.choice([a_word(random), f"{key}x"])] = holder.pop(key)
        elif change == 2:
            other, name = random.choice(nodes)
            holder[key] = copy.deepcopy(other[name])
        elif change == 3 and isinstance(holder, list):
            holder += holder[:] * random.choice([1, 3, 40])
        elif change == 4:
            holder[key] = random.choice(NUMBERS)
        else:
            holder[key] = a_value(random)
    return data


# YAML

_HOSTILE_YAML = (
    "&a [*a]", "*a", '!!python/object/apply:os.system ["echo > ../outside/pwned"]',
    '!!python/object/new:eval ["open(\'../outside/pwned\',\'w\')"]', "!!python/name:os.system",
    "!!binary aGk=", "!!set {a, b}", "!!omap [a: 1]", "!<tag:x> 1", "!x 1", "2024-01-01",
    "0x1F", "0o17", "1_000", "1e400", "12:30:45", ".inf", "-.INF", ".nan", "yes", "~", "|\n  a",
    ">-\n  a", "{<<: {a: 1}}", "? [a]", "[" * 40, "{a: " * 40, "- " * 40, "[" * 4000, "- " * 30_000,
    "&a x", "'", '"', "@", "`", "%YAML 9.9", "--- a", "...", "\t", "\x85", "\x00",
)  # fmt: skip
_BOMB = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{b}: &{b} [{', '.join([f'*{a}'] * 9)}]\n" for a, b in zip("abcdefgh", "bcdefghi", strict=True)
)


def yaml_text(random: Random, content: bytes) -> bytes:
    """Replace a value by YAML that is not plain data."""
    text = content.decode()
    if random.random() < 0.05:
        return (_BOMB + text).encode()
    match = random.choice(list(re.finditer(r"[:\[,-] *([^\s\[\]{},:]+)", text)))
    new = random.choice(_HOSTILE_YAML)
    return (text[: match.start(1)] + new + text[match.end(1) :]).encode()


def yaml_tree(random: Random, content: bytes) -> bytes:
    """Change nodes of the data."""
    data = tree(random, yaml.load(content, Loader=_LOADER))
    text = json.dumps(data, ensure_ascii=random.random() < 0.5)
    text = text.replace("NaN", ".nan").replace("Infinity", ".inf")
    return text.encode("utf-8", "surrogatepass")


_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
YAML: tuple[Mutator, ...] = (*LINES, yaml_text, yaml_text, *(yaml_tree,) * 6)


# XML

_LAUGHS = '<!DOCTYPE robot [<!ENTITY a "aaaaaaaaaa">' + "".join(
    f'<!ENTITY {b} "{f"&{a};" * 10}">' for a, b in zip("abcdefgh", "bcdefghi", strict=True)
)
_PROLOGUES = (
    _LAUGHS + "]>", "<!DOCTYPE robot>", '<!DOCTYPE robot SYSTEM "file:///etc/passwd">',
    '<!DOCTYPE robot [<!ENTITY x SYSTEM "file:///etc/passwd">]>',
    '<!DOCTYPE robot [<!ENTITY % x SYSTEM "http://127.0.0.1:9/x"> %x;]>',
    '<?xml version="1.0" encoding="utf-16"?>', '<?xml version="1.0" encoding="nonsense"?>',
    '<?xml version="1.0" encoding="shift_jis"?>', '<?xml version="1.1"?>', "<!-- -->", "\ufeff",
    '<?xml-stylesheet href="x"?>', "<x/>", "<![CDATA[x]]>", "<?php x ?>",
)  # fmt: skip
_INSIDE = (
    "&i;", "&x;", "&#0;", "&#x1;", "&#x202e;", "<![CDATA[<x>]]>", "<!-- -- -->", "</robot>",
    '<x:y xmlns:x="u:v" x:z="1"/>', '<link xmlns="u" name="z"/>', "<a>" * 300, "<a>" * 20_000,
    "<link/>", "<joint/>", '<link name="z"/>' * 3000, '<xacro:include filename="/etc/passwd"/>',
)  # fmt: skip


def xml_text(random: Random, content: bytes) -> bytes:
    """Insert a DTD, entities, namespaces or invalid markup."""
    text = re.sub(r"<\?xml[^>]*\?>", "", content.decode())
    if random.random() < 0.6:
        text = random.choice(_PROLOGUES) + text
    if random.random() < 0.6:
        place = text.index(">", random.randrange(len(text) - 20)) + 1
        text = text[:place] + random.choice(_INSIDE) + text[place:]
    return text.encode()


def xml_tree(random: Random, content: bytes) -> bytes:
    """Change elements and attributes."""
    root = ET.fromstring(content)
    for _ in range(random.choice([1, 1, 1, 2, 3])):
        holders = [element for element in root.iter() if len(element)]
        if holders:
            _change_element(random, root, random.choice(holders))
    for element in root.iter():
        element.attrib = {key: _legal(value) for key, value in element.attrib.items()}
    return ET.tostring(root, encoding="utf-8")


def _change_element(random: Random, root: ET.Element, holder: ET.Element) -> None:
    index, change = random.randrange(len(holder)), random.randrange(9)
    element, others = holder[index], list(root.iter())
    if change == 0:
        holder.remove(element)
    elif change == 1:
        holder.insert(index, copy.deepcopy(element))
    elif change == 2:
        holder[index] = copy.deepcopy(random.choice(others))
    elif change == 3:
        element.tag = random.choice(others).tag
    elif element.attrib:
        key = random.choice(list(element.attrib))
        if change == 4:
            del element.attrib[key]
        elif change == 5:
            element.set(key, random.choice([e.attrib[key] for e in others if key in e.attrib]))
        elif change == 6:
            words = element.attrib[key].split() or [""]
            words[random.randrange(len(words))] = str(random.choice(NUMBERS))
            element.set(key, " ".join(words))
        else:
            element.set(key, a_word(random))


def _legal(word: str) -> str:
    """A text without characters that XML excludes."""
    return re.sub("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]", "", word)


XML: tuple[Mutator, ...] = (*LINES, xml_text, xml_text, *(xml_tree,) * 6)
CSV: tuple[Mutator, ...] = (*LINES, new_number, new_number, new_number, splice)


def mutated(random: Random, content: bytes, mutators: tuple[Mutator, ...]) -> bytes:
    """Content after one mutation, or sometimes after several."""
    content = attempted(random.choice(mutators), random, content)
    for _ in range(random.choice([0, 0, 0, 1, 2])):
        content = attempted(random.choice(LINES), random, content)
    return content


def attempted(mutator: Mutator, random: Random, content: bytes) -> bytes:
    """Content after a mutator; with flipped bytes where the mutator cannot read the content."""
    try:
        return mutator(random, content)
    except Exception:
        return flip(random, content)
