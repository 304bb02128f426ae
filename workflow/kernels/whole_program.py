"""Whole-program compilation of kernels: parts are translated to few instructions and optimised once, in their kernel.

numba by itself optimises each function with its callees, and again for each of its callers. Here a part is hardly
optimised before a kernel links it, where it has no other caller: LLVM inlines functions with one call and passes only
arguments that are read. Half of numba's code packs and unpacks tuples of arrays; it is not generated. The bits are the
same: without fastmath LLVM neither reorders nor contracts. Without this module (``WORKFLOW_PLAIN_NUMBA=1``) a first run
without compiled kernels takes several times as long. The module uses internals of numba's compiler, and is optional:
:mod:`workflow.kernels.compiled` uses it with the tested versions.
"""

# mypy: allow-untyped-calls, disable-error-code="assignment, attr-defined, method-assign, misc"

from __future__ import annotations

import gc
from collections import Counter
from contextlib import nullcontext
from functools import cache
from typing import Any

from llvmlite import binding, ir
from llvmlite.binding import Linkage
from numba.core import base, codegen, compiler, datamodel, errors, lowering, postproc, transforms, typed_passes, types
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.ir import Assign
from numba.np import arrayobj

_READING = ("TranslateByteCode", "FixupArgs", "IRProcessing")
_REWRITING = ("RewriteSemanticConstants", "DeadBranchPrune", "GenericRewrites", "ReconstructSSA")
_TYPING = ("NopythonTypeInference", "PreLowerStripPhis", "AnnotateTypes", "NoPythonBackend")

_YOUNG = 50_000
"""New objects after which Python looks for cycles while a kernel is compiled. At its usual 700 a fifth of the time goes
there, and the largest memory of the process is the same."""


class _Library(codegen.JITCodeLibrary):
    """Code of a function with little optimisation, before it is linked."""

    def _optimize_functions(self, module: Any) -> None:
        module.data_layout = self._codegen._data_layout
        builder = self._codegen._pass_builder(opt=1)
        passes = binding.create_new_function_pass_manager()
        passes.add_sroa_pass()
        passes.add_simplify_cfg_pass()  # instructions combined before they are inlined make steps a sixth slower
        for function in module.functions:
            if not function.is_declaration:
                passes.run(function, builder)


class _Waiting(_Library):
    """Code of a part, which is not compiled to machine code before a kernel links it."""

    def finalize(self) -> None:
        for function in self._final_module.functions:
            if not function.is_declaration:
                function.linkage = "weak_odr"  # else LLVM drops functions without a linked caller
        self._finalized = True


class _Whole(_Library):
    """Code of a kernel with all its parts."""

    def add_linking_library(self, library: Any) -> None:
        if library not in self._linking_libraries:
            super().add_linking_library(library)
            for other in library._linking_libraries if isinstance(library, _Waiting) else ():
                self.add_linking_library(other)

    def finalize(self) -> None:
        self._linking_libraries.sort(key=lambda library: not isinstance(library, _Waiting))  # callers first
        super().finalize()

    def _optimize_final_module(self) -> None:
        """Optimise with the linked functions internal, as they have no other callers."""
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage in (Linkage.weak_odr, Linkage.linkonce_odr):
                function.linkage = "internal"
        passes, builder = self._codegen._module_pass_manager(
            loop_vectorize=False, slp_vectorize=False, opt=0, cost="cheap"
        )
        passes.run(self._final_module, builder)  # rotates loops, which are vectorised then
        tuning = binding.create_pipeline_tuning_options(speed_level=3)
        tuning.loop_vectorization = True
        tuning.loop_unrolling = tuning.loop_interleaving = tuning.slp_vectorization = False  # packs are written out
        builder = binding.create_pass_builder(self._codegen._tm, tuning)
        builder.getModulePassManager().run(self._final_module, builder)


class _Builder(ir.IRBuilder):
    """Builder that takes a tuple's member from the instruction that inserted it."""

    def extract_value(self, agg: Any, idx: Any, name: str = "") -> Any:
        path = list(idx) if isinstance(idx, tuple | list) else [idx]
        while path and isinstance(agg, ir.InsertValue):
            agg, path = (agg.value, path[1:]) if agg.indices == path[:1] else (agg.aggregate, path)
        return super().extract_value(agg, path, name) if path else agg


class _Lower(lowering.Lower):
    """Lowers a function to few instructions."""

    def _find_singly_assigned_variable(self) -> None:
        """Find the variables that need no memory, including those assigned once in the first block."""
        super()._find_singly_assigned_variable()
        assigned = {at: [each.target.name for each in block.find_insts(Assign)] for at, block in self.blocks.items()}
        counts = Counter(name for names in assigned.values() for name in names)
        self._singly_assigned_vars.update(name for name in assigned[min(assigned)] if counts[name] == 1)


