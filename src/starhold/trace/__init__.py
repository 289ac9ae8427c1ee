"""Equations are recorded as lists of operations, and printed as machine code, C and JavaScript.

Start with `program`, which defines a trace. `recording` makes one by calling an equation with `handles`, which record the
operations on them; `sharing` splits off the part common to all lanes; `llvm`, `c99`, `javascript` and `ptx` print;
`machine` compiles and loads; `calling` does all of this for one equation.
"""
