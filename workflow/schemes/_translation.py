"""numba's compiler without what kernels do without: their translation takes longer than all that LLVM does.

- Of its passes some change nothing here: kernels have no closures, no array expressions, no branches
  on types.
- Typing tries dozens of candidates for an addition of two floats, and does so anew for each addition.
- For each element of an array that is read or written, the seven numbers that describe the array are
  stored anew.

What is used of numba's inside: the passes of its compiler, its contexts and its indexing of arrays.
"""

# mypy: allow-untyped-calls

from __future__ import annotations

import operator
from functools import cache, partial
from types import SimpleNamespace
from typing import Any

from numba.core import cgutils, types
from numba.core.compiler import Compiler, Flags
from numba.core.compiler_machinery import PassManager
from numba.core.cpu import CPUContext
from numba.core.datamodel.models import OpaqueModel
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
from numba.extending import register_model
from numba.np.arrayobj import basic_indexing, load_item, store_item

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


class _Function(types.Function):
    """A function or operator of numba's own, and the signatures it was found to have."""

    _known: types.Function
    _found: dict[Any, Any]

    def __init__(self, known: types.Function):
        self.__dict__ = {**known.__dict__, "_known": known, "_found": {}}

    def get_call_type(self, context: Any, args: Any, kws: Any) -> Any:
        """Return the signature of a call."""
        key = tuple(args)
        if kws or key not in self._found:
            found = self._known.get_call_type(context, args, kws)
            if kws or found is None:
                return found
            self._found[key] = found
        return self._found[key]

    def augment(self, other: Any) -> Any:
        """Return a function with the signatures of both."""
        return self._known.augment(other)


class _Typing(Context):
    """numba's typing context, where functions remember."""

    def __init__(self, known: Context):
        self.__dict__ = known.__dict__

    def _lookup_global(self, gv: Any) -> Any:
        found = super()._lookup_global(gv)
        return _function(found) if type(found) is types.Function else found


register_model(_Function)(OpaqueModel)

_function, _typing = cache(_Function), cache(_Typing)


class _Target(CPUContext):
    """numba's target context, with elements of arrays read and written in place."""

    def get_function(self, fn: Any, sig: Any, _firstcall: bool = True) -> Any:
        """Return what translates a call."""
        ours = _OURS.get(fn.typing_key) if isinstance(fn, types.Function) else None
        if ours is not None and _is_element(*sig.args[:2]):
            return partial(ours, self, sig)
        return super().get_function(fn, sig, _firstcall)


def _is_element(array: Any, index: Any) -> bool:
    """Tell whether integers choose one element."""
    kinds = getattr(index, "types", (index,))
    return (
        isinstance(array, types.Array)
        and len(kinds) == array.ndim
        and all(isinstance(kind, types.Integer) for kind in kinds)
    )


def _pointer(context: CPUContext, builder: Any, kinds: Any, array: Any, index: Any) -> Any:
    """Return the place of an element."""
    kind, index_kind = kinds
    several = isinstance(index_kind, types.BaseTuple)
    indices = cgutils.unpack_tuple(builder, index, len(index_kind)) if several else (index,)
    model = context.data_model_manager[kind]
    described = SimpleNamespace(**{name: model.get(builder, array, name) for name in ("data", "shape", "strides")})
    index_kinds = getattr(index_kind, "types", (index_kind,))
    return basic_indexing(context, builder, kind, described, index_kinds, indices, boundscheck=False)[0]


def _read(context: CPUContext, sig: Any, builder: Any, args: Any) -> Any:
    return load_item(context, builder, sig.args[0], _pointer(context, builder, sig.args, *args))


def _write(context: CPUContext, sig: Any, builder: Any, args: Any) -> None:
    kind, _, value_kind = sig.args
    array, index, value = args
    place = _pointer(context, builder, sig.args[:2], array, index)
    store_item(context, builder, kind, context.cast(builder, value, value_kind, kind.dtype), place)


_OURS: dict[Any, Any] = {operator.getitem: _read, operator.setitem: _write}


class Translator(Compiler):
    """Compiles with our flags and contexts, and with the passes that kernels need."""

    def __init__(self, typing: Any, target: Any, library: Any, args: Any, returned: Any, flags: Any, known: Any):
        remembering = typing if isinstance(typing, _Typing) else _typing(typing)
        super().__init__(remembering, target, library, args, returned, _Flags(flags), known)
        self.state.targetctx.__class__ = _Target  # of a copy, which has our options
        self.state.targetctx.typing_context = remembering

    def passes(self) -> PassManager:
        """Return the passes, to be finalized."""
        passes = PassManager("kernel")
        counted = (IRLegalization,) if self.state.flags.nrt else ()  # ends the life of what is counted
        for each in (*_PASSES, *counted, *_LOWERING):
            passes.add_pass(each, each.name())
        return passes