@cache
def _array(kind: Any, make_array: Any = arrayobj.make_array) -> Any:
    """Return numba's description of an array, read from the array's value instead of a copy in memory."""

    class Description(make_array(kind)):
        def __init__(self, context: Any, builder: Any, value: Any = None, ref: Any = None):
            super().__init__(context, builder, value, ref)
            self._known = value

        def __getitem__(self, index: int) -> Any:
            value = self._known
            return super().__getitem__(index) if value is None else self._builder.extract_value(value, index)

        def __setitem__(self, index: int, value: Any) -> None:
            self._known = None
            super().__setitem__(index, value)

        shape = property(lambda self: self.__getattr__("shape"))

    return Description


@cache
def _signature(of: Any, context: Any, args: Any, *, usual: Any = types.BaseFunction.get_call_type, **named: Any) -> Any:
    """Return the cached signature of a call of numba's own function."""
    return usual(of, context, args, named)


_HASHES: dict[int, tuple[int, Any]] = {}
"""Hash of each type by its identity, and the type, which so stays."""


def _hash(kind: Any) -> int:
    """Return the hash of a type, which is asked for some hundred thousand times: a tuple's hashes all its members."""
    if id(kind) not in _HASHES:
        _HASHES[id(kind)] = hash(kind.key), kind
    return _HASHES[id(kind)][0]


@cache
def _packer(context: Any, kinds: Any) -> Any:
    """Return numba's cached description of how arguments of these types are passed."""
    return datamodel.ArgPacker(context.data_model_manager, kinds)


def _post_process(of: Any, emit_dels: bool = False, usual: Any = postproc.PostProcessor.run, **how: Any) -> None:
    """Bring blocks into numba's canonical form after a pass, without lifetimes of variables, which no pass needs."""
    if emit_dels or of.func_ir.is_generator:
        usual(of, emit_dels, **how)
    else:
        of.func_ir.blocks, of.func_ir.generator_info = transforms.canonicalize_cfg(of.func_ir.blocks), None


_REPLACED: tuple[tuple[Any, str, Any], ...] = (
    (arrayobj, "make_array", _array),
    (lowering, "IRBuilder", _Builder),
    (lowering, "new_error_context", lambda *_, **__: nullcontext()),
    (type(errors.termcolor()), "errmsg", lambda _, message: message),
    (types.Type, "__hash__", _hash),
    (postproc.PostProcessor, "run", _post_process),
    (base.BaseContext, "get_arg_packer", lambda context, kinds: _packer(context, tuple(kinds))),
    (datamodel.ArgPacker, "assign_names", lambda *_: None),
    (types.BaseFunction, "get_call_type", lambda of, at, args, named: _signature(of, at, tuple(args), **named)),
    (base.BaseContext, "get_abi_sizeof", cache(base.BaseContext.get_abi_sizeof)),
)
"""Functions of numba that are replaced while a kernel is compiled, for shorter code with the same effect."""


def translated_once(dispatcher: Any) -> Any:
    """Make a part compile once for each type of arguments, not once more for each constant argument."""
    usual, plain = dispatcher.get_call_template, types.unliteral
    dispatcher.get_call_template = lambda args, named: usual(
        [plain(each) for each in args], {name: plain(each) for name, each in named.items()}
    )
    return dispatcher


@register_pass(mutates_CFG=True, analysis_only=False)
class _Lowered(typed_passes.NativeLowering):
    """Lowers a function, and registers a part for its callers with an entry that raises where Python calls it."""

    _name = "workflow_lowered"
    lowering_class = _Lower

    def run_pass(self, state: Any) -> bool:
        super().run_pass(state)
        if state.flags.no_compile:
            lowered = state["cr"]
            entry = f"{{{state.func_id.func_name} is a part of kernels that Python cannot call}}".format
            state.targetctx.insert_user_function(entry, lowered.fndesc, [state.library])
            state["cr"] = lowered._replace(cfunc=entry)
        return True


class KernelCompiler(compiler.Compiler):
    """Compiles a kernel and its parts into a library that can be cached; only the passes that kernels need."""

    def _compile_core(self) -> Any:
        """Compile with the replaced functions, unseen by other code of the process, as numba compiles under a lock."""
        usual, (young, *older) = [getattr(owner, name) for owner, name, _ in _REPLACED], gc.get_threshold()
        try:
            gc.set_threshold(_YOUNG, *older)
            for owner, name, ours in _REPLACED:
                setattr(owner, name, ours)
            return super()._compile_core()
        finally:
            gc.set_threshold(young, *older)
            for (owner, name, _), before in zip(_REPLACED, usual, strict=True):
                setattr(owner, name, before)

    def define_pipelines(self) -> list[Any]:
        """Return the passes, and set the library."""
        state = self.state
        state.flags.no_compile = state.flags.no_cpython_wrapper  # a part has no entry from Python
        library = _Waiting if state.flags.no_compile else _Whole
        state.library = library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        passes = PassManager("kernel")
        for name in (*_READING, *_REWRITING, *_TYPING):
            passes.add_pass(getattr(compiler, name), name)
        passes.add_pass_after(_Lowered, typed_passes.AnnotateTypes)
        passes.finalize()
        return [passes]
