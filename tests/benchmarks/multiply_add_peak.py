"""The processor's peak of multiply-adds: independent fused ones on full registers, nothing else in the loop.

Written in LLVM's own language, so that no compiler decides what is vectorised: each turn of the loop does one
multiply-add on each of ten registers as wide as the processor has them, which no other waits for (two units with a
latency of four need eight).
"""

import ctypes
from functools import cache
from typing import Any

import llvmlite.binding as llvm

ACCUMULATORS = 10


def _lanes() -> int:
    features = llvm.get_host_cpu_features()
    return 8 if features.get("avx512f") else 4 if features.get("fma") else 2


def _text(lanes: int) -> str:
    """Return the loop: x ← a x + b on every register, ``turns`` times; the sum keeps them from being left out."""
    wide = f"<{lanes} x double>"

    def all_lanes(value: str) -> str:
        return "<" + ", ".join([f"double {value}"] * lanes) + ">"

    numbers = range(ACCUMULATORS)
    begin = [f"  %x{k} = phi {wide} [ {all_lanes(f'{k}.5')}, %entry ], [ %y{k}, %loop ]" for k in numbers]
    factors = f"{wide} {all_lanes('0.5')}, {wide} {all_lanes('1.0')}"
    turn = [f"  %y{k} = call {wide} @llvm.fma.v{lanes}f64({wide} %x{k}, {factors})" for k in numbers]
    total = [f"  %s{k} = fadd {wide} %y{k}, {f'%s{k - 1}' if k else all_lanes('0.0')}" for k in numbers]
    return "\n".join(
        [
            f"declare {wide} @llvm.fma.v{lanes}f64({wide}, {wide}, {wide})",
            "define double @peak(i64 %turns) {",
            "entry:",
            "  br label %loop",
            "loop:",
            "  %i = phi i64 [ 0, %entry ], [ %next, %loop ]",
            *begin,
            *turn,
            "  %next = add i64 %i, 1",
            "  %more = icmp slt i64 %next, %turns",
            "  br i1 %more, label %loop, label %end",
            "end:",
            *total,
            f"  %first = extractelement {wide} %s{ACCUMULATORS - 1}, i32 0",
            "  ret double %first",
            "}",
        ]
    )


@cache
def _compiled() -> tuple[Any, Any, int]:
    """Return the engine, which must outlive its code, the loop and its multiply-adds in a turn."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    machine = llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(), features=llvm.get_host_cpu_features().flatten(), opt=2
    )
    lanes = _lanes()
    module = llvm.parse_assembly(_text(lanes))
    module.verify()
    engine = llvm.create_mcjit_compiler(module, machine)
    engine.finalize_object()
    call = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_int64)(engine.get_function_address("peak"))
    return engine, call, lanes * ACCUMULATORS


def turn(turns: int) -> float:
    _, call, _ = _compiled()
    return float(call(turns))


def multiply_adds_of_a_turn() -> int:
    """Return the multiply-adds of one turn of the loop."""
    return _compiled()[2]
