"""numba's compiler without what kernels do without: most of its passes, and looking operators up again and again.

A third of the time from Python to LLVM's language goes to passes that change nothing here: kernels
have no closures, no array expressions, no branches on types. Another part goes to typing, which tries
some fifty candidates for each addition of two floats.

What is used of numba's inside: the passes of its compiler, and its typing context.
"""

# mypy: allow-untyped-calls

from __future__ import annotations

from functools import cache
from types import BuiltinFunctionType
from typing import Any

from numba.core import types
from numba.core.compiler import Compiler, Flags
from numba.core.compiler_machinery import PassManager
from numba.core.typed_passes import (
    AnnotateTypes,
    IRLegalization,
    NativeLowering,
    NoPythonBackend,
    NopythonTypeInference,
    PreLowerStripPhis,
)
from numba.core.typing.context import Context
from numba.core.untyped_passes import FixupArgs, GenericRewrites, IRProcessing, ReconstructSSA, TranslateByteCode

_PASSES = (
    TranslateByteCode,
    FixupArgs,
    IRProcessing,
    GenericRewrites,
    ReconstructSSA,
    NopythonTypeInference,
    PreLowerStripPhis,
)

_LOWERING = (AnnotateTypes, NativeLowering, NoPythonBackend)


class _Flags(Flags):
    """Options of a compilation that are compared as they are kept.

    numba looks them up for each candidate of each operation that it types, and reads all of them for
    that: a tenth of its time.
    """

    def __hash__(self) -> int:
        return len(self._values)

    def __eq__(self, other: object) -> bool:
        return self is other or (self._values == other._values if isinstance(other, _Flags) else super().__eq__(other))


class _Typing(Context):
    """numba's typing context, and what it found for operators and functions of its own."""

    def __init__(self, known: Context):
        self.__dict__ = known.__dict__

    def resolve_function_type(self, func: Any, args: Any, kws: Any) -> Any:
        """Return the signature of a call."""
        if kws or not isinstance(func, types.Function | BuiltinFunctionType):  # not ours, which are compiled there
            return super().resolve_function_type(func, args, kws)
        key = (id(func), tuple(args))
        if key not in _FOUND:
            found = super().resolve_function_type(func, args, kws)
            if found is None:
                return None
            _FOUND[key] = found, func
        return _FOUND[key][0]


_FOUND: dict[tuple[int, tuple[Any, ...]], tuple[Any, Any]] = {}
"""Signature by function and types of arguments; a function is kept lest another takes its place."""

_typing = cache(_Typing)


class Translator(Compiler):
    """Compiles with our flags, and with the passes that kernels need."""

    def __init__(self, typing: Any, target: Any, library: Any, args: Any, returned: Any, flags: Any, known: Any):
        remembering = typing if isinstance(typing, _Typing) else _typing(typing)
        super().__init__(remembering, target, library, args, returned, _Flags(flags), known)

    def passes(self) -> PassManager:
        """Return the passes, to be finalized."""
        passes = PassManager("kernel")
        counted = (IRLegalization,) if self.state.flags.nrt else ()  # ends the life of what is counted
        for each in (*_PASSES, *counted, *_LOWERING):
            passes.add_pass(each, each.name())
        return passes
