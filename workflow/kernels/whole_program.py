"""Kernels compiled as one program: parts are translated to LLVM's language and optimised once, with their kernel.

numba by itself optimises each function with all that it calls, and once more for each function that calls it. Here a
part waits until a kernel links it. There it has no other caller, so that LLVM inlines what is called from one place
and passes only what is read. Results keep their bits: without fastmath LLVM neither reorders nor contracts.

This module reaches into numba's compiler: its code libraries, passes and typing contexts. It is optional:
:mod:`workflow.kernels.compiled` uses it with the versions in :data:`TESTED` and leaves it out otherwise.
"""

# mypy: allow-untyped-calls

from __future__ import annotations

from functools import cache
from typing import Any

from llvmlite.binding import Linkage
from numba.core import typed_passes, types, untyped_passes
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.compiler_machinery import LoweringPass, PassManager, register_pass
from numba.core.datamodel.models import OpaqueModel
from numba.core.typing.context import Context
from numba.extending import register_model

from workflow.kernels.lean_lowering import LeanLower

TESTED = ("0.68",)
"""Minor versions of numba that this module was tested with."""

_TRANSLATION = (
    "TranslateByteCode",
    "FixupArgs",
    "IRProcessing",
    "RewriteSemanticConstants",
    "DeadBranchPrune",  # what an argument of None leaves out
    "GenericRewrites",
    "ReconstructSSA",
)
_LOWERING = ("AnnotateTypes", "NoPythonBackend")


class _Waiting(JITCodeLibrary):
    """Code of a part that becomes one with its callers: not made machine code before a kernel links it."""

    def finalize(self) -> None:
        self._raise_if_finalized()
        self._finalized = True


class _Brief(_Waiting):
    """Code of a part whose optimisation is mostly left to the kernel; loops over lanes would lose their vectors."""

    attributes: tuple[str, ...] = ()

    def _optimize_functions(self, module: Any) -> None:
        module.data_layout = self._codegen._data_layout
        passes, builder = self._codegen._function_pass_manager(opt=1)
        for function in module.functions:
            if not function.is_declaration:
                for attribute in self.attributes:
                    function.add_function_attribute(attribute)
                passes.run(function, builder)


class _Rare(_Brief):
    """Code of a part that runs rarely: kept apart, and short rather than fast."""

    attributes = ("noinline", "optsize")


class _Whole(JITCodeLibrary):
    """Code of a kernel with all its parts."""

    def add_linking_library(self, library: Any) -> None:
        if library in self._linking_libraries:
            return
        super().add_linking_library(library)
        if isinstance(library, _Waiting):
            for other in library._linking_libraries:
                self.add_linking_library(other)

    def _link_left_out(self) -> None:
        """Link parts that are called, but that LLVM's linker left out as nothing that was linked before called them.

        That happens where the first caller of a part was itself left out, its own call having been optimised away.
        """
        modules = [library._get_module_for_linking() for library in self._linking_libraries]
        defined = {f.name: module for module in modules for f in module.functions if not f.is_declaration}
        while absent := [f.name for f in self._final_module.functions if f.is_declaration and f.name in defined]:
            for name in absent:
                self._final_module.link_in(defined[name], preserve=True)

    def _optimize_final_module(self) -> None:
        """Optimise, knowing that what was linked has no callers elsewhere."""
        self._link_left_out()
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == Linkage.linkonce_odr:
                function.linkage = "internal"
        super()._optimize_final_module()


class _Pass(LoweringPass):
    def __init__(self) -> None:
        LoweringPass.__init__(self)


@register_pass(mutates_CFG=True, analysis_only=False)
class _Lowered(typed_passes.BaseNativeLowering):
    """Lowers a function to few instructions."""

    _name = "workflow_lowered"  # type: ignore[assignment]

    @property
    def lowering_class(self) -> type[LeanLower]:
        return LeanLower


