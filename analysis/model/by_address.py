"""Memory and functions by their address, for the innermost loops of a compiled kernel.

Between compiled functions numba counts references to every array and list that is handed on, which
costs more than a stage of the integration; it also lets an index count from the end, which keeps
loops out of SIMD. A number costs neither. Whoever takes an address keeps its owner alive.
"""

# ruff: noqa: PLR0917 - a contact term takes its numbers by position

from __future__ import annotations

import math
from typing import Any

from llvmlite import ir  # type: ignore[import-untyped]
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

_TERM_ARGUMENTS = 8
_TERM = types.UniTuple(types.float64, 4)  # type: ignore[no-untyped-call]


def _load(typingctx: Any, address: Any, index: Any) -> Any:
    """Return the float64 number ``index`` behind ``address``."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        pointer = builder.inttoptr(args[0], ir.DoubleType().as_pointer())
        return builder.load(builder.gep(pointer, [args[1]], inbounds=True))

    return types.float64(types.intp, types.intp), codegen


def _store(typingctx: Any, address: Any, index: Any, value: Any) -> Any:
    """Write the float64 number ``index`` behind ``address``."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        pointer = builder.inttoptr(args[0], ir.DoubleType().as_pointer())
        builder.store(args[2], builder.gep(pointer, [args[1]], inbounds=True))
        return context.get_dummy_value()

    return types.void(types.intp, types.intp, types.float64), codegen


def _call_term(
    typingctx: Any,
    addresses: Any,
    index: Any,
    delta: Any,
    rate: Any,
    elastic: Any,
    z: Any,
    p0: Any,
    p1: Any,
    p2: Any,
    p3: Any,
) -> Any:
    """Call the contact term whose address is the int64 number ``index`` behind ``addresses``.

    A term that fails (a division by zero) gives a force that is not a number, which ends the trace.
    """

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        convention, wanted = context.call_conv, (types.float64,) * _TERM_ARGUMENTS
        list_of = builder.inttoptr(args[0], ir.IntType(64).as_pointer())
        function = builder.inttoptr(
            builder.load(builder.gep(list_of, [args[1]], inbounds=True)),
            convention.get_function_type(_TERM, wanted).as_pointer(),
        )
        status, found = convention.call_function(builder, function, _TERM, wanted, args[2:])
        force = builder.select(
            cgutils.as_bool_bit(builder, status.is_error),  # type: ignore[no-untyped-call]
            ir.Constant(ir.DoubleType(), math.nan),
            builder.extract_value(found, 0),
        )
        return builder.insert_value(found, force, 0)

    return _TERM(types.intp, types.intp, *(types.float64,) * _TERM_ARGUMENTS), codegen


load: Any = intrinsic(_load)
"""``load(address, index)``: the float64 number ``index`` behind ``address``."""
store: Any = intrinsic(_store)
"""``store(address, index, value)``: write it."""
call_term: Any = intrinsic(_call_term)
"""``call_term(addresses, index, delta, rate, elastic, z, p0, p1, p2, p3)``: call a contact term."""


def address_of(term: Any) -> int:
    """Return where a compiled contact term begins; it stays there as long as the process.

    The term has the signature ``analysis.model.effect_solver.TERM``.
    """
    (compiled,) = term.overloads.values()
    return int(compiled.library.get_pointer_to_function(compiled.fndesc.llvm_func_name))
