"""Compilation of functions that compiled functions alone call, as parts of their callers.

Numba optimizes every function with all that it calls, and translates it to machine code. For a
function that is linked into others this is done again in each of them: a kernel of many functions
took twice the time to compile.

This extends private classes of Numba's compiler. With a version that has other classes, the
functions are compiled as Numba does it, see :func:`.compilation.inner`.
"""

from __future__ import annotations

from typing import Any

from numba._dynfunc import make_function
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.compiler_machinery import register_pass
from numba.core.lowering import Lower
from numba.core.typed_passes import NativeLowering


class _Fragment(JITCodeLibrary):
    """The code of a function with all that it calls, neither optimized nor translated."""

    def finalize(self) -> None:
        for library in dict.fromkeys(self._linking_libraries):
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._finalize_dynamic_globals()
        self._finalized = True


class _Lower(Lower):
    """Writes functions that stay functions: as part of each caller they take longer to compile."""

    def setup_function(self, fndesc: Any) -> None:
        super().setup_function(fndesc)
        if not fndesc.inline:
            self.function.attributes.add("noinline")


@register_pass(mutates_CFG=True, analysis_only=False)
class _FragmentLowering(NativeLowering):
    """The translation of Numba's code to LLVM's code, which is left as it is."""

    _name = "fragment_lowering"
    lowering_class = _Lower

    def run_pass(self, state: Any) -> bool:
        state.library = _Fragment(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        super().run_pass(state)
        state.library.finalize()
        lowered = state.cr
        key = make_function(  # by which callers find the fragment; it cannot be called
            lowered.fndesc.lookup_module(), state.func_id.func_qualname, "", 0, lowered.env,
            (state.library,),
        )  # fmt: skip
        state.targetctx.insert_user_function(key, lowered.fndesc, [state.library])
        state.cr = lowered._replace(cfunc=key)
        return True


class FragmentCompiler(Compiler):
    """Numba's compiler with this lowering, of functions that Python does not call."""

    def define_pipelines(self) -> list[Any]:
        """The steps of the compiler."""
        self.state.flags.no_cpython_wrapper = self.state.flags.no_cfunc_wrapper = True
        pipelines: list[Any] = Compiler.define_pipelines(self)
        for pipeline in pipelines:
            pipeline.passes = [
                (_FragmentLowering if step is NativeLowering else step, description)
                for step, description in pipeline.passes
            ]
            pipeline._finalized = False
            pipeline.finalize()
        return pipelines
