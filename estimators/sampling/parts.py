"""
Compile a function for Python to call, or as a part of what other compiled code does.

numba makes machine code of every function that compiled code calls, once for the function itself
and once more inside each of its callers, whose callers do so again. A part is typed and lowered to
LLVM's intermediate representation, and simplified, no more. Whoever calls it takes that in, and
optimises the whole and makes machine code of it, once.

This takes names that are numba's own. Where one of them is missing the import of this module fails,
and `plain` stands in for it.
"""

from collections.abc import Callable
from typing import Any

import numba
from numba._dynfunc import make_function
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import register_pass
from numba.core.environment import lookup_environment
from numba.core.typed_passes import NativeLowering

from flexaxis.estimators.sampling.plain import OPTIONS, PART_OPTIONS

# what is overridden below: without these nothing would say that it no longer is
_OVERRIDDEN = JITCodeLibrary._optimize_final_module, JITCodeLibrary._finalize_final_module


def whole(function: Callable) -> Any:
    """Return what numba calls a compiled function, for Python to call."""
    return numba.njit(**OPTIONS, pipeline_class=WholeCompiler)(function)


def part(function: Callable, *, inline: bool, alone: bool) -> Any:
    """
    Return the same for compiled code to call.

    Parameters
    ----------
    function : callable
    inline : bool
        Whether it becomes a part of its callers however long it is.
    alone : bool
        Whether it is optimised before its callers take it in.
    """
    compiler = AloneCompiler if alone else PartCompiler
    return numba.njit(**PART_OPTIONS, forceinline=inline, pipeline_class=compiler)(function)


class PartLibrary(JITCodeLibrary):
    """A function's own code and that of what it calls: simplified, and no machine code."""

    def _optimize_final_module(self) -> None: ...

    def _finalize_final_module(self) -> None:
        self._finalized = True


class AloneLibrary(JITCodeLibrary):
    """The same, optimised, and no machine code."""

    def _finalize_final_module(self) -> None:
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)
class PartLowering(NativeLowering):
    """Lower a function and make nothing executable of it."""

    _name = "part_lowering"

    def run_pass(self, state: Any) -> bool:
        """Lower it, and tell where its callers find it."""
        state.flags.no_compile = True
        super().run_pass(state)
        lowered = state["cr"]
        key = make_function(
            lowered.fndesc.lookup_module(), state.func_id.func_name, "", 0, lowered.env, ()
        )
        state.targetctx.insert_user_function(key, lowered.fndesc, [state.library])
        state["cr"] = lowered._replace(cfunc=key)
        return True


@register_pass(mutates_CFG=True, analysis_only=False)
class WholeLowering(NativeLowering):
    """Lower a function with all parts of it."""

    _name = "whole_lowering"

    def run_pass(self, state: Any) -> bool:
        """Lower it, and give the code of its parts what numba looks up there at run time."""
        super().run_pass(state)
        for variable in state.library._final_module.global_variables:
            environment = lookup_environment(variable.name)
            if environment is not None:
                state.library.codegen.set_env(variable.name, environment)
        return True


class PartCompiler(CompilerBase):
    """numba's compiler with `PartLowering` in the place of making machine code."""

    def define_pipelines(self) -> list[Any]:
        """Return the passes."""
        return [_into(PartLibrary, self.state)]


class AloneCompiler(CompilerBase):
    """The same for what is optimised by itself."""

    def define_pipelines(self) -> list[Any]:
        """Return the passes."""
        return [_into(AloneLibrary, self.state)]


class WholeCompiler(CompilerBase):
    """numba's compiler with `WholeLowering`."""

    def define_pipelines(self) -> list[Any]:
        """Return the passes."""
        return [_with(self.state, WholeLowering)]


def _into(library: type[JITCodeLibrary], state: Any) -> Any:
    state.library = library(state.targetctx.codegen(), state.func_id.func_qualname)
    return _with(state, PartLowering)


def _with(state: Any, lowering: type[NativeLowering]) -> Any:
    manager = DefaultPassBuilder.define_nopython_pipeline(state)
    passes = [
        (lowering if kind is NativeLowering else kind, words) for kind, words in manager.passes
    ]
    manager.passes[:] = passes
    manager.finalize()
    return manager
