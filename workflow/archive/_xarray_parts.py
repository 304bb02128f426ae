"""What archives ask of xarray beside its own: one index for all coordinates of a zip, and texts that can be turned."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from xarray.backends import BackendArray
from xarray.core import indexing
from xarray.indexes import PandasIndex

from workflow.archive._numbers import find_near


class ZipIndex(PandasIndex):
    """An index of the coordinates along one dimension together: xarray stacks no dimension that has several."""

    @classmethod
    def from_variables(cls, variables: Mapping[Any, Any], *, options: Mapping[str, Any]) -> ZipIndex:
        """Return the index of coordinates."""
        (dim,) = {variable.dims[0] for variable in variables.values()}
        return cls(pd.MultiIndex.from_arrays([each.values for each in variables.values()], names=list(variables)), dim)

    def create_variables(self, variables: Mapping[Any, Any] | None = None) -> dict[Any, Any]:
        """Return the coordinates."""
        named = {name: np.asarray(self.index.get_level_values(name)) for name in self.index.names}
        kept = {name: (variables or {}).get(name) for name in named}
        return {name: xr.Variable(self.dim, named[name], getattr(kept[name], "attrs", None)) for name in named}

    def sel(self, labels: dict[Any, Any], method: Any = None, tolerance: Any = None) -> Any:
        """Return where labels of one of the coordinates lie."""
        if len(labels) > 1:
            raise ValueError(f"{', '.join(labels)} lie along one dimension: select by one of them")
        (name,) = labels
        return PandasIndex(find_near(self.index.get_level_values(name)), self.dim).sel(labels, method, tolerance)

    def rename(self, name_dict: Mapping[Any, Any], dims_dict: Mapping[Any, Any]) -> ZipIndex:
        """Return the index of coordinates of other names."""
        names = [name_dict.get(name, name) for name in self.index.names]
        return ZipIndex(self.index.rename(names), dims_dict.get(self.dim, self.dim))


class _Texts(BackendArray):
    def __init__(self, texts: Any):
        self.texts, self.shape, self.dtype = texts, texts.shape, texts.dtype

    def __getitem__(self, key: indexing.ExplicitIndexer) -> Any:
        return indexing.explicit_indexing_adapter(key, self.shape, indexing.IndexingSupport.OUTER, self._read)

    def _read(self, key: tuple[Any, ...]) -> Any:
        return np.asarray(indexing.LazilyIndexedArray(self.texts).oindex[indexing.OuterIndexer(key)])


def turnable(texts: xr.Variable) -> xr.Variable:
    """Return texts of a file that are read when they are used; xarray's own, of single characters, cannot be turned."""
    return xr.Variable(texts.dims, indexing.LazilyIndexedArray(_Texts(texts._data)), texts.attrs, texts.encoding)
