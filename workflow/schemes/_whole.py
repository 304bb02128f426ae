"""Kernels compiled as one program: parts are translated to LLVM's language, and optimised once with their kernel.

numba by itself optimises each function with everything it calls and makes machine code of it, and once
more for each function that calls it; arrays go from one to the next as seven numbers each. Here a part
waits until a kernel takes it in. There it is known to have no other caller, so that LLVM inlines what
is called from one place and passes what is read only. Results keep their bits: LLVM neither reorders
nor contracts arithmetic without fastmath.

What is used of numba's inside: its code libraries and the passes of its compiler.
"""

# mypy: allow-untyped-calls

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from llvmlite.binding import Linkage
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler_machinery import LoweringPass, register_pass
from numba.core.typed_passes import NativeLowering, NoPythonBackend
from numba.core.types import unliteral

from workflow.schemes._translation import Translator


class _Waiting(JITCodeLibrary):
    """Code of a part: neither linked nor made machine code before a kernel takes it in."""

    def finalize(self) -> None:
        """Let nothing be added any more."""
        self._raise_if_finalized()
        self._finalized = True


class _Brief(_Waiting):
    """Code of a part that leaves most of its optimisation to the kernel.

    Not for what is inlined by force: loops over lanes lose their vectors when so little is done before.
    """

    def _optimize_functions(self, module: Any) -> None:
        """Make it shorter."""
        module.data_layout = self._codegen._data_layout
        passes, builder = self._codegen._function_pass_manager(opt=1)
        for function in module.functions:
            if not function.is_declaration:
                self._mark(function)
                passes.run(function, builder)

    def _mark(self, function: Any) -> None:
        """Tell LLVM what is known of it."""


class _Rare(_Brief):
    """Code of a part that runs rarely."""

    def _mark(self, function: Any) -> None:
        """Keep it apart and short."""
        function.add_function_attribute("noinline")
        function.add_function_attribute("optsize")


class _Whole(JITCodeLibrary):
    """Code of a kernel with all its parts."""

    def add_linking_library(self, library: Any) -> None:
        """Take in a library and what it waits for."""
        if library in self._linking_libraries:
            return
        super().add_linking_library(library)
        if isinstance(library, _Waiting):
            for other in library._linking_libraries:
                self.add_linking_library(other)

    def _optimize_final_module(self) -> None:
        """Optimise, knowing that what was linked in has no callers elsewhere."""
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == Linkage.linkonce_odr:
                function.linkage = "internal"
        super()._optimize_final_module()


@register_pass(mutates_CFG=False, analysis_only=True)
class _Offered(LoweringPass):
    """Offers a part that was not made machine code to the functions that call it."""

    _name = "workflow_offered"

    def __init__(self) -> None:
        LoweringPass.__init__(self)

    def run_pass(self, state: Any) -> bool:
        """Register the part under a builtin, as numba asks for, that raises where Python calls it."""
        lowered = state["cr"]
        entry = f"{{{state.func_id.func_name} is a part of kernels that Python cannot call}}".format
        state.library.environment = lowered.env  # which nothing else keeps
        state.targetctx.insert_user_function(entry, lowered.fndesc, [state.library])
        state["cr"] = lowered._replace(cfunc=entry)
        return True


@register_pass(mutates_CFG=False, analysis_only=True)
class _Surrounded(LoweringPass):
    """Gives the parts in a compiled kernel their environments, as numba does when it loads one."""

    _name = "workflow_surrounded"

    def __init__(self) -> None:
        LoweringPass.__init__(self)

    def run_pass(self, state: Any) -> bool:
        """Set the environments."""
        for environment in state.cr._find_referenced_environments():
            state.library.codegen.set_env(environment.env_name, environment)
        return True


class _Compiler(Translator):
    """Compiles into a library of our own."""

    def _passes(self, library: type[JITCodeLibrary], added: type[LoweringPass], after: type[LoweringPass]) -> list[Any]:
        """Return the passes, into a library of a type and with one pass more."""
        self.state.library = library(self.state.targetctx.codegen(), self.state.func_id.func_qualname)
        passes = self.passes()
        passes.add_pass_after(added, after)
        passes.finalize()
        return [passes]


class InlinedCompiler(_Compiler):
    """Translates a part that becomes one with its callers, and is what loops are made of."""

    _kind: type[_Waiting] = _Waiting

    def define_pipelines(self) -> list[Any]:
        """Leave machine code out."""
        self.state.flags.no_compile = True
        return self._passes(self._kind, _Offered, NativeLowering)


class PartCompiler(InlinedCompiler):
    """Translates a part."""

    _kind = _Brief


class RareCompiler(InlinedCompiler):
    """Translates a part that runs rarely."""

    _kind = _Rare


class KernelCompiler(_Compiler):
    """Compiles a kernel and its parts."""

    def define_pipelines(self) -> list[Any]:
        """Compile into a library that takes parts in, and that can be cached."""
        passes = self._passes(_Whole, _Surrounded, NoPythonBackend)
        self.state.library.enable_object_caching()
        return passes


def typed_alike(dispatcher: Any) -> Any:
    """Let a part be translated once for a type of arguments, not once more for each constant it is called with."""
    known = dispatcher.get_call_template

    def template(args: Sequence[Any], named: Mapping[str, Any]) -> Any:
        return known([unliteral(a) for a in args], {name: unliteral(a) for name, a in named.items()})

    dispatcher.get_call_template = template
    return dispatcher
