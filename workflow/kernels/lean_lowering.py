"""Lowering of numba's that writes fewer instructions for tuples and for elements of arrays, to the same effect.

A tuple of arrays travels from function to function as some hundred numbers. numba puts them together in memory at the
beginning of each function and takes them apart again wherever a member is read or passed on, and each element of an
array by way of a copy of the array's description. LLVM removes all that, but writing and reading it is half of what
LLVM is given. Optional, with :mod:`workflow.kernels.whole_program`.
"""

# mypy: allow-untyped-calls, disable-error-code="misc"

from __future__ import annotations

from typing import Any, cast

from llvmlite import ir
from llvmlite.ir.instructions import InsertValue, PhiInstr
from numba.core import types
from numba.core.cgutils import get_item_pointer2, unpack_tuple
from numba.core.ir import Assign
from numba.core.lowering import Lower
from numba.np.arrayobj import load_item, store_item


def _is(value: Any, number: int) -> bool:
    return type(value) is ir.Constant and value.constant == number


class _Builder(ir.IRBuilder):
    """Leaves out what is known when it is written: members of tuples that were put in before, products with 1."""

    def extract_value(self, agg: Any, idx: Any, name: str = "") -> Any:
        path = list(idx) if isinstance(idx, tuple | list) else [idx]
        while path and isinstance(agg, InsertValue):
            if agg.indices == path[:1]:
                agg, path = agg.value, path[1:]
            else:
                agg = agg.aggregate
        return super().extract_value(agg, path, name) if path else agg

    def mul(self, lhs: Any, rhs: Any, *others: Any, **named: Any) -> Any:
        if _is(lhs, 1) or _is(rhs, 1):
            return rhs if _is(lhs, 1) else lhs
        return super().mul(lhs, rhs, *others, **named)

    def add(self, lhs: Any, rhs: Any, *others: Any, **named: Any) -> Any:
        if _is(lhs, 0) or _is(rhs, 0):
            return rhs if _is(lhs, 0) else lhs
        return super().add(lhs, rhs, *others, **named)


def _remove_unread(function: ir.Function) -> None:
    """Remove tuples that were put together and never read as a whole."""
    read: set[int] = set()
    for block in function.blocks:
        for each in block.instructions:
            if not isinstance(each, InsertValue):
                read.update(map(id, each.operands))
            if isinstance(each, PhiInstr):
                read.update(id(value) for value, _ in each.incomings)
    for block in reversed(function.blocks):
        kept = []
        for each in reversed(block.instructions):
            if isinstance(each, InsertValue):
                if id(each) not in read:
                    continue
                read.update(map(id, each.operands))
            kept.append(each)
        block.instructions[:] = kept[::-1]


def _kinds(index: Any) -> list[Any]:
    """Return the types of the places in an index."""
    return list(cast(Any, index).types) if isinstance(index, types.BaseTuple) else [index]


def _is_element(array: Any, index: Any) -> bool:
    """Tell whether an index of integers chooses one element of an array."""
    kinds = _kinds(index)
    return (
        isinstance(array, types.Array)
        and len(kinds) == array.ndim
        and all(isinstance(kind, types.Integer) for kind in kinds)
    )


class LeanLower(Lower):
    """Lowers functions that count no references this way, all others as numba does."""

    def setup_function(self, fndesc: Any) -> None:
        super().setup_function(fndesc)
        self._values: dict[str, Any] = {}
        self._once: set[str] = set()
        if not self.context.enable_nrt:
            self.builder = _Builder(self.entry_block)
            self._once = self._assigned_at_once()

    def _assigned_at_once(self) -> set[str]:
        """Return the variables that are assigned in the first block and nowhere else: they need no memory."""
        counts: dict[str, int] = {}
        for block in self.blocks.values():
            for each in block.find_insts(Assign):
                counts[each.target.name] = counts.get(each.target.name, 0) + 1
        first = self.blocks[min(self.blocks)].find_insts(Assign)
        return {each.target.name for each in first if counts[each.target.name] == 1}

    def storevar(self, value: Any, name: str, argidx: int | None = None) -> None:
        if name in self._once:
            self._values[name] = value
        else:
            super().storevar(value, name, argidx)

    def loadvar(self, name: str) -> Any:
        return self._values[name] if name in self._values else super().loadvar(name)

    def delvar(self, name: str) -> None:
        if name not in self._values:
            super().delvar(name)

    def lower_normal_function(self, fndesc: Any) -> None:
        super().lower_normal_function(fndesc)
        if not self.context.enable_nrt:
            _remove_unread(self.function)

    def _address(self, array: Any, index: Any) -> Any:
        """Return the address of an element; negative places count from the end."""
        builder, rows, at = self.builder, self.loadvar(array.name), self.loadvar(index.name)
        kind, chosen = self.typeof(array.name), self.typeof(index.name)
        model = self.context.data_model_manager[kind]
        data, *both = (model.get(builder, rows, name) for name in ("data", "shape", "strides"))
        shape, strides = (unpack_tuple(builder, each) for each in both)
        places = unpack_tuple(builder, at) if isinstance(chosen, types.BaseTuple) else [at]
        places = [self._place(*each) for each in zip(_kinds(chosen), places, shape, strict=True)]
        return get_item_pointer2(self.context, builder, data, shape, strides, kind.layout, places)

    def _place(self, kind: Any, place: Any, length: Any) -> Any:
        place = self.context.cast(self.builder, place, kind, types.intp if kind.signed else types.uintp)
        if not kind.signed or (isinstance(place, ir.Constant) and place.constant >= 0):
            return place
        negative = self.builder.icmp_signed("<", place, place.type(0))
        return self.builder.select(negative, self.builder.add(place, length), place)

    def lower_getitem(self, resty: Any, expr: Any, value: Any, index: Any, signature: Any) -> Any:
        array = self.typeof(value.name)
        if self.context.enable_nrt or not _is_element(array, self.typeof(index.name)):
            return super().lower_getitem(resty, expr, value, index, signature)
        element = load_item(self.context, self.builder, array, self._address(value, index))
        return self.context.cast(self.builder, element, array.dtype, resty)

    def lower_setitem(self, target_var: Any, index_var: Any, value_var: Any, signature: Any) -> Any:
        array = self.typeof(target_var.name)
        if self.context.enable_nrt or not _is_element(array, self.typeof(index_var.name)):
            return super().lower_setitem(target_var, index_var, value_var, signature)
        value = self.loadvar(value_var.name)
        value = self.context.cast(self.builder, value, self.typeof(value_var.name), array.dtype)
        store_item(self.context, self.builder, array, value, self._address(target_var, index_var))
        return None
