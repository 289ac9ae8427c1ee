"""Equations are recorded as lists of operations, and printed as machine code, C and JavaScript.

Start with `program`: what a trace is. `recording` makes one by calling an equation with `handles`, which note what is
done to them; `sharing` splits off what lanes share; `llvm`, `c99`, `javascript` and `ptx` print; `machine` compiles and
loads; `calling` does all of that for one equation.
"""
