"""
Compile what only other compiled code calls, as far as that needs it.

numba makes machine code of every function that compiled code calls, once for the function itself
and once more inside each of its callers, whose callers do so again. Here such a function is typed
and lowered to LLVM's intermediate representation only. Whoever calls it takes that in and makes
machine code of the whole, once, with the same optimisations.
"""

from typing import Any

from numba import _dynfunc
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import register_pass
from numba.core.typed_passes import NativeLowering


class PartLibrary(JITCodeLibrary):
    """A function's own code and that of what it calls, neither optimised nor made executable."""

    def _optimize_functions(self, ll_module: Any) -> None: ...

    def _optimize_final_module(self) -> None: ...

    def _finalize_final_module(self) -> None:
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)
class PartLowering(NativeLowering):
    """Lower a function into a `PartLibrary`."""

    _name = "part_lowering"

    def run_pass(self, state: Any) -> bool:
        """Lower it, and tell where its callers find it."""
        state.library = PartLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        super().run_pass(state)
        lowered = state["cr"]
        key = _dynfunc.make_function(
            lowered.fndesc.lookup_module(), state.func_id.func_name, "", 0, lowered.env, ()
        )
        state.targetctx.insert_user_function(key, lowered.fndesc, [state.library])
        state["cr"] = lowered._replace(cfunc=key)
        return True


class PartCompiler(CompilerBase):
    """numba's compiler with `PartLowering` in the place of making machine code."""

    def define_pipelines(self) -> list[Any]:
        """Return the passes."""
        manager = DefaultPassBuilder.define_nopython_pipeline(self.state)
        for k, (kind, words) in enumerate(manager.passes):
            if kind is NativeLowering:
                manager.passes[k] = PartLowering, words
        manager.finalize()
        return [manager]
