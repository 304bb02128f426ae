"""Packs: numbers of 8, 16 or 32 lanes side by side, on which a kernel computes at once.

The compiler steps eight lanes of a plain loop at once where it can prove that no two rows overlap, and
compares addresses before each loop where it can't; sums over modes it takes to memory and back for
every few modes. Packs say it outright, and a pack goes through a whole step in registers::

    for first in range(0, lanes, PACK):
        lane = narrow(first)
        heat = pack(own, (HEAT, lane))
        store(own, (HEAT, lane), where(heat > 0.0, 2.0 * heat, heat))

A pack is a vector of LLVM's, whatever the registers of the processor hold. A wide or broad one
shares what is read and asked for all lanes among more of them, where there are so many, and has more sums in
progress at a time. Each lane's arithmetic is that of the plain loop, operation by operation: its bits are the same.

What is used of numba's inside: the making of types, and of operations on them.
"""

# mypy: allow-untyped-calls, allow-untyped-defs, allow-untyped-decorators, disable-error-code="misc"

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any, Protocol, cast

from llvmlite import ir
from numba import config, types
from numba.core import cgutils
from numba.core.codegen import get_host_cpu_features
from numba.core.datamodel.models import PrimitiveModel
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, register_model

from workflow.models import Array
from workflow.schemes._lanes import PACK, WIDE

_told = cast(Any, config).CPU_FEATURES
_FEATURES = get_host_cpu_features() if _told is None else _told

BROAD = 4 * PACK if "+avx512f" in _FEATURES.split(",") else WIDE
"""Lanes of the largest packs: four registers where a register holds eight numbers; more than four overflow them."""


class Mask(Protocol):
    """A condition of each lane."""

    def __and__(self, other: Mask) -> Mask: ...
    def __invert__(self) -> Mask: ...


class Pack(Protocol):
    """A number of each lane."""

    def __add__(self, other: Pack | float) -> Pack: ...
    def __radd__(self, other: float) -> Pack: ...
    def __sub__(self, other: Pack | float) -> Pack: ...
    def __rsub__(self, other: float) -> Pack: ...
    def __mul__(self, other: Pack | float) -> Pack: ...
    def __rmul__(self, other: float) -> Pack: ...
    def __neg__(self) -> Pack: ...
    def __lt__(self, other: Pack | float) -> Mask: ...
    def __le__(self, other: Pack | float) -> Mask: ...
    def __gt__(self, other: Pack | float) -> Mask: ...
    def __ge__(self, other: Pack | float) -> Mask: ...


class Lane:
    """Where a pack begins in a row, and how wide it is: what :func:`narrow`, :func:`wide` and :func:`broad` return."""


class _LaneType(types.Type):
    def __init__(self, width: int) -> None:
        super().__init__(name=f"Lane({width})")
        self.width = width


class _PackType(types.Type):
    def __init__(self, width: int) -> None:
        super().__init__(name=f"Pack({width})")
        self.width, self.numbers = width, ir.VectorType(ir.DoubleType(), width)


class _MaskType(types.Type):
    def __init__(self, width: int) -> None:
        super().__init__(name=f"Mask({width})")
        self.width, self.bits = width, ir.VectorType(ir.IntType(1), width)


@register_model(_LaneType)
class _LaneModel(PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, cgutils.intp_t)


@register_model(_PackType)
class _PackModel(PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, kind.numbers)


@register_model(_MaskType)
class _MaskModel(PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, kind.bits)


