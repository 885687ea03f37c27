"""Turns the errors of wrong arguments into `InputError`.

Arguments are checked one by one where that says more (`arguments`). What remains is refused by numpy, by the compiled part or by Python
itself, each with an exception of its own. A `checked` function raises `InputError` instead, unless code of the caller raised the error: a
function that it gave, or an array of a kind of its own. How a function is called, with which keywords, stays a `TypeError`.
"""

from __future__ import annotations

import functools
import json
import os
from collections.abc import Callable
from typing import ParamSpec, TypeVar

import numpy as np

from .errors import InputError, PumiceError

P = ParamSpec("P")
R = TypeVar("R")

# Folders of the code in which an error is about an argument.
OURS = tuple(os.path.dirname(os.path.abspath(file)) for file in (__file__, np.__file__, json.__file__))


def checked(function: Callable[P, R]) -> Callable[P, R]:
    """The function, which raises InputError for wrong arguments."""

    @functools.wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            return function(*args, **kwargs)
        except PumiceError:
            raise
        except (TypeError, ValueError, OverflowError, AttributeError, BufferError) as error:
            if not _is_about_an_argument(error):
                raise
            name = function.__qualname__.removesuffix(".__init__")
            raise InputError(f"{name}: {_reason(error)}") from error

    return call


def _is_about_an_argument(error: Exception) -> bool:
    """Whether an error comes from within a function, and from no code of its caller."""
    # Keywords of `open` and `compress` are passed on before they are known to be none.
    if isinstance(error, TypeError) and "unexpected keyword argument" in str(error):
        return False
    # The first entry is `call`; without a second one the function was not even entered.
    trace = error.__traceback__ and error.__traceback__.tb_next
    if trace is None:
        return False
    while trace is not None:
        file = trace.tb_frame.f_code.co_filename
        # Code of the standard library that is built in has names such as <frozen os>.
        if not file.startswith((*OURS, "<frozen ")):
            return False
        trace = trace.tb_next
    return True


def _reason(error: Exception) -> str:
    if isinstance(error, AttributeError) and error.name in ("_native", "labels"):
        return f"expected an object of pumice, got {type(error.obj).__name__}"
    return str(error)
