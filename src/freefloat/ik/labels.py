"""Labels of arm branches, for people."""

from __future__ import annotations

import re


def branch_name(label: str) -> str:
    """The label of an arm branch; ``branch 1`` where that is a number."""
    return f"branch {label}" if label.isdigit() else label


def short_label(label: str) -> str:
    """``s+ e- w+`` for ``shoulder+ elbow- wrist+``; nothing for numbers and words."""
    arms = []
    for arm in label.split(", "):
        words = [word for word in arm.split() if word[-1] in "+-" or re.fullmatch("[a-z]", word)]
        arms.append(" ".join(word[0] + word[1:][-1:] for word in words))
    return ", ".join(filter(None, arms))