def _spread(builder, number, width):
    """Return a pack of one number."""
    nothing = ir.Constant(ir.VectorType(ir.DoubleType(), width), ir.Undefined)
    first = builder.insert_element(nothing, number, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(first, nothing, ir.Constant(ir.VectorType(ir.IntType(32), width), [0] * width))


def _as_packs(builder, kinds, values, width):
    """Return packs and numbers as packs."""
    return [
        x if isinstance(kind, _PackType) else _spread(builder, x, width) for kind, x in zip(kinds, values, strict=True)
    ]


def _define(operation: Any, returned: type[_PackType | _MaskType], build: Callable[..., Any]) -> None:
    """Define a binary operation of packs, and of a pack and a number."""

    @infer_global(operation)
    class _Template(AbstractTemplate):
        def generic(self, args, kws):
            widths = {kind.width for kind in args if isinstance(kind, _PackType)}
            if len(widths) == 1 and all(isinstance(kind, _PackType) or kind == types.float64 for kind in args):
                return signature(returned(*widths), *args)
            return None

    for kinds in ((_PackType, _PackType), (_PackType, types.Float), (types.Float, _PackType)):

        @lower_builtin(operation, *kinds)
        def lower(context, builder, sig, args):
            return build(builder, *_as_packs(builder, sig.args, args, sig.return_type.width))


for _name, _operations in {
    "fadd": (operator.add, operator.iadd),
    "fsub": (operator.sub, operator.isub),
    "fmul": (operator.mul, operator.imul),
}.items():
    for _operation in _operations:
        _define(_operation, _PackType, lambda builder, a, b, name=_name: getattr(builder, name)(a, b))
for _name, _operation in {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge}.items():
    _define(_operation, _MaskType, lambda builder, a, b, name=_name: builder.fcmp_ordered(name, a, b))


def _define_alike(operation: Any, kind: type[_PackType | _MaskType], count: int, name: str) -> None:
    """Define an operation of packs or masks that returns one of them."""

    @infer_global(operation)
    class _Template(AbstractTemplate):
        def generic(self, args, kws):
            if len(args) == count and isinstance(args[0], kind) and len(set(args)) == 1:
                return signature(args[0], *args)
            return None

    @lower_builtin(operation, *[kind] * count)
    def lower(context, builder, sig, args):
        return getattr(builder, name)(*args)


_define_alike(operator.neg, _PackType, 1, "fneg")
_define_alike(operator.and_, _MaskType, 2, "and_")
_define_alike(operator.invert, _MaskType, 1, "not_")


def _lane(width):
    def lane(context, first):
        return _LaneType(width)(types.intp), lambda context, builder, sig, args: args[0]

    return lane


def _address(context, builder, kinds, rows, at):
    """Return the address of a number of an array."""
    array = context.make_array(kinds[0])(context, builder, rows)
    places = [
        place if isinstance(kind, _LaneType) else context.cast(builder, place, kind, types.intp)
        for place, kind in zip(cgutils.unpack_tuple(builder, at), kinds[1], strict=True)
    ]
    shape, strides = cgutils.unpack_tuple(builder, array.shape), cgutils.unpack_tuple(builder, array.strides)
    return cgutils.get_item_pointer2(context, builder, array.data, shape, strides, kinds[0].layout, places)


def _pack(context, rows, at):
    kind = _PackType(at[-1].width)

    def build(context, builder, sig, args):
        address = builder.bitcast(_address(context, builder, sig.args, *args), kind.numbers.as_pointer())
        return builder.load(address, align=8)

    return kind(rows, at), build


def _store(context, rows, at, numbers):
    def build(context, builder, sig, args):
        address = builder.bitcast(_address(context, builder, sig.args, *args[:2]), numbers.numbers.as_pointer())
        builder.store(args[2], address, align=8)
        return context.get_dummy_value()

    return types.none(rows, at, numbers), build


def _shared(context, array, at, lane):
    def build(context, builder, sig, args):
        number = builder.load(_address(context, builder, sig.args, *args[:2]))
        number.set_metadata("invariant.load", builder.module.add_metadata([]))
        return _spread(builder, number, lane.width)

    return _PackType(lane.width)(array, at, lane), build


def _where(context, condition, this, other):
    def build(context, builder, sig, args):
        return builder.select(args[0], *_as_packs(builder, sig.args[1:], args[1:], condition.width))

    return _PackType(condition.width)(condition, this, other), build


def _some(context, condition):
    def build(context, builder, sig, args):
        bits = ir.IntType(condition.width)
        return builder.icmp_unsigned("!=", builder.bitcast(args[0], bits), ir.Constant(bits, 0))

    return types.boolean(condition), build


def _some_nonzero(context, numbers):
    def build(context, builder, sig, args):
        bits, zero = ir.IntType(numbers.width), ir.Constant(numbers.numbers, [0.0] * numbers.width)
        differ = builder.bitcast(builder.fcmp_unordered("!=", args[0], zero), bits)
        return builder.icmp_unsigned("!=", differ, ir.Constant(bits, 0))

    return types.boolean(numbers), build


def _raised(context, rows, at):
    def build(context, builder, sig, args):
        bits = ir.IntType(64)
        address = builder.bitcast(_address(context, builder, sig.args, *args), bits.as_pointer())
        return builder.icmp_unsigned("!=", builder.load(address), ir.Constant(bits, 0))

    return types.boolean(rows, at), build


def _flag(context, rows, at, up):
    def build(context, builder, sig, args):
        bits = ir.IntType(64)
        address = builder.bitcast(_address(context, builder, sig.args, *args[:2]), bits.as_pointer())
        builder.store(builder.zext(args[2], bits), address)
        return context.get_dummy_value()

    return types.none(rows, at, up), build


def _align_stack(context):
    def build(context, builder, sig, args):
        builder.function.attributes.add("nounwind")  # alone, the next one is not written down
        builder.function.attributes.alignstack = 8 * PACK
        return context.get_dummy_value()

    return types.none(), build


def _weighed(context, weight, after, rest, before):
    def build(context, builder, sig, args):
        if rest is types.none:
            return args[1]
        first, last = (builder.fmul(_spread(builder, args[k], after.width), args[k + 1]) for k in (0, 2))
        return builder.fadd(first, last)

    return after(weight, after, rest, before), build


def _fetch(context, array, at):
    def build(context, builder, sig, args):
        address, number = _address(context, builder, sig.args, *args), ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [address.type, number, number, number])
        function = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0")
        builder.call(function, [address, *(ir.Constant(number, k) for k in (1, 3, 1))])
        return context.get_dummy_value()

    return types.none(array, at), build


