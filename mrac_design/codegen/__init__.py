"""Code generation: CasADi functions as optimised straight-line programs, for three machines.

CasADi SX functions → `StraightLine` programs (`reading`, `passes`, `trigonometry`, `packing`) → C
(`c_source`), LLVM (`llvm_source`) or CasADi again (`casadi_machine`). Every pass works on the
program, none on a machine's text, so the three machines run the same operations.
"""
