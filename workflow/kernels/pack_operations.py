"""Implementation in numba of the operations of :mod:`workflow.kernels.packs`: their types and LLVM instructions.

A pack is an LLVM vector, for registers of any size. Each lane's arithmetic is that of the plain loop, operation by
operation, with the same bits. Imported with numba, when the first kernel is compiled.

It uses numba's internals for types and for operations on them.
"""

# mypy: allow-untyped-calls, allow-untyped-defs, allow-untyped-decorators, disable-error-code="misc"

from __future__ import annotations

import inspect
import operator
from collections.abc import Callable
from typing import Any, TypeVar, cast

from llvmlite import ir
from numba import config, types
from numba.core import cgutils
from numba.core.codegen import get_host_cpu_features
from numba.core.datamodel.models import PrimitiveModel
from numba.core.typing.templates import AbstractTemplate, infer, infer_global, make_intrinsic_template, signature
from numba.extending import lower_builtin, register_model
from numba.np.arrayobj import make_array, populate_array

from workflow.kernels import packs
from workflow.kernels.lanes import PACK

F = TypeVar("F", bound=Callable[..., Any])

_chosen = cast(Any, config).CPU_FEATURES
_FEATURES = get_host_cpu_features() if _chosen is None else _chosen

BROAD = 4 * PACK if "+avx512f" in _FEATURES.split(",") else PACK
"""Lanes of the largest packs: four of 32 registers of eight numbers, or two of 16 of four: more would spill."""


_FLAG = ir.IntType(64)
"""Type of a flag: the size of a number of a row."""


class _Kind(types.Type):
    """Type of a value in ``width`` lanes; ``content`` is its LLVM type."""

    def __init__(self, width: int, content: ir.Type) -> None:
        super().__init__(name=f"{type(self).__name__}({width})")
        self.width, self.content = width, content


class _LaneType(_Kind):
    def __init__(self, width: int) -> None:
        super().__init__(width, cgutils.intp_t)


class _PackType(_Kind):
    def __init__(self, width: int) -> None:
        super().__init__(width, ir.VectorType(ir.DoubleType(), width))


class _MaskType(_Kind):
    def __init__(self, width: int) -> None:
        super().__init__(width, ir.VectorType(ir.IntType(1), width))


@register_model(_LaneType)
@register_model(_PackType)
@register_model(_MaskType)
class _Model(PrimitiveModel):
    def __init__(self, manager: Any, kind: _Kind) -> None:
        super().__init__(manager, kind, kind.content)


