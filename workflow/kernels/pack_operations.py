"""What numba does for the operations of :mod:`workflow.kernels.packs`: their types, and the instructions they become.

A pack is a vector of LLVM's, whatever the registers of the processor hold. Each lane's arithmetic is that of the plain
loop, operation by operation: its bits are the same. Imported with numba, when the first kernel is compiled.

What is used of numba's inside: the making of types, and of operations on them.
"""

# mypy: allow-untyped-calls, allow-untyped-defs, allow-untyped-decorators, disable-error-code="misc"

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any, TypeVar, cast

from llvmlite import ir
from numba import config, types
from numba.core import cgutils
from numba.core.codegen import get_host_cpu_features
from numba.core.datamodel.models import PrimitiveModel
from numba.core.typing.templates import (
    AbstractTemplate,
    infer,
    infer_global,
    make_intrinsic_template,
    signature,
)
from numba.extending import lower_builtin, register_model

from workflow.kernels import packs
from workflow.kernels.lanes import PACK, WIDE

F = TypeVar("F", bound=Callable[..., Any])

_chosen = cast(Any, config).CPU_FEATURES
_FEATURES = get_host_cpu_features() if _chosen is None else _chosen

BROAD = 4 * PACK if "+avx512f" in _FEATURES.split(",") else WIDE
"""Lanes of the largest packs: four registers where a register holds eight numbers; more than four overflow them."""


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
    "fdiv": (operator.truediv, operator.itruediv),
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


def _implements(operation: Callable[..., Any]) -> Callable[[F], F]:
    """Have numba use what a function builds where a kernel calls an operation, as :func:`numba.extending.intrinsic`.

    An intrinsic would be an object of its own, and importing it would import numba.
    """

    def add(build: F) -> F:
        template = make_intrinsic_template(operation, build, operation.__name__)
        infer(template)
        infer_global(operation, types.Function(template))
        return build

    return add


def _lane(width):
    def lane(context, first):
        return _LaneType(width)(types.intp), lambda context, builder, sig, args: args[0]

    return lane


for _declared, _width in ((packs.narrow, PACK), (packs.wide, WIDE), (packs.broad, BROAD)):
    _implements(_declared)(_lane(_width))


def _address(context, builder, kinds, rows, at):
    """Return the address of a number of an array."""
    model = context.data_model_manager[kinds[0]]
    data, shape, strides = (model.get(builder, rows, name) for name in ("data", "shape", "strides"))
    places = [
        place if isinstance(kind, _LaneType) else context.cast(builder, place, kind, types.intp)
        for place, kind in zip(cgutils.unpack_tuple(builder, at), kinds[1], strict=True)
    ]
    shape, strides = cgutils.unpack_tuple(builder, shape), cgutils.unpack_tuple(builder, strides)
    return cgutils.get_item_pointer2(context, builder, data, shape, strides, kinds[0].layout, places)


@_implements(packs.pack)
def _pack(context, rows, at):
    kind = _PackType(at[-1].width)

    def build(context, builder, sig, args):
        address = builder.bitcast(_address(context, builder, sig.args, *args), kind.numbers.as_pointer())
        return builder.load(address, align=8)

    return kind(rows, at), build


@_implements(packs.store)
def _store(context, rows, at, numbers):
    def build(context, builder, sig, args):
        address = builder.bitcast(_address(context, builder, sig.args, *args[:2]), numbers.numbers.as_pointer())
        builder.store(args[2], address, align=8)
        return context.get_dummy_value()

    return types.none(rows, at, numbers), build


@_implements(packs.shared)
def _shared(context, array, at, lane):
    def build(context, builder, sig, args):
        number = builder.load(_address(context, builder, sig.args, *args[:2]))
        number.set_metadata("invariant.load", builder.module.add_metadata([]))
        return _spread(builder, number, lane.width)

    return _PackType(lane.width)(array, at, lane), build


