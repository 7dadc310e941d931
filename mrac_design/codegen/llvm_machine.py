"""Compiling LLVM's assembly language inside the process, by llvmlite."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

from mrac_design.errors import CompilationError


def llvm_available() -> bool:
    """Whether llvmlite is installed."""
    return find_spec("llvmlite") is not None


class LlvmModule:
    """Machine code of a module, for this processor, alive as long as this value is."""

    def __init__(self, source: str) -> None:
        import llvmlite.binding as llvm

        llvm.initialize_native_target()
        llvm.initialize_native_asmprinter()
        try:
            module = llvm.parse_assembly(source)
            module.verify()
        except RuntimeError as problem:
            raise CompilationError(["llvmlite"], str(problem)) from problem
        machine = llvm.Target.from_default_triple().create_target_machine(
            cpu=llvm.get_host_cpu_name(),
            features=llvm.get_host_cpu_features().flatten(),
            opt=2,
        )
        options = llvm.create_pipeline_tuning_options(speed_level=2)
        passes = llvm.create_pass_builder(machine, options)
        passes.getModulePassManager().run(module, passes)
        self._engine: Any = llvm.create_mcjit_compiler(module, machine)
        self._engine.finalize_object()

    def address(self, name: str) -> int:
        """Address of a function of the module."""
        return int(self._engine.get_function_address(name))