def _spread(builder, number, width):
    """Return a pack of one number."""
    nothing = ir.Constant(ir.VectorType(ir.DoubleType(), width), ir.Undefined)
    first = builder.insert_element(nothing, number, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(first, nothing, ir.Constant(ir.VectorType(ir.IntType(32), width), [0] * width))


def _as_packs(builder, kinds, values, width):
    """Return packs, and numbers spread to packs."""
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


def _implements(operation: Callable[..., Any], returned: Callable[..., types.Type]) -> Callable[[F], F]:
    """Return a decorator of the code of an operation in kernels, as :func:`numba.extending.intrinsic`.

    ``returned`` gives the type of the result from those of the arguments; code that returns None has no result. An
    intrinsic would be an object of its own, whose import would import numba.
    """

    def add(build: F) -> F:
        def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            built = build(context, builder, sig, args)
            return context.get_dummy_value() if built is None else built

        def define(context: Any, *kinds: Any) -> Any:
            return returned(*kinds)(*kinds), lower

        first = inspect.Parameter("context", inspect.Parameter.POSITIONAL_ONLY)
        given = inspect.signature(operation).parameters.values()
        define.__signature__ = inspect.Signature([first, *given])  # type: ignore[attr-defined]
        template = make_intrinsic_template(operation, define, operation.__name__)
        infer(template)
        infer_global(operation, types.Function(template))
        return build

    return add


@_implements(packs.narrow, lambda first: _LaneType(PACK))
@_implements(packs.broad, lambda first, beside: _LaneType(BROAD if beside is types.none else min(BROAD, 2 * PACK)))
def _lane(context, builder, sig, args):
    return context.cast(builder, args[0], sig.args[0], types.intp)


def _address(context, builder, kinds, args, content=None):
    """Return the address of a number of an array, from the array and an index in ``args``, as one of ``content``."""
    model = context.data_model_manager[kinds[0]]
    alone = isinstance(kinds[1], _LaneType)
    at, at_kinds = ([args[1]], [kinds[1]]) if alone else (cgutils.unpack_tuple(builder, args[1]), kinds[1])
    data, shape, strides = (model.get(builder, args[0], name) for name in ("data", "shape", "strides"))
    places = [
        place if isinstance(kind, _LaneType) else context.cast(builder, place, kind, types.intp)
        for place, kind in zip(at, at_kinds, strict=True)
    ]
    shape, strides = cgutils.unpack_tuple(builder, shape), cgutils.unpack_tuple(builder, strides)
    address = cgutils.get_item_pointer2(context, builder, data, shape, strides, kinds[0].layout, places)
    return address if content is None else builder.bitcast(address, content.as_pointer())


def _call(builder, name, returned, args):
    """Call an LLVM function."""
    kind = ir.FunctionType(returned, [each.type for each in args])
    return builder.call(cgutils.get_or_insert_function(builder.module, kind, name), args)


@_implements(packs.lanes_of, lambda lane: types.UniTuple(types.intp, 2))
def _lanes_of(context, builder, sig, args):
    behind = builder.add(args[0], ir.Constant(cgutils.intp_t, sig.args[0].width))
    return context.make_tuple(builder, sig.return_type, [args[0], behind])


@_implements(packs.pack, lambda rows, at: _PackType((at if isinstance(at, _LaneType) else at[-1]).width))
def _pack(context, builder, sig, args):
    return builder.load(_address(context, builder, sig.args, args, sig.return_type.content), align=8)


@_implements(packs.store, lambda rows, at, numbers: types.none)
def _store(context, builder, sig, args):
    builder.store(args[2], _address(context, builder, sig.args, args, args[2].type), align=8)


@_implements(packs.shared, lambda array, at, lane: _PackType(lane.width))
def _shared(context, builder, sig, args):
    number = builder.load(_address(context, builder, sig.args, args))
    number.set_metadata("invariant.load", builder.module.add_metadata([]))
    return _spread(builder, number, sig.return_type.width)


@_implements(packs.spread, lambda number, lane: _PackType(lane.width))
def _spread_out(context, builder, sig, args):
    return _spread(builder, context.cast(builder, args[0], sig.args[0], types.float64), sig.return_type.width)


@_implements(packs.where, lambda condition, this, other: _PackType(condition.width))
def _where(context, builder, sig, args):
    return builder.select(args[0], *_as_packs(builder, sig.args[1:], args[1:], sig.return_type.width))


@_implements(packs.some, lambda condition: types.boolean)
def _some(context, builder, sig, args):
    bits = ir.IntType(sig.args[0].width)
    return builder.icmp_unsigned("!=", builder.bitcast(args[0], bits), ir.Constant(bits, 0))


@_implements(packs.some_nonzero, lambda numbers: types.boolean)
def _some_nonzero(context, builder, sig, args):
    (numbers,) = sig.args
    zero = ir.Constant(numbers.content, [0.0] * numbers.width)
    return _some(context, builder, sig, [builder.fcmp_unordered("!=", args[0], zero)])


@_implements(packs.raised, lambda row, lane: types.boolean)
def _raised(context, builder, sig, args):
    flags = builder.load(_address(context, builder, sig.args, args, _FLAG))
    return builder.icmp_unsigned("!=", flags, ir.Constant(_FLAG, 0))


@_implements(packs.flag, lambda row, lane, up: types.none)
def _flag(context, builder, sig, args):
    builder.store(builder.zext(args[2], _FLAG), _address(context, builder, sig.args, args, _FLAG))


@_implements(packs.magnitude, lambda numbers: numbers)
def _magnitude(context, builder, sig, args):
    return _call(builder, f"llvm.fabs.v{sig.return_type.width}f64", sig.return_type.content, args)


@_implements(packs.fused, lambda factor, other, number: number)
def _fused(context, builder, sig, args):
    return _call(builder, f"llvm.fma.v{sig.return_type.width}f64", sig.return_type.content, args)


@_implements(packs.view, lambda row, at, shape: types.Array(row.dtype, len(shape), "C"))
def _view(context, builder, sig, args):
    made, width = sig.return_type, context.get_abi_sizeof(context.get_value_type(sig.return_type.dtype))
    source = make_array(sig.args[0])(context, builder, value=args[0])
    sizes = [
        context.cast(builder, size, kind, types.intp)
        for size, kind in zip(cgutils.unpack_tuple(builder, args[2]), sig.args[2], strict=True)
    ]
    strides = [context.get_constant(types.intp, width)]
    for size in sizes[:0:-1]:
        strides.insert(0, builder.mul(strides[0], size))
    table = make_array(made)(context, builder)
    data = builder.gep(source.data, [context.cast(builder, args[1], sig.args[1], types.intp)])
    populate_array(table, data=data, shape=sizes, strides=strides, itemsize=strides[-1], meminfo=None)
    return table._getvalue()