@_implements(packs.of_lane)
def _of_lane(context, value, lane):
    if not isinstance(value, types.Array):
        return _spread_out(context, value, lane)

    def build(context, builder, sig, args):
        place, kind = context.make_tuple(builder, types.Tuple([lane]), [args[1]]), _PackType(lane.width)
        address = _address(context, builder, (value, types.Tuple([lane])), args[0], place)
        return builder.load(builder.bitcast(address, kind.numbers.as_pointer()), align=8)

    return _PackType(lane.width)(value, lane), build


@_implements(packs.where)
def _where(context, condition, this, other):
    def build(context, builder, sig, args):
        return builder.select(args[0], *_as_packs(builder, sig.args[1:], args[1:], condition.width))

    return _PackType(condition.width)(condition, this, other), build


@_implements(packs.some)
def _some(context, condition):
    def build(context, builder, sig, args):
        bits = ir.IntType(condition.width)
        return builder.icmp_unsigned("!=", builder.bitcast(args[0], bits), ir.Constant(bits, 0))

    return types.boolean(condition), build


@_implements(packs.some_nonzero)
def _some_nonzero(context, numbers):
    def build(context, builder, sig, args):
        bits, zero = ir.IntType(numbers.width), ir.Constant(numbers.numbers, [0.0] * numbers.width)
        differ = builder.bitcast(builder.fcmp_unordered("!=", args[0], zero), bits)
        return builder.icmp_unsigned("!=", differ, ir.Constant(bits, 0))

    return types.boolean(numbers), build


@_implements(packs.raised)
def _raised(context, rows, at):
    def build(context, builder, sig, args):
        bits = ir.IntType(64)
        address = builder.bitcast(_address(context, builder, sig.args, *args), bits.as_pointer())
        return builder.icmp_unsigned("!=", builder.load(address), ir.Constant(bits, 0))

    return types.boolean(rows, at), build


@_implements(packs.flag)
def _flag(context, rows, at, up):
    def build(context, builder, sig, args):
        bits = ir.IntType(64)
        address = builder.bitcast(_address(context, builder, sig.args, *args[:2]), bits.as_pointer())
        builder.store(builder.zext(args[2], bits), address)
        return context.get_dummy_value()

    return types.none(rows, at, up), build


@_implements(packs.align_stack)
def _align_stack(context):
    def build(context, builder, sig, args):
        builder.function.attributes.add("nounwind")  # alone, the next one is not written down
        builder.function.attributes.alignstack = 8 * PACK
        return context.get_dummy_value()

    return types.none(), build


@_implements(packs.fetch)
def _fetch(context, array, at):
    def build(context, builder, sig, args):
        address, number = _address(context, builder, sig.args, *args), ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [address.type, number, number, number])
        function = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0")
        builder.call(function, [address, *(ir.Constant(number, k) for k in (1, 3, 1))])
        return context.get_dummy_value()

    return types.none(array, at), build


@_implements(packs.magnitude)
def _magnitude(context, numbers):
    def build(context, builder, sig, args):
        kind = ir.FunctionType(numbers.numbers, [numbers.numbers])
        return builder.call(
            cgutils.get_or_insert_function(builder.module, kind, f"llvm.fabs.v{numbers.width}f64"), args
        )

    return numbers(numbers), build


@_implements(packs.fused)
def _fused(context, factor, other, number):
    def build(context, builder, sig, args):
        kind = ir.FunctionType(number.numbers, [number.numbers] * 3)
        return builder.call(cgutils.get_or_insert_function(builder.module, kind, f"llvm.fma.v{number.width}f64"), args)

    return number(factor, other, number), build


@_implements(packs.spread)
def _spread_out(context, number, lane):
    def build(context, builder, sig, args):
        return _spread(builder, args[0], lane.width)

    return _PackType(lane.width)(types.float64, lane), build


@_implements(packs.broadest)
def _broadest(context):
    def build(context, builder, sig, args):
        return ir.Constant(cgutils.intp_t, BROAD)

    return types.intp(), build
