"""Errors of calls in Python."""

from collections.abc import Callable

import pytest

import freefloat as ff


def error_key(call: Callable[..., object], *arguments: object, **options: object) -> str:
    """The key of the input error that a call raises."""
    with pytest.raises(ff.InputError) as caught:
        call(*arguments, **options)
    return caught.value.key