def _magnitude(context, numbers):
    def build(context, builder, sig, args):
        kind = ir.FunctionType(numbers.numbers, [numbers.numbers])
        return builder.call(
            cgutils.get_or_insert_function(builder.module, kind, f"llvm.fabs.v{numbers.width}f64"), args
        )

    return numbers(numbers), build


def _spread_out(context, number, lane):
    def build(context, builder, sig, args):
        return _spread(builder, args[0], lane.width)

    return _PackType(lane.width)(types.float64, lane), build


align_stack = cast(Callable[[], None], intrinsic(_align_stack))
"""Let the kernel that says so keep packs for which it has no register where they fill whole lines of the cache.

Else they lie across two, at a distance that depends on who called it.
"""

narrow = cast(Callable[[int], Lane], intrinsic(_lane(PACK)))
"""Return the lane that begins a pack of ``PACK``."""

wide = cast(Callable[[int], Lane], intrinsic(_lane(WIDE)))
"""Return the lane that begins a pack of ``WIDE``."""

broad = cast(Callable[[int], Lane], intrinsic(_lane(BROAD)))
"""Return the lane that begins a pack of ``BROAD``."""

pack = cast(Callable[[Array, tuple[int | Lane, ...]], Pack], intrinsic(_pack))
"""Return the pack that begins at a place of an array: ``pack(rows, (row, lane))``."""

store = cast(Callable[[Array, tuple[int | Lane, ...], Pack], None], intrinsic(_store))
"""Put a pack where it begins in an array: ``store(rows, (row, lane), numbers)``."""

shared = cast(Callable[[Array, tuple[int, ...], Lane], Pack], intrinsic(_shared))
"""Return a number of an array for all lanes of a pack. Nothing may write to the array while the kernel runs:
the number is read once and stays in a register where there is one."""

fetch = cast(Callable[[Array, tuple[int, ...]], None], intrinsic(_fetch))
"""Let the line of the cache that holds a number of an array be fetched, which is written some steps later."""

where = cast(Callable[[Mask, Pack | float, Pack | float], Pack], intrinsic(_where))
"""Return each lane's number of the first pack where its condition holds, else of the second."""

some = cast(Callable[[Mask], bool], intrinsic(_some))
"""Tell whether a condition holds in some lane."""

raised = cast(Callable[[Array, tuple[int | Lane, ...]], bool], intrinsic(_raised))
"""Tell whether a pack's flag is up, which lies in a row where the pack begins: ``raised(rows, (row, lane))``."""

flag = cast(Callable[[Array, tuple[int | Lane, ...], bool], None], intrinsic(_flag))
"""Put a pack's flag up or down: ``flag(rows, (row, lane), up)``."""

some_nonzero = cast(Callable[[Pack], bool], intrinsic(_some_nonzero))
"""Tell whether a number in some lane is not 0, as a NaN is."""

weighed = cast(Callable[[float, Pack, float | None, Pack], Pack], intrinsic(_weighed))
"""Return ``weight * after + rest * before``, or ``after`` alone where the rest is ``None``: a kernel of its own."""

magnitude = cast(Callable[[Pack], Pack], intrinsic(_magnitude))
"""Return the numbers without their signs."""

spread = cast(Callable[[float, Lane], Pack], intrinsic(_spread_out))
"""Return a pack of one number."""