@register_pass(mutates_CFG=False, analysis_only=True)
class _Offered(_Pass):
    """Offers a part without machine code to its callers, under a builtin that raises where Python calls it."""

    _name = "workflow_offered"

    def run_pass(self, state: Any) -> bool:
        lowered = state["cr"]
        entry = f"{{{state.func_id.func_name} is a part of kernels that Python cannot call}}".format
        state.library.environment = lowered.env  # which nothing else keeps
        state.targetctx.insert_user_function(entry, lowered.fndesc, [state.library])
        state["cr"] = lowered._replace(cfunc=entry)
        return True


@register_pass(mutates_CFG=False, analysis_only=True)
class _Surrounded(_Pass):
    """Gives the parts in a compiled kernel their environments, as numba does when it loads one."""

    _name = "workflow_surrounded"

    def run_pass(self, state: Any) -> bool:
        for environment in state.cr._find_referenced_environments():
            state.library.codegen.set_env(environment.env_name, environment)
        return True


class _Function(types.Function):
    """A function of numba's own that remembers its signatures: typing them anew takes a third of the time."""

    _plain: types.Function
    _signatures: dict[Any, Any]

    def __init__(self, plain: types.Function):
        self.__dict__ = {**plain.__dict__, "_plain": plain, "_signatures": {}}

    def get_call_type(self, context: Any, args: Any, kws: Any) -> Any:
        key = tuple(args)
        if not kws and key in self._signatures:
            return self._signatures[key]
        signature = self._plain.get_call_type(context, args, kws)
        if not kws and signature is not None:
            self._signatures[key] = signature
        return signature

    def augment(self, other: Any) -> Any:
        return self._plain.augment(other)


class _Typing(Context):
    """numba's typing context, in which functions remember their signatures."""

    def __init__(self, context: Context):
        self.__dict__ = context.__dict__

    def _lookup_global(self, gv: Any) -> Any:
        kind = super()._lookup_global(gv)
        return _function(kind) if type(kind) is types.Function else kind


register_model(_Function)(OpaqueModel)
_function, _typing = cache(_Function), cache(_Typing)


class KernelCompiler(Compiler):
    """Compiles a kernel and its parts into a library that can be cached; only the passes that kernels need."""

    library: type[JITCodeLibrary] = _Whole
    last: tuple[type[LoweringPass], type[LoweringPass]] = (_Surrounded, typed_passes.NoPythonBackend)

    def __init__(self, typing: Any, target: Any, *others: Any):
        super().__init__(typing if isinstance(typing, _Typing) else _typing(typing), target, *others)

    def define_pipelines(self) -> list[Any]:
        """Return the passes, and choose the library."""
        state = self.state
        state.library = self.library(state.targetctx.codegen(), state.func_id.func_qualname)
        if isinstance(state.library, _Waiting):
            state.flags.no_compile = True
        else:
            state.library.enable_object_caching()
        passes = PassManager("kernel")
        counted = ("IRLegalization",) if state.flags.nrt else ()  # ends the life of arrays that are counted
        typed = ("NopythonTypeInference", "PreLowerStripPhis", *counted, *_LOWERING)
        for module, names in ((untyped_passes, _TRANSLATION), (typed_passes, typed)):
            for name in names:
                passes.add_pass(getattr(module, name), name)
        passes.add_pass_after(_Lowered, typed_passes.AnnotateTypes)
        passes.add_pass_after(*self.last)
        passes.finalize()
        return [passes]


class InlinedCompiler(KernelCompiler):
    """Translates what loops are made of."""

    library = _Waiting
    last = (_Offered, _Lowered)


class PartCompiler(InlinedCompiler):
    library = _Brief


class RareCompiler(InlinedCompiler):
    library = _Rare


def typed_alike(dispatcher: Any) -> Any:
    """Have a part translated once for a type of arguments, not once more for each constant it is called with."""
    template, plain = dispatcher.get_call_template, types.unliteral
    dispatcher.get_call_template = lambda args, named: template(
        [plain(each) for each in args], {name: plain(each) for name, each in named.items()}
    )
    return dispatcher
